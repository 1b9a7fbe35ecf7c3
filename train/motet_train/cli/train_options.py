"""Shared by all ``motet train`` commands: options, settings from a file, the output folder, and the final summary."""

import logging
import shlex
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
import torch

from motet.motion.skeleton import METRES
from motet_train import distributed
from motet_train.manifest import About
from motet_train.progress import log
from motet_train.recipes.recipe import Job, Recipe
from motet_train.run_folder import trained
from motet_train.runs import Run
from motet_train.settings import SettingsError, changed, read_settings

TABLES = "motet.tables"


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
    """An option's full name, without its hyphens."""
    return max(option.opts, key=len).lstrip("-")


WHERE = (
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True),
    click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option("--threads", type=click.IntRange(1), default=1, show_default=True),
    click.option("--licence", help="Licence of the weights. [default: not stated]"),
    click.option("--data-licence", help="Licence of the data. [default: the data's own, or not stated]"),
)

OPTIONS = (
    click.option(
        "--config", type=Path, is_eager=True, expose_value=False, callback=_configure, help="TOML file of settings."
    ),
    click.option("-o", "--out", type=Path, required=True, help="Folder to write; must not exist."),
    *WHERE,
    click.option(
        "--precision",
        type=click.Choice(["float32", "bfloat16"]),
        help="Precision of matrix products; float32 if the device lacks bfloat16.",
    ),
    click.option("--resume", is_flag=True, help="Resume the run in --out with the same command."),
    click.option("--tensorboard", is_flag=True, help="Also write a TensorBoard log."),
    click.option("--name", help="Bundle name. [default: the run's folder]"),
)

SPLIT = click.option("--split", "by", type=click.Choice(["trial", "subject"]), default="trial", show_default=True)

unit_in = click.option("--unit-in", type=click.Choice(list(METRES)), help="Length unit of files that do not state it.")

SHARED = ("out", "seed", "device", "precision", "threads", "resume", "tensorboard", "name", "licence", "data_licence")


def train_command(
    name: str,
    recipes: Mapping[str, Recipe],
    *options: Callable[..., Any],
    defaults: Mapping[str, Any] | None = None,
) -> Callable[[Callable[..., Run]], click.Command]:
    """A command that trains one of the recipes: the function receives the job and the command's own options.

    An option named like a field of the recipe sets that field and is not passed on. defaults: of shared options.
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
    torch.set_num_threads(shared["threads"])
    out: Path = shared["out"]
    licences = shared["licence"], shared["data_licence"]
    about = About(shared["name"] or out.name, shlex.join(["motet", *sys.argv[1:]]), shared["seed"], *licences)
    show_lines()
    job = Job(recipe, about, out, shared["device"])

    def train(job: Job) -> Run:
        run = function(job, **own)
        if distributed.rank() == 0:
            click.echo(_summary(out, run.manifest["training"]))
            click.echo(f"next: {_next(out, run.manifest)}")
        return run

    trained(job, train, _kept(context, {**shared, **own}), shared["resume"], shared["tensorboard"])


def show_lines() -> None:
    """Show a line for each chunk even without --verbose; none with --quiet."""
    log.setLevel(logging.INFO if logging.getLogger("motet").isEnabledFor(logging.WARNING) else logging.NOTSET)


def _is_of(name: str, recipe: Recipe) -> bool:
    """Whether an option changes the recipe; options cannot set values found in the data."""
    parts = (part for part in (recipe.training, recipe.config, recipe.visits) if part is not None)
    return name not in recipe.derived and any(hasattr(part, name) for part in parts)


def _kept(context: click.Context, given: Mapping[str, Any]) -> dict[str, Any]:
    """The options that repeat the run, by their command-line names."""
    names = {option.name: _long(option) for option in context.command.params}
    left_out = ("out", "resume", "tensorboard", "precision")  # the recipe has the last
    return {names[name]: value for name, value in given.items() if name not in left_out}


def _next(out: Path, manifest: Mapping[str, Any]) -> str:
    """The next command for a run."""
    parts = {"codec": "--codec {0} --actions RUN", "actions": "--codec RUN --actions {0}"}
    if manifest["verb"] in parts:
        return f"motet train codes {parts[manifest['verb']].format(out)}"
    return f"motet evaluate {out}; motet export {out} -o {out.name}.zip"


def _summary(out: Path, training: Mapping[str, Any]) -> str:
    unit = "step" if "steps" in training else "epoch"
    said = [f"{training['parameters']:,} parameters", f"{training[f'{unit}s']} {unit}s in {training['seconds']:g} s"]
    said += [f"{key} {training[key]:.4f}" for key in ("loss", "validation", "reconstruction") if key in training]
    summary = f"{out}: {', '.join(said)}, after {unit} {training[f'kept_{unit}']}"
    if "missed" not in training:
        return summary
    missed = f"misses {', '.join(training['missed'])}" if training["missed"] else "reaches all goals"
    return f"{summary}; the best of {training['candidates']} nets {missed}"
