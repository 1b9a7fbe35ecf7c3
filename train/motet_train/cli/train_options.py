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
from motet_train.data.table import read_toml
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


TYPES: Mapping[str, Any] = {
    "text": None,
    "path": Path,
    "number": float,
    "natural": click.IntRange(0),
    "count": click.IntRange(1),
    "number from 0": click.FloatRange(0),
    "number above 0": click.FloatRange(0, min_open=True),
    "share": click.FloatRange(0, 1),
    "share below 1": click.FloatRange(0, 1, max_open=True),
    "frames per second": click.FloatRange(1, 240),
}
"""Types of options in options.toml."""

OPTION_GROUPS = read_toml(__file__, "options.toml")


def options_of(group: str) -> Option:
    """The options of a group in options.toml, in their order in the help."""
    group_options = []
    for flags, settings in OPTION_GROUPS[group].items():
        kind = settings.get("type", "text")
        kind = click.Choice(kind) if isinstance(kind, list) else TYPES[kind]
        group_options.append(click.option(*flags.split(), **{**settings, "type": kind}))
    return with_options(*group_options)


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


where = options_of("where")
config = click.option(
    "--config", type=Path, is_eager=True, expose_value=False, callback=_configure, help="TOML file of settings."
)
every_training = with_options(config, options_of("out"), where, options_of("training"))
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
    parts = (recipe.training, recipe.config, recipe.visits)
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
