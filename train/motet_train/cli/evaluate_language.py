"""``motet evaluate`` of models between motion and language."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from motet.models.language import LanguageModel
from motet_train.data.store import Store
from motet_train.evaluate.language.prompts import ASKED
from motet_train.evaluate.language.report import describe_report, generate_report
from motet_train.evaluate.language.search import search_report
from motet_train.evaluate.language.split_store import SplitStore, split_as
from motet_train.evaluate.tables import Report
from motet_train.trainer import LOG

Models = Mapping[str, LanguageModel]


def language_reports(models: Models, data: Path | None, plots: Path | None) -> dict[str, Report]:
    """The report of each model. Others are compared with the first describe model that had the same split."""
    if data is None:
        raise click.UsageError("describe, generate and search models need --data: the store that they were trained on")
    store = Store.open(data)
    corpora = {name: split_as(model.manifest, store) for name, model in models.items()}
    reports = {}
    with tqdm(unit=" parts", disable=None, leave=False) as bar:
        for name, model in models.items():
            reports[name] = _report(name, models, corpora, bar)
            if plots is not None:
                bar.set_description(f"{name}: pictures")
                _draw(name, model, corpora[name], plots if len(models) == 1 else plots / Path(name).name)
    return reports


def by_subject(models: Models, name: str) -> str | None:
    """The model that shows how well this one would do with people never seen: the same verb, split by subject."""
    by = {other: model.manifest.training["split"]["by"] for other, model in models.items()}
    alike = (other for other, model in models.items() if model.manifest.verb == models[name].manifest.verb)
    return next((other for other in alike if by[other] == "subject" and by[name] != "subject"), None)


def _report(name: str, models: Models, corpora: Mapping[str, SplitStore], bar: "tqdm[Any]") -> Report:
    def progress(part: str) -> None:
        bar.set_description(f"{name}: {part}")
        bar.update()

    model, corpus = models[name], corpora[name]
    alike = (other for key, other in models.items() if corpora[key].parts == corpus.parts)
    partner = next((other for other in alike if other.VERB == "describe"), None)
    report = _REPORTS[model.VERB](model, corpus, partner, progress)
    if model.VERB == "generate":
        _say_lacking(name, report, partner is None)
    return report


_REPORTS: Mapping[str, Callable[..., Report]] = {
    "describe": lambda model, corpus, _, progress: describe_report(model, corpus, progress),
    "generate": generate_report,
    "search": search_report,
}
"""What measures a model: with its corpus, the describe model of the same split, and what progress is told to."""


def _say_lacking(name: str, report: Report, alone: bool) -> None:
    if alone:
        click.echo(f"{name}: tables 3 and 4 need a describe model of the same split; they are left out", err=True)
    if lacking := [f"asked.{key}" for key in ASKED if key not in report.get("asked", {})]:
        said = "training motions of that kind, or a root block, are missing"
        click.echo(f"{name}: {', '.join(lacking)} cannot be measured: {said}", err=True)


def _draw(name: str, model: LanguageModel, corpus: SplitStore, folder: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.papers.plappert2017.figures import describe_drawings, generate_drawings

    run = Path(name) if (Path(name) / LOG).is_file() else None
    drawings: dict[str, Callable[..., Any]] = {"describe": describe_drawings, "generate": generate_drawings}
    if model.VERB in drawings:
        save(drawings[model.VERB](model, corpus, run), folder)
