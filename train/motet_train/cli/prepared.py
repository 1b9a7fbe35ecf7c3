"""The store given to a training command, or made from the corpus given to it."""

from pathlib import Path
from typing import Any

import click

from motet_train import distributed
from motet_train.cli.prepare import prepare
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX, Store
from motet_train.plan import kind_for, store_for
from motet_train.recipes.recipe import Job
from motet_train.trainer import CHECKPOINT


def prepared(data: Path, job: Job, **corpus: Any) -> Store:
    """The store at ``data``, or one prepared next to the run from the corpus there; a resumed run has its own.

    corpus: options of ``motet prepare``.
    """
    if ((found := store_for(data, job.recipe)) / INDEX).is_file():
        return Store.open(found)
    place = store_beside(job.folder)
    if (job.folder / CHECKPOINT).is_file():
        return Store.open(place)
    verb = kind_for(job.recipe)
    if distributed.count() > 1:
        raise DataError(f"several processes need a prepared store: motet prepare {data} --for {verb} --out {place}")
    click.get_current_context().invoke(prepare, data=(data,), out=place, verb=verb, fps=None, **corpus)
    return Store.open(place)


def store_beside(run: Path) -> Path:
    """The path of the store of a run that was given a corpus."""
    return run.with_name(f"{run.name}-store")
