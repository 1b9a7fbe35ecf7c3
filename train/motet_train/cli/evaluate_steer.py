"""``motet evaluate`` of figures that are steered."""

from collections.abc import Mapping
from functools import singledispatch
from pathlib import Path
from typing import cast

import click

from motet.models.base import BundleModel
from motet.models.steer import SteerModel
from motet.models.tdbn_control import TdbnModel
from motet_train.data.store import Store
from motet_train.evaluate.steer.report import Recorded, steer_report
from motet_train.evaluate.tables import Report
from motet_train.papers.tdbn.driven import Driven


@singledispatch
def as_steered(_: BundleModel) -> SteerModel | None:
    """What is measured as a figure that is steered: a model of them, or what stands for it; None for all others."""
    return None


@as_steered.register
def _(model: SteerModel) -> SteerModel:
    return model


@as_steered.register
def _(model: TdbnModel) -> SteerModel | None:
    return cast(SteerModel, Driven(model)) if Driven.fits(model) else None


def steer_reports(models: Mapping[str, SteerModel], data: Path | None) -> dict[str, Report]:
    """The report of each model, beside the recordings of a store."""
    if data is None:
        raise click.UsageError("figures that are steered need --data: the store that they were trained on")
    recorded = Recorded.of(Store.open(data))
    return {name: steer_report(model, recorded) for name, model in models.items()}
