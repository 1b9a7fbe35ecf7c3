"""``motet train describe``, ``generate`` and ``search``: the two ways between motion and language, and one space."""

from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepare import CORPUS
from motet_train.cli.prepared import prepared
from motet_train.cli.train_options import train_command
from motet_train.papers.plappert2017 import recipe as generating
from motet_train.papers.plappert2017.language_to_motion import LOSSES
from motet_train.recipes import describe as describing
from motet_train.recipes import search as searching
from motet_train.recipes.language import train_language
from motet_train.recipes.recipe import Job
from motet_train.recipes.search import train_search
from motet_train.runs import Run

DATA = (click.option("--data", type=Path, required=True, help="A prepared store, or a corpus: folder or zip."), *CORPUS)
SPLIT = click.option("--split", "by", type=click.Choice(["trial", "subject"]), default="trial", show_default=True)
OPTIONS = (
    *DATA,
    click.option("--epochs", type=click.IntRange(1), help="[default: the preset's]"),
    click.option("--batch", type=click.IntRange(1), help="Motions in a batch. [default: the preset's]"),
    SPLIT,
    click.option("--mirror/--no-mirror", default=None, help="Mirror left and right at random. [default: the preset's]"),
)
LOSS = click.option(
    "--loss", type=click.Choice(list(LOSSES)), help="Eq. 12, or the true likelihood. [default: the preset's]"
)


@train_command("describe", describing.RECIPES, *OPTIONS)
def describe(job: Job, data: Path, by: str, **corpus: Any) -> Run:
    """Train motion to language: a net that describes a motion in words."""
    return train_language(prepared(data, job, **corpus), job, data.name, by)


@train_command("generate", generating.RECIPES, *OPTIONS, LOSS)
def generate(job: Job, data: Path, by: str, **corpus: Any) -> Run:
    """Train language to motion: a net that makes a motion from a sentence."""
    return train_language(prepared(data, job, **corpus), job, data.name, by)


@train_command("search", searching.RECIPES, *OPTIONS)
def search(job: Job, data: Path, by: str, **corpus: Any) -> Run:
    """Train a joint embedding: motions and sentences in one space, to search by."""
    return train_search(prepared(data, job, **corpus), job, data.name, by)
