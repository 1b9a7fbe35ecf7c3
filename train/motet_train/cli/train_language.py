"""``motet train describe`` and ``motet train generate``: the two ways between motion and language."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import click
import torch
from tqdm import tqdm

from motet.motion.units import METRES
from motet_train.cli.places import command_line, refuse, resumable
from motet_train.cli.prepare import prepare
from motet_train.data.store import INDEX, Store
from motet_train.models.language.language_to_motion import LOSSES
from motet_train.recipes import describe as describing
from motet_train.recipes import generate as generating
from motet_train.recipes.language import About, Recipe, check_device, train_language

OPTIONS: tuple[Callable[..., Any], ...] = (
    click.option("--data", type=Path, required=True, help="A prepared store, or a corpus: folder or zip."),
    click.option("--sentences", type=Path, help="Table of a mocap corpus' sentences. [default: the .tsv beside it]"),
    click.option("--unit-in", type=click.Choice(list(METRES)), help="Length unit of motion files that do not say it."),
    click.option("--out", type=Path, required=True, help="Folder to write; must not exist."),
    click.option("--preset", type=click.Choice(["default", "paper"]), default="default", show_default=True),
    click.option("--epochs", type=click.IntRange(1), help="[default: the preset's]"),
    click.option("--batch", type=click.IntRange(1), help="Motions in a batch. [default: the preset's]"),
    click.option("--seed", type=click.IntRange(0), default=0, show_default=True),
    click.option("--split", "by", type=click.Choice(["trial", "subject"]), default="trial", show_default=True),
    click.option("--mirror/--no-mirror", default=None, help="Mirror left and right by chance. [default: the preset's]"),
    click.option("--device", type=click.Choice(["cpu", "cuda"]), default="cpu", show_default=True),
    click.option("--threads", type=click.IntRange(1), default=1, show_default=True),
    click.option("--resume", is_flag=True, help="Go on where the run in --out was stopped, by the same command."),
    click.option("--name", help="Name of the bundle to be. [default: the run's folder]"),
    click.option("--licence", default="MIT", show_default=True, help="Licence of the weights."),
    click.option("--data-licence", help="Licence of the data. [default: not stated]"),
)


def _with_options(function: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(OPTIONS):
        function = option(function)
    return function


@click.command()
@_with_options
def describe(**options: Any) -> None:
    """Train motion to language: a net that describes a motion in a sentence."""
    _train(describing.RECIPES, **options)


@click.command()
@_with_options
@click.option("--loss", type=click.Choice(list(LOSSES)), help="Eq. 12, or the true likelihood. [default: the preset's]")
def generate(**options: Any) -> None:
    """Train language to motion: a net that makes a motion from a sentence."""
    _train(generating.RECIPES, **options)


def _train(
    recipes: Mapping[str, Recipe],
    data: Path,
    sentences: Path | None,
    unit_in: str | None,
    out: Path,
    resume: bool,
    device: str,
    threads: int,
    name: str | None,
    licence: str,
    data_licence: str | None,
    seed: int,
    by: str,
    **settings: Any,
) -> None:
    check_device(device)
    torch.set_num_threads(threads)
    refuse(out, resume)
    recipe = _recipe(recipes, **settings)
    store = _store(data, out, resume, sentences, unit_in)
    stated = data_licence or f"not stated (trained on {data.name})"
    about = About(name or out.name, command_line(), licence, stated, data.name, seed, by)
    with resumable(out), tqdm(unit=" steps", disable=None) as bar:
        run = train_language(store, recipe, about, out, device, partial(_advance, bar))
    training = run.manifest["training"]
    click.echo(
        f"{out}: {training['epochs']} epochs in {training['seconds']:g} s, {training['steps_per_second']:g} steps/s; "
        f"validation loss {training['validation_loss']:.4f} after epoch {training['kept_epoch']}"
    )


def _advance(bar: "tqdm[Any]", epoch: int, epochs: int) -> None:
    bar.set_description(f"epoch {epoch}/{epochs}", refresh=False)
    bar.update()


def _recipe(
    recipes: Mapping[str, Recipe],
    preset: str,
    epochs: int | None,
    batch: int | None,
    mirror: bool | None,
    loss: str | None = None,
) -> Recipe:
    recipe = recipes[preset]
    if loss is not None:
        config = recipe.config
        recipe = replace(recipe, config=lambda channels, words: replace(config(channels, words), loss=loss))
    fitting = replace(recipe.fitting, epochs=epochs or recipe.fitting.epochs, batch=batch or recipe.fitting.batch)
    return replace(recipe, fitting=fitting, mirror=recipe.mirror if mirror is None else mirror)


def _store(data: Path, out: Path, resume: bool, sentences: Path | None, unit_in: str | None) -> Store:
    """The store at ``data``, or the one of the corpus that is there, prepared beside the run."""
    if (data / INDEX).is_file():
        return Store.open(data)
    place = out.with_name(f"{out.name}-store")
    if resume and place.exists():
        return Store.open(place)
    place.parent.mkdir(parents=True, exist_ok=True)
    click.get_current_context().invoke(prepare, data=data, out=place, sentences=sentences, unit_in=unit_in)
    return Store.open(place)
