"""``motet train matching``: a figure that is steered."""

from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepared import prepared
from motet_train.cli.train_language import DATA
from motet_train.cli.train_options import train_command
from motet_train.recipes.matching import RECIPES, train_matching
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

STEPS = click.option("--steps", type=click.IntRange(1), help="[default: the preset's]")


@train_command("matching", RECIPES, *DATA, STEPS)
def matching(job: Job, data: Path, **corpus: Any) -> Run:
    """Train a figure to be steered, by motion matching on recordings of gaits."""
    return train_matching(prepared(data, job, **corpus), job, data.name)
