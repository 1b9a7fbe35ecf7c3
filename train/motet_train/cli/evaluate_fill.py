"""``motet evaluate`` of models that fill gaps."""

from collections.abc import Mapping
from pathlib import Path

import click
from tqdm import tqdm

from motet.models.fill import FillModel
from motet_train.data.store import Store
from motet_train.evaluate.fill.report import fill_reports
from motet_train.evaluate.tables import Report


def fill_figures(models: Mapping[str, FillModel], data: Path | None) -> dict[str, Report]:
    """The report of each model, beside plain ways through the same gaps."""
    if data is None:
        raise click.UsageError("models that fill gaps need --data: the store that they were trained on")
    with tqdm(total=len(models), unit=" models", disable=None, leave=False) as bar:

        def told(name: str) -> None:
            bar.set_description(name)
            bar.update()

        return fill_reports(models, Store.open(data), told)
