"""``motet train fill``: a net that fills gaps of motions."""

from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepared import prepared
from motet_train.cli.train_language import DATA, SPLIT
from motet_train.cli.train_options import train_command
from motet_train.recipes.fill import RECIPES, train_fill
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

STEPS = click.option("--steps", type=click.IntRange(1), help="[default: the preset's]")


@train_command("fill", RECIPES, *DATA, SPLIT, STEPS)
def fill(job: Job, data: Path, by: str, **corpus: Any) -> Run:
    """Train a net that fills gaps of motions, between what is before and after them."""
    return train_fill(prepared(data, job, **corpus), job, data.name, by)
