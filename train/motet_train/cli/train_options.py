"""What all commands ``motet train`` share: options, settings from a file, where the run goes, and how it ends."""

import json
import logging
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import click
import torch

from motet.errors import OutputError
from motet.motion.units import METRES
from motet_train import distributed
from motet_train.data.errors import DataError
from motet_train.manifest import About
from motet_train.precision import for_device
from motet_train.progress import Shown, log
from motet_train.recipes.recipe import SETTINGS, Job, Recipe
from motet_train.runs import MANIFEST, WEIGHTS, Run
from motet_train.settings import SettingsError, changed, read_settings, to_toml
from motet_train.trainer import CHECKPOINT, LOG

TABLES, BOARDS = "motet.tables", "tensorboard"


def _configure(context: click.Context, option: click.Parameter, path: Path | None) -> None:
    """Make the file's settings the options' defaults; the command line wins."""
    if path is None:
        return
    options, context.meta[TABLES] = read_settings(path)
    names = {_long(option).replace("-", "_"): option.name for option in context.command.params}
    if unknown := sorted(options.keys() - names.keys()):
        raise SettingsError(f"{path}: unknown setting {unknown[0]}: expected one of {', '.join(sorted(names))}")
    context.default_map = {**(context.default_map or {}), **{str(names[key]): options[key] for key in options}}


def _long(option: click.Parameter) -> str:
    """How an option is called where it is written out, without its hyphens."""
    return max(option.opts, key=len).lstrip("-")


OPTIONS = (
    click.option(
        "--config", type=Path, is_eager=True, expose_value=False, callback=_configure, help="TOML file of settings."
    ),
    click.option("-o", "--out", type=Path, required=True, help="Folder to write; must not exist."),
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True),
    click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option(
        "--precision",
        type=click.Choice(["float32", "bfloat16"]),
        help="Precision of matrix products; float32 where the device has no bfloat16.",
    ),
    click.option("--threads", type=click.IntRange(1), default=1, show_default=True),
    click.option("--resume", is_flag=True, help="Continue the run in --out, by the same command."),
    click.option("--tensorboard", is_flag=True, help="Write the log for TensorBoard, too."),
    click.option("--name", help="Bundle name. [default: the run's folder]"),
    click.option("--licence", help="Licence of the weights. [default: not stated]"),
    click.option("--data-licence", help="Licence of the data. [default: as the data states, or not stated]"),
)


unit_in = click.option("--unit-in", type=click.Choice(list(METRES)), help="Length unit of files that do not state it.")

SHARED = ("out", "seed", "device", "precision", "threads", "resume", "tensorboard", "name", "licence", "data_licence")


def train_command(
    name: str,
    recipes: Mapping[str, Recipe],
    *options: Callable[..., Any],
    defaults: Mapping[str, Any] | None = None,
) -> Callable[[Callable[..., Run]], click.Command]:
    """A command that trains by one of the recipes: the function is given the job and the command's own options.

    An option that is named like a field of the recipe changes it and is not given. defaults: of shared options.
    """

    def decorate(function: Callable[..., Run]) -> click.Command:
        @click.pass_context
        def command(context: click.Context, /, **given: Any) -> None:
            _train(context, recipes, function, given)

        command.__doc__ = function.__doc__
        presets = click.option("--preset", type=click.Choice(list(recipes)), default="default", show_default=True)
        decorated: Callable[..., Any] = command
        for option in reversed((*OPTIONS, presets, *options)):
            decorated = option(decorated)
        settings = {"default_map": dict(defaults or {})}
        first, _, _ = (function.__doc__ or "").partition("\n")
        return click.command(name, short_help=first, context_settings=settings)(decorated)

    return decorate


def _train(
    context: click.Context, recipes: Mapping[str, Recipe], function: Callable[..., Run], given: dict[str, Any]
) -> None:
    shared = {name: given.pop(name) for name in (*SHARED, "preset")}
    preset = recipes[shared["preset"]]
    recipe = changed(preset, context.meta.get(TABLES, {}), {**given, "precision": shared["precision"]})
    if shared["precision"] == "bfloat16" and recipe.training is None:
        raise SettingsError(f"{recipe.model} trains in float32 only")
    own = {name: value for name, value in given.items() if not _is_of(name, recipe)}
    if shared["device"] == "cuda" and not torch.cuda.is_available():
        raise DataError("torch finds no CUDA device: use --device cpu")
    torch.set_num_threads(shared["threads"])
    out: Path = shared["out"]
    licences = shared["licence"], shared["data_licence"]
    about = About(shared["name"] or out.name, shlex.join(["motet", *sys.argv[1:]]), shared["seed"], *licences)
    # a line for each chunk without --verbose, too; none with --quiet
    log.setLevel(logging.INFO if logging.getLogger("motet").isEnabledFor(logging.WARNING) else logging.NOTSET)
    with (
        distributed.processes(shared["device"]) as device,
        _folder(out, shared["resume"]),
        closing(Shown(out / BOARDS if shared["tensorboard"] else None)) as progress,
    ):
        recipe = for_device(recipe, device)
        settings = to_toml(_kept(context, {**shared, **own}), recipe)
        run = function(Job(recipe, about, out, device, progress, settings), **own)
        if distributed.rank() == 0:
            click.echo(_summary(out, run.manifest["training"]))


def _is_of(name: str, recipe: Recipe) -> bool:
    """Whether an option changes the recipe; what is found in the data is not for options to say."""
    parts = (part for part in (recipe.training, recipe.config, recipe.visits) if part is not None)
    return name not in recipe.derived and any(hasattr(part, name) for part in parts)


def _kept(context: click.Context, given: Mapping[str, Any]) -> dict[str, Any]:
    """The options that repeat the run, by the names they have on the command line."""
    names = {option.name: _long(option) for option in context.command.params}
    left_out = ("out", "resume", "tensorboard", "precision")  # the recipe has the last
    return {names[name]: value for name, value in given.items() if name not in left_out}


@contextmanager
def _folder(out: Path, resume: bool) -> Iterator[None]:
    """The folder to train in. Where training ends early: say how it goes on, and leave nothing where it cannot.

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
            click.echo(f"\nstopped: the same command with --resume continues from {out / CHECKPOINT}", err=True)
        raise


def _unborn(out: Path) -> bool:
    """Whether a folder is empty, or a run's that was killed before its first checkpoint: it may start over."""
    if not out.is_dir() or (out / CHECKPOINT).exists():
        return False
    ours = (MANIFEST, SETTINGS, LOG, WEIGHTS, BOARDS)
    temporary = tuple(f".{name}." for name in (*ours, CHECKPOINT))
    foreign = [path.name for path in out.iterdir() if path.name not in ours and not path.name.startswith(temporary)]
    # a run that ended says how long it took
    return not foreign and "seconds" not in _training(out / MANIFEST)


def _training(path: Path) -> Mapping[str, Any]:
    try:
        training: Mapping[str, Any] = json.loads(path.read_text())["training"]
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    return training


def _summary(out: Path, training: Mapping[str, Any]) -> str:
    unit = "step" if "steps" in training else "epoch"
    said = [f"{training['parameters']:,} parameters", f"{training[f'{unit}s']} {unit}s in {training['seconds']:g} s"]
    said += [f"{key} {training[key]:.4f}" for key in ("loss", "validation", "reconstruction") if key in training]
    summary = f"{out}: {', '.join(said)}, after {unit} {training[f'kept_{unit}']}"
    if "missed" not in training:
        return summary
    missed = f"misses {', '.join(training['missed'])}" if training["missed"] else "reaches all goals"
    return f"{summary}; the best of {training['candidates']} nets {missed}"
