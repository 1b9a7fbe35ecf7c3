"""Shared by all ``motet train`` commands: options, settings from a file, the output folder, and the final summary."""

import logging
import shlex
import sys
from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import click
import torch

from motet.bundle.fields import Json
from motet.motion.skeleton import METRES
from motet_train import distributed
from motet_train.data.store import SPLITS
from motet_train.progress import log
from motet_train.recipes.recipe import Job, Recipe
from motet_train.run_folder import trained
from motet_train.runs import About, Run
from motet_train.settings import SettingsError, changed, read_settings

Option = Callable[[Any], Any]
"""The type of ``click.option(...)``."""


def with_options(*options: Option) -> Option:
    """Several options as one, in their order in the help."""

    def decorate(function: Any) -> Any:
        for option in reversed(options):
            function = option(function)
        return function

    return decorate


def _configure(context: click.Context, option: click.Parameter, path: Path | None) -> None:
    """Make the file's settings the options' defaults; the command line wins."""
    if path is None:
        return
    options, context.meta["motet.tables"] = read_settings(path)
    names = {_long(option).replace("-", "_"): str(option.name) for option in context.command.params}
    if unknown := sorted(options.keys() - names.keys()):
        raise SettingsError(f"{path}: unknown setting {unknown[0]}: expected one of {', '.join(sorted(names))}")
    defaults = {names[key]: value for key, value in options.items()}
    context.default_map = {**(context.default_map or {}), **defaults}


def _long(option: click.Parameter) -> str:
    """An option's full name, without its hyphens."""
    return max(option.opts, key=len).lstrip("-")


where = with_options(
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True),
    click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option("--threads", type=click.IntRange(1), default=1, show_default=True),
    click.option("--licence", help="Licence of the weights. [default: not stated]"),
    click.option("--data-licence", help="Licence of the data. [default: the data's own, or not stated]"),
)

every_training = with_options(
    click.option(
        "--config", type=Path, is_eager=True, expose_value=False, callback=_configure, help="TOML file of settings."
    ),
    click.option("-o", "--out", type=Path, required=True, help="Folder to write; must not exist."),
    where,
    click.option(
        "--precision",
        type=click.Choice(["float32", "bfloat16"]),
        help="Precision of matrix products; float32 if the device lacks bfloat16.",
    ),
    click.option("--resume", is_flag=True, help="Resume the run in --out with the same command."),
    click.option("--tensorboard", is_flag=True, help="Also write a TensorBoard log."),
    click.option("--name", help="Bundle name. [default: the run's folder]"),
)

split = click.option(
    "--split",
    "by",
    metavar=f"[{'|'.join(SPLITS)}|PATTERN]",
    default="trial",
    show_default=True,
    help="What is kept back: trials, people, nothing, or the clips of a pattern such as 'ACCAD_*'.",
)
unit_in = click.option("--unit-in", type=click.Choice(list(METRES)), help="Length unit of files that do not state it.")


def train_command(
    name: str, recipes: Mapping[str, Recipe], *options: Option, defaults: Json | None = None
) -> Callable[[Callable[..., Run]], click.Command]:
    """A command that trains one of the recipes; the function receives the job and the command's own options.

    An option named like a field of the recipe sets that field and is not passed on. defaults: of shared options.
    """

    def decorate(function: Callable[..., Run]) -> click.Command:
        @click.pass_context
        def command(context: click.Context, /, **values: Any) -> None:
            _train(context, recipes, function, values)

        text = function.__doc__ or ""
        command.__doc__ = text
        preset = click.option("--preset", type=click.Choice(list(recipes)), default="default", show_default=True)
        settings = {"default_map": dict(defaults or {})}
        as_command = click.command(name, short_help=text.partition("\n")[0], context_settings=settings)
        return as_command(with_options(every_training, preset, *options)(command))

    return decorate


SHARED = ("out", "seed", "device", "precision", "threads", "resume", "tensorboard", "name", "licence", "data_licence")
"""Options of all commands that train."""


def _train(
    context: click.Context, recipes: Mapping[str, Recipe], function: Callable[..., Run], values: dict[str, Any]
) -> None:
    """Train with the values of a command's options."""
    # the recipe, with the options that are settings of it
    shared = {name: values.pop(name) for name in (*SHARED, "preset")}
    recipe = _changed(context, recipes[shared["preset"]], {**values, "precision": shared.pop("precision")})
    fields = _fields(recipe, values)
    unused = {name: value for name, value in values.items() if name not in fields}

    def train(job: Job) -> Run:
        run = function(job, **unused)
        _summarise(job.folder, run.manifest)
        return run

    # all others are saved with the run by their long names
    out = shared.pop("out")
    resume = shared.pop("resume")
    boards = shared.pop("tensorboard")
    names = {option.name: _long(option) for option in context.command.params}
    options = {names[name]: value for name, value in {**shared, **unused}.items()}
    about = begun(shared["name"] or out.name, shared)
    trained(Job(recipe, about, out, shared["device"]), train, options, resume, boards)


def _changed(context: click.Context, recipe: Recipe, values: Json) -> Recipe:
    """The recipe with the settings of a file and, over them, those of options."""
    recipe = changed(recipe, context.meta.get("motet.tables", {}), values)
    if values["precision"] == "bfloat16" and recipe.training is None:
        raise SettingsError(f"{recipe.model} trains in float32 only")
    return recipe


def _fields(recipe: Recipe, names: Collection[str]) -> set[str]:
    """Those of some options that are fields of the recipe; fields computed from the data cannot be set."""
    parts = [part for part in (recipe.training, recipe.config, recipe.visits) if part is not None]
    fields = set()
    for name in names:
        if name not in recipe.derived and any(hasattr(part, name) for part in parts):
            fields.add(name)
    return fields


def begun(name: str, options: Json) -> About:
    """Set torch's threads, and log a line for each chunk unless --quiet; the entries of the manifest about the run."""
    torch.set_num_threads(options["threads"])
    log.setLevel(logging.INFO if logging.getLogger("motet").isEnabledFor(logging.WARNING) else logging.NOTSET)
    command = shlex.join(["motet", *sys.argv[1:]])
    return About(name, command, options["seed"], options["licence"], options["data_licence"])


def _summarise(out: Path, manifest: Json) -> None:
    """Print the figures of a run, and the next command."""
    if distributed.rank() == 0:
        click.echo(_summary(out, manifest["training"]))
        click.echo(f"next: {_next(out, manifest)}")


def _next(out: Path, manifest: Json) -> str:
    """The next command for a run."""
    if manifest["verb"] == "codec":
        return f"motet train codes --codec {out} --actions RUN"
    if manifest["verb"] == "actions":
        return f"motet train codes --codec RUN --actions {out}"
    return f"motet evaluate {out}; motet export {out} -o {out.name}.zip"


def _summary(out: Path, training: Json) -> str:
    unit = "step" if "steps" in training else "epoch"
    entries = [f"{training['parameters']:,} parameters", f"{training[f'{unit}s']} {unit}s in {training['seconds']:g} s"]
    entries += [f"{key} {training[key]:.4f}" for key in ("loss", "validation", "reconstruction") if key in training]
    summary = f"{out}: {', '.join(entries)}, after {unit} {training[f'kept_{unit}']}"
    if "missed" not in training:
        return summary
    missed = f"misses {', '.join(training['missed'])}" if training["missed"] else "reaches all goals"
    return f"{summary}; the best of {training['candidates']} nets {missed}"
