"""A training in its folder: whether it can start or resume there, or is finished; its device and precision."""

import json
import shutil
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from dataclasses import replace
from pathlib import Path

import torch

from motet.bundle.fields import Json
from motet.errors import OutputError
from motet_train import distributed
from motet_train.progress import Shown, log
from motet_train.recipes.recipe import SETTINGS, Job, Recipe
from motet_train.runs import RUN_MANIFEST, WEIGHTS, Run, RunError
from motet_train.settings import to_toml
from motet_train.trainer import CHECKPOINT, LOG


def trained(job: Job, train: Callable[[Job], Run], options: Json, resume: bool = False, boards: bool = False) -> Run:
    """Train in the job's folder, with all processes, and leave the run there.

    train: called with the job, whose precision is adapted to the device and whose progress is shown. options: those
    that repeat the run, besides the recipe. resume: continue from the folder's checkpoint, if it has one. boards: log
    for TensorBoard. OutputError if a run can neither start nor resume in that folder.
    """
    if job.device == "cuda" and not torch.cuda.is_available():
        raise RunError("torch finds no CUDA device: use --device cpu")
    with (
        distributed.processes(job.device) as device,
        run_folder(job.folder, resume),
        closing(Shown(job.folder / "tensorboard" if boards else None)) as progress,
    ):
        recipe = _for_device(job.recipe, device)
        settings = to_toml(options, recipe)
        return train(replace(job, recipe=recipe, device=device, progress=progress, settings=settings))


def _for_device(recipe: Recipe, device: str) -> Recipe:
    """The recipe, in float32 if it asks for bfloat16 and the device lacks it, which is logged."""
    if recipe.training is None or recipe.training.precision == "float32" or has_bfloat16(device):
        return recipe
    if distributed.rank() == 0:
        log.info("%s has no products in bfloat16: training in float32", device)
    return replace(recipe, training=replace(recipe.training, precision="float32"))


def has_bfloat16(device: str) -> bool:
    """Whether a device has products in bfloat16.

    Without them, torch's layers take 4 to 30 times as long as in float32, and its LSTM refuses to run.
    """
    if device.startswith("cuda"):
        return bool(torch.cuda.is_bf16_supported(including_emulation=False))
    # these functions are private, so may disappear from torch; oneDNN's answer respects ONEDNN_MAX_CPU_ISA
    try:
        return bool(torch.ops.mkldnn._is_mkldnn_bf16_supported() and torch.cpu._is_avx512_bf16_supported())
    except (AttributeError, RuntimeError):
        return False


@contextmanager
def run_folder(out: Path, resume: bool) -> Iterator[None]:
    """Make the folder to train in.

    When training is interrupted, log how to continue; a folder without a checkpoint is removed. OutputError if a run
    can neither start nor resume in that folder.
    """
    if distributed.rank() != 0:
        yield
        return
    # refuse to write over another run
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
            option = "" if resume else " with --resume"
            log.warning("stopped: the same command%s continues from %s", option, out / CHECKPOINT)
        raise


def is_finished(out: Path) -> bool:
    """Whether a folder holds a finished run."""
    try:
        # only a finished run states how long it took
        return "seconds" in json.loads((out / RUN_MANIFEST).read_text(encoding="utf-8"))["training"]
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _unborn(out: Path) -> bool:
    """Whether a folder is empty, or has a run killed before its first checkpoint, so that training can start over."""
    if not out.is_dir() or (out / CHECKPOINT).exists():
        return False
    ours = (RUN_MANIFEST, SETTINGS, LOG, WEIGHTS, "tensorboard")
    temporary = tuple(f".{name}." for name in (*ours, CHECKPOINT))
    names = [path.name for path in out.iterdir()]
    return all(name in ours or name.startswith(temporary) for name in names) and not is_finished(out)
