"""The measurements of ``motet evaluate``: one record for each kind of model."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, cast

import click

from motet.generate.base import GenerateModel
from motet.generate.model import CodesModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.language import LanguageModel
from motet.models.load import load_as
from motet.papers.tdbn_control import TdbnModel
from motet.predict.fill import FillModel
from motet.predict.model import PredictModel
from motet.search.model import SearchModel
from motet.steering.model import SteerModel
from motet_train.cli.train import read_expmap_files
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.evaluate.compose import COMPOSE_GOALS, compose_report
from motet_train.evaluate.figures import Drawings, error_over_time, strips
from motet_train.evaluate.fill import FILL_GOALS, fill_report
from motet_train.evaluate.language.actions import actions_report, clips_apart
from motet_train.evaluate.language.describe import describe_report
from motet_train.evaluate.language.generate import ASKED, LANGUAGE_GOALS, generate_report
from motet_train.evaluate.language.search import SEARCH_GOALS, search_report
from motet_train.evaluate.language.split_store import SplitStore, split_as
from motet_train.evaluate.predict import liveliness, mocap
from motet_train.evaluate.steer.report import Recorded, steer_report, steer_text
from motet_train.evaluate.tables import Goals, Report, json_ready, report_table
from motet_train.evaluate.text_adherence.composed import composed_report
from motet_train.evaluate.text_adherence.numbers import numbers_report
from motet_train.evaluate.text_adherence.prompts import outside, prompts, read_trials, trained_on
from motet_train.evaluate.text_adherence.table import best_of, said_to_be_outside, says_drawings, says_table, says_text
from motet_train.papers.li2018.expmap import is_expmap
from motet_train.papers.li2018.figures import drawings as protocol_drawings
from motet_train.papers.li2018.report import protocol_results
from motet_train.papers.plappert2017.figures import describe_drawings, generate_drawings
from motet_train.papers.tdbn.clips import read_clips
from motet_train.papers.tdbn.figures import drawings as control_drawings
from motet_train.papers.tdbn.report import GOALS as CONTROL_GOALS
from motet_train.papers.tdbn.report import control_report, study_of
from motet_train.papers.tdbn.steered import Driven
from motet_train.trainer import LOG


@dataclass(frozen=True)
class Given:
    """Inputs of a measurement. data: path of each model's data. unit: for files that do not state theirs. search: the
    model whose space is used to compare motions and prompts."""

    data: Mapping[str, Path | None]
    unit: str | None = None
    search: SearchModel | None = None

    @property
    def first(self) -> Path:
        """The first existing data, on which all models are measured; for a suite that needs data."""
        return next(found for found in self.data.values() if found is not None)


@dataclass(frozen=True)
class Results:
    """Figures of each model, ready for JSON; all of them as text; and pictures, by their folder."""

    figures: dict[str, Any]
    text: str
    drawings: Callable[[], Mapping[str, Drawings]] | None = None

    @staticmethod
    def of(reports: Mapping[str, Report], goals: Goals) -> "Results":
        """Those of reports, next to their goals."""
        return Results(json_ready(reports), report_table(reports, goals))


@dataclass(frozen=True)
class Suite:
    """The measurements of a kind of models, called ``what``; and the data required, "" if optional."""

    what: str
    measure: Callable[[Mapping[str, Any], Given], Results]
    data: str = "the store that they were trained on"
    draws: bool = True


def as_steered(model: BundleModel) -> SteerModel | None:
    """A steered figure to measure: a model of one, or its stand-in; None for all others."""
    if model.manifest.loop == "session" and Driven.fits(cast(TdbnModel, model)):
        return cast(SteerModel, Driven(cast(TdbnModel, model)))
    return cast(SteerModel, model) if model.manifest.loop == "matching" else None


def _steered(models: Mapping[str, BundleModel], given: Given) -> Results:
    recorded = Recorded.of(Store.open(given.first))
    steered = ((name, as_steered(model)) for name, model in models.items())
    reports = {name: steer_report(model, recorded) for name, model in steered if model}
    return Results(json_ready(reports), steer_text(reports))


def _control(models: Mapping[str, TdbnModel], given: Given) -> Results:
    studies = {name: study_of(model, read_clips(given.data[name], unit=given.unit)) for name, model in models.items()}
    found = Results.of({name: control_report(study) for name, study in studies.items()}, CONTROL_GOALS)
    return Results(found.figures, found.text, lambda: {name: control_drawings(one) for name, one in studies.items()})


def _filled(models: Mapping[str, FillModel], given: Given) -> Results:
    store = Store.open(given.first)
    return Results.of({name: fill_report(model, store) for name, model in models.items()}, FILL_GOALS)


def _language(models: Mapping[str, LanguageModel], given: Given) -> Results:
    """Others are compared with the first describe model of the same split."""
    store = Store.open(given.first)
    corpora = {name: split_as(model.manifest, store) for name, model in models.items()}
    reports = {name: _language_report(name, models, corpora) for name in models}
    found = Results.of(reports, {**LANGUAGE_GOALS, **SEARCH_GOALS})
    by = {name: model.manifest.training["split"]["by"] for name, model in models.items()}
    unseen = {models[name].VERB: name for name in reversed([*models]) if by[name] == "subject"}
    for name, model in models.items():  # how one divided by trial would do with people it has never seen
        if by[name] != "subject" and model.VERB in unseen:
            found.figures[name]["people_unseen"] = json_ready(reports[unseen[model.VERB]])
    return Results(found.figures, found.text, lambda: _language_drawings(models, corpora))


def _language_report(name: str, models: Mapping[str, Any], corpora: Mapping[str, SplitStore]) -> Report:
    model, corpus = models[name], corpora[name]
    alike = (other for key, other in models.items() if corpora[key].parts == corpus.parts)
    partner = next((other for other in alike if other.VERB == "describe"), None)
    if model.VERB == "describe":
        return describe_report(model, corpus)
    if model.VERB == "search":
        return search_report(model, corpus, partner)
    report = generate_report(model, corpus, partner)
    if partner is None:
        click.echo(f"{name}: omitting tables 3 and 4, which need a describe model of the same split", err=True)
    if lacking := [f"asked.{key}" for key in ASKED if key not in report.get("asked", {})]:
        said = "training motions of that kind, or a root block, are missing"
        click.echo(f"{name}: {', '.join(lacking)} cannot be measured: {said}", err=True)
    return report


def _language_drawings(models: Mapping[str, LanguageModel], corpora: Mapping[str, SplitStore]) -> dict[str, Drawings]:
    draw: dict[str, Callable[..., Drawings]] = {"describe": describe_drawings, "generate": generate_drawings}
    logged = {name: Path(name) if (Path(name) / LOG).is_file() else None for name in models}
    drawn = {name: model for name, model in models.items() if model.VERB in draw}
    return {name: draw[model.VERB](model, corpora[name], logged[name]) for name, model in drawn.items()}


def _predict(models: Mapping[str, PredictModel], given: Given) -> Results:
    """By the protocol if its text files are given, else the joints' distances in held-out trials."""
    if not is_expmap(given.first):
        return _in_mocap(models, Store.open(given.first))
    found = protocol_results(models, read_expmap_files(given.first))
    return Results(json_ready(found.to_json()), found.text(), lambda: {"": protocol_drawings(found)})


