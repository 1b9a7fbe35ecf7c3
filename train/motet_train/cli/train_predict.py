"""``motet train predict``."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import torch
from tqdm import tqdm

from motet_train.cli.places import command_line, refuse_existing
from motet_train.data.expmap_files import ExpmapCorpus, is_expmap, read_expmap
from motet_train.data.predict_data import Material, expmap_material, mocap_material, read_trials
from motet_train.recipes.predict import About, Recipe, train_predict


@click.command()
@click.option(
    "--data", type=Path, required=True, help="Folder or zip: exponential-map text files, or motion files of one figure."
)
@click.option("--out", type=Path, required=True, help="Folder to write; must not exist.")
@click.option("--steps", type=click.IntRange(1), default=Recipe.steps, show_default=True)
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--threads", type=click.IntRange(1), default=1, show_default=True)
@click.option("--name", help="Name of the bundle to be. [default: the run's folder]")
@click.option("--licence", default="MIT", show_default=True, help="Licence of the weights.")
@click.option("--data-licence", help="Licence of motion files. [default: not stated]")
def predict(
    data: Path, out: Path, steps: int, seed: int, threads: int, name: str | None, licence: str, data_licence: str | None
) -> None:
    """Train a predictor: a net that carries a motion on from its last frames.

    From text files of the protocol it learns what `motet evaluate` measures; from motion files (.amc .bvh .npz) it
    learns to carry on files of the same figure.
    """
    refuse_existing(out)
    torch.set_num_threads(threads)
    material = _material(data, data_licence or f"not stated (trained on {data.name})")
    out.mkdir(parents=True)
    try:
        with tqdm(total=steps, unit=" steps", disable=None) as bar:
            about = About(name or out.name, command_line(), licence)
            recipe = replace(Recipe(), steps=steps)
            run = train_predict(material, recipe, seed, about, out, lambda loss: _advance(bar, loss))
    except BaseException:
        shutil.rmtree(out)
        raise
    training = run.manifest["training"]
    click.echo(f"{out}: {training['parameters']:,} parameters, {training['seconds']:g} s, loss {training['loss']:.4f}")


def _advance(bar: "tqdm[Any]", loss: float) -> None:
    bar.set_postfix(loss=f"{loss:.3f}", refresh=False)
    bar.update()


def _material(data: Path, licence: str) -> Material:
    if is_expmap(data):
        return expmap_material(read_expmap_files(data))
    with tqdm(unit=" files", disable=None, leave=False) as bar:
        trials, skipped = read_trials(data, lambda clip: bar.update())
    material = mocap_material(trials, skipped, data.name, licence)
    if material.about["skipped"]:
        click.echo(f"motet: cannot be used: {', '.join(material.about['skipped'])}", err=True)
    return material


def read_expmap_files(data: Path) -> ExpmapCorpus:
    """The corpus of text files in a folder or zip; those that are missing are named."""
    corpus = read_expmap(data)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    return corpus
