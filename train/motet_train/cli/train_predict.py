"""``motet train predict``."""

from pathlib import Path
from typing import Any

import click

from motet_train import distributed
from motet_train.cli.prepare import CORPUS
from motet_train.cli.prepared import prepared
from motet_train.cli.train_options import train_command
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, store_material
from motet_train.papers.li2018.expmap_files import ExpmapCorpus, is_expmap, read_expmap
from motet_train.papers.li2018.material import expmap_material
from motet_train.recipes.predict import RECIPES, train_predict
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

AUGMENTATION = (
    click.option("--warp", type=click.FloatRange(0), help="Play windows up to exp(this) times faster or slower."),
    click.option("--reverse", type=click.FloatRange(0, 1), help="Share of windows played backwards."),
    click.option("--mirror", type=click.FloatRange(0, 1), help="Share of windows mirrored."),
    click.option(
        "--average", type=click.FloatRange(0, 1, max_open=True), help="Decay of a running mean of weights; 0: none."
    ),
)
"""Augmentation of windows and averaging; the defaults are the preset's."""


@train_command(
    "predict",
    RECIPES,
    click.option(
        "--data",
        type=Path,
        required=True,
        help="Exponential-map text files, a store prepared for predict, or motion files: folder or zip.",
    ),
    *CORPUS,
    click.option(
        "--split",
        "by",
        type=click.Choice(["trial", "subject"]),
        help="How to hold out motion files: at random, or by person. [default: subject]",
    ),
    click.option("--steps", type=click.IntRange(1), help="[default: the preset's]"),
    *AUGMENTATION,
)
def predict(job: Job, data: Path, by: str | None, **corpus: Any) -> Run:
    """Train a predictor: a net that continues a motion from its last frames.

    Text files of the protocol train it for the measures of `motet evaluate`; motion files train it to continue files of
    any human figure.
    """
    return train_predict(_material(data, job, by, **corpus), job)


def _material(data: Path, job: Job, by: str | None, **corpus: Any) -> Material:
    if not is_expmap(data):
        return store_material(prepared(data, job, **corpus), data.name, by or "subject")
    if by is not None:
        raise DataError(f"{data} has its own test files: --split is for motion files")
    return expmap_material(read_expmap_files(data))


def read_expmap_files(data: Path) -> ExpmapCorpus:
    """The corpus of text files in a folder or zip; those that are missing are named."""
    corpus = read_expmap(data)
    if corpus.missing and distributed.rank() == 0:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    return corpus