def _in_mocap(models: Mapping[str, PredictModel], store: Store) -> Results:
    trials = mocap.held_out(models, store)
    motions, fps = {entry.name: motion for entry, motion in trials.items()}, next(iter(models.values())).fps
    found = mocap.measured(models, motions, mocap.chosen_decays(models, store))
    reports = mocap.mocap_report(models, found, list(trials))
    writer = load_as(CodesModel, "generate")
    alive = {name: liveliness.measured(model, writer, motions) for name, model in models.items()}
    text = "\n\n".join(part for part in (mocap.mocap_text(reports, fps), liveliness.alive_table(alive)) if part)
    figures = json_ready({name: {**report, "alive": alive[name]} for name, report in reports.items()})

    def drawings() -> dict[str, Drawings]:
        every = {
            title: {name: system[measure].mean(axis=0) for name, system in found.distances.items()}
            for measure, title in mocap.TITLES.items()
        }
        drawn: dict[str, Any] = {"predict-distance": partial(error_over_time, every, fps, "cm")}
        for name in islice(motions, 0, None, max(1, len(motions) // 3)):  # of about three trials
            rows = mocap.shown(models, motions[name])
            drawn[f"predict-{name}"] = partial(strips, list(rows.values()), list(rows), name)
        return {"": drawn}

    return Results(figures, text, drawings)


def _says(models: Mapping[str, GenerateModel], given: Given) -> Results:
    data = next(iter(given.data.values()))
    trials = [] if data is None else list(read_trials(data, given.unit))
    if data is not None and not trials:
        raise DataError(f"{data} has no usable motion")
    reports = {}
    for name, model in models.items():
        training = trained_on(model.manifest, trials)
        reports[name] = says_table(best_of(model), trials, training, search=given.search)
        asked = {"outside": outside(), "prompts": [prompt.text for prompt in prompts()]}
        if isinstance(model, CodesModel):
            reports[name] |= composed_report(model, seeds=range(3)) | numbers_report(model, seeds=range(3))
        reports[name]["said_outside"] = {key: said_to_be_outside(model, texts) for key, texts in asked.items()}
    drawings = {name: says_drawings(best_of(model)) for name, model in models.items()}
    return Results(json_ready(reports), says_text(reports), lambda: drawings)


def _composed(models: Mapping[str, CodesModel], given: Given) -> Results:
    found = {name: compose_report(model) for name, model in models.items()}
    made, plain = ({name: report[key] for name, report in found.items()} for key in ("composed", "unconstrained"))
    beside = {f"{name}, no constraints": report for name, report in plain.items()}
    return Results(json_ready(found), report_table(made, COMPOSE_GOALS, beside))


def _actions(models: Mapping[str, DescribeModel], given: Given, clips: str) -> Results:
    """Of the test motions of each model's own split where ``clips`` is "test"."""
    store = Store.open(given.first)
    corpora = {
        name: split_as(model.manifest, store) if clips == "test" else clips_apart(store, clips)
        for name, model in models.items()
    }
    return Results.of({name: actions_report(model, corpora[name]) for name, model in models.items()}, {})


_LANGUAGE = Suite("describe, generate and search models", _language)

SUITES = {
    "control": Suite("control models", _control, data=""),
    "describe": _LANGUAGE,
    "fill": Suite("models that fill gaps", _filled, draws=False),
    "generate": _LANGUAGE,
    "predict": Suite("predictors", _predict, "text files of the protocol, or the store they were trained on"),
    "search": _LANGUAGE,
    "steered": Suite("figures that are steered", _steered, draws=False),
}
"""Verb -> the suite of its models; steered figures have one of their own."""


def suite_of(
    models: Mapping[str, BundleModel], says: bool = False, clips: str | None = None, composed: bool = False
) -> Suite:
    """The suite of all the models; UsageError if they need several. says: the one of everyday prompts. clips: the one
    of right descriptions of these. composed: the one of compositions."""
    if clips is not None:
        if wrong := [name for name, model in models.items() if model.VERB != "describe"]:
            raise click.UsageError(f"--actions takes describe models, not {', '.join(wrong)}")
        return Suite("describe models", partial(_actions, clips=clips), draws=False)
    if composed:
        if wrong := [name for name, model in models.items() if not isinstance(model, CodesModel)]:
            raise click.UsageError(f"--composed takes models that generate codes, not {', '.join(wrong)}")
        return Suite("generate models", _composed, data="", draws=False)
    if says:
        if wrong := [name for name, model in models.items() if model.VERB != "generate"]:
            raise click.UsageError(f"--says takes generate models, not {', '.join(wrong)}")
        return Suite("generate models", _says, data="")
    first, *others = {SUITES["steered" if as_steered(model) else model.VERB] for model in models.values()}
    if others:
        raise click.UsageError("evaluate control, fill, predict and language models separately: their data differ")
    return first
