"""The folder of a training run: whether one can start, resume or is finished there, and a training in it."""

import json
import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch

from motet.errors import OutputError
from motet_train import distributed
from motet_train.precision import for_device
from motet_train.progress import Shown, log
from motet_train.recipes.recipe import SETTINGS, Job
from motet_train.runs import MANIFEST, WEIGHTS, Run, RunError
from motet_train.settings import to_toml
from motet_train.trainer import CHECKPOINT, LOG

BOARDS = "tensorboard"


def trained(
    job: Job, train: Callable[[Job], Run], options: Mapping[str, Any], resume: bool = False, boards: bool = False
) -> Run:
    """Train in the job's folder, by all processes that there are; the run is left there.

    train: is given the job, in a precision that the device has, and with what shows its progress. options: what
    repeats the run, beside the recipe. resume: from the folder's checkpoint, if it has one. boards: log for
    TensorBoard.
    OutputError if a run can neither start nor resume in that folder.
    """
    if job.device == "cuda" and not torch.cuda.is_available():
        raise RunError("torch finds no CUDA device: use --device cpu")
    with (
        distributed.processes(job.device) as device,
        run_folder(job.folder, resume),
        closing(Shown(job.folder / BOARDS if boards else None)) as progress,
    ):
        recipe = for_device(job.recipe, device)
        settings = to_toml(options, recipe)
        return train(replace(job, recipe=recipe, device=device, progress=progress, settings=settings))


@contextmanager
def run_folder(out: Path, resume: bool) -> Iterator[None]:
    """The folder to train in. Where training ends early: say how it continues, and leave nothing where it cannot.

    OutputError if a run can neither start nor resume in that folder.
    """
    if distributed.rank() != 0:
        yield
        return
    if out.exists() and not _unborn(out) and not (resume and (out / CHECKPOINT).is_file()):
        reason = f"it has no {CHECKPOINT}; choose" if resume else "it exists; remove it first or choose"
        raise OutputError(f"cannot write the run {out}: {reason} another folder")
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"cannot write the run {out}: {error.strerror}") from error
    try:
        yield
    except BaseException as error:
        if _unborn(out):
            shutil.rmtree(out)
        elif isinstance(error, KeyboardInterrupt):
            how = "" if resume else " with --resume"
            log.warning("stopped: the same command%s continues from %s", how, out / CHECKPOINT)
        raise


def is_finished(out: Path) -> bool:
    """Whether a folder holds a run that was trained to its end."""
    try:
        # a run that ended says how long it took
        return "seconds" in json.loads((out / MANIFEST).read_text(encoding="utf-8"))["training"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _unborn(out: Path) -> bool:
    """Whether a folder is empty, or a run's that was killed before its first checkpoint: it may start over."""
    if not out.is_dir() or (out / CHECKPOINT).exists():
        return False
    ours = (MANIFEST, SETTINGS, LOG, WEIGHTS, BOARDS)
    temporary = tuple(f".{name}." for name in (*ours, CHECKPOINT))
    foreign = [path.name for path in out.iterdir() if path.name not in ours and not path.name.startswith(temporary)]
    return not foreign and not is_finished(out)
