"""``motet train codec`` and ``codes``: what turns motions into codes and back, and what writes codes for a sentence."""

from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepared import prepared
from motet_train.cli.train_language import DATA, SPLIT
from motet_train.cli.train_options import train_command
from motet_train.recipes import codec as coding
from motet_train.recipes import codes as writing
from motet_train.recipes.codec import train_codec
from motet_train.recipes.codes import train_codes
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

STEPS = click.option("--steps", type=click.IntRange(1), help="[default: the preset's]")

START = click.option("--start", type=Path, help="Run of a codec whose decoder alone is trained on (--preset decoder).")


@train_command("codec", coding.RECIPES, *DATA, SPLIT, STEPS, START)
def codec(job: Job, data: Path, start: Path | None, by: str, **corpus: Any) -> Run:
    """Train a codec of motions: frames to codes and back."""
    run = None if start is None else Run.load(start)
    return train_codec(prepared(data, job, **corpus), job, data.name, by, run)


@train_command(
    "codes",
    writing.RECIPES,
    *DATA,
    SPLIT,
    STEPS,
    click.option("--codec", type=Path, required=True, help="Run of a codec, trained on the same data and split."),
)
def codes(job: Job, data: Path, codec: Path, by: str, **corpus: Any) -> Run:
    """Train a writer of codes: a sentence to motion, code by code."""
    return train_codes(prepared(data, job, **corpus), Run.load(codec), job, data.name, by)
