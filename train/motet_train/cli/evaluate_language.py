"""``motet evaluate`` of models between motion and language."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from motet.models.describe import DescribeModel
from motet.models.generate import GenerateModel
from motet.models.search import SearchModel
from motet_train.data.store import Store
from motet_train.evaluate.language.prompts import ASKED
from motet_train.evaluate.language.report import describe_report, generate_report
from motet_train.evaluate.language.search import search_report
from motet_train.evaluate.language.split_store import SplitStore, split_as
from motet_train.evaluate.tables import Report
from motet_train.trainer import LOG

Models = Mapping[str, DescribeModel | GenerateModel | SearchModel]


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
            if plots is not None and not isinstance(model, SearchModel):
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
    if isinstance(model, DescribeModel):
        return describe_report(model, corpus, progress)
    describe = (
        other
        for key, other in models.items()
        if isinstance(other, DescribeModel) and corpora[key].parts == corpus.parts
    )
    partner = next(describe, None)
    if isinstance(model, SearchModel):
        return search_report(model, corpus, partner, progress)
    if partner is None:
        click.echo(f"{name}: tables 3 and 4 need a describe model of the same split; they are left out", err=True)
    report = generate_report(model, corpus, partner, progress)
    if lacking := [f"asked.{key}" for key in ASKED if key not in report.get("asked", {})]:
        said = "training motions of that kind, or a root block, are missing"
        click.echo(f"{name}: {', '.join(lacking)} cannot be measured: {said}", err=True)
    return report


def _draw(name: str, model: DescribeModel | GenerateModel, corpus: SplitStore, folder: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.papers.plappert2017.figures import describe_drawings, generate_drawings

    run = Path(name) if (Path(name) / LOG).is_file() else None
    if isinstance(model, DescribeModel):
        save(describe_drawings(model, corpus, run), folder)
    else:
        save(generate_drawings(model, corpus, run), folder)
