"""``motet train steered-tdbn``: the thesis' family as a figure that is steered."""

from pathlib import Path
from typing import Any

from motet_train.cli.prepared import prepared
from motet_train.cli.train_language import DATA
from motet_train.cli.train_options import train_command
from motet_train.papers.tdbn.steered import RECIPES, train_steered
from motet_train.recipes.recipe import Job
from motet_train.runs import Run


@train_command("steered-tdbn", RECIPES, *DATA)
def steered(job: Job, data: Path, **corpus: Any) -> Run:
    """Train a figure to be steered, by the thesis' nets on recordings of walking and running."""
    return train_steered(prepared(data, job, **corpus), job, data.name)
