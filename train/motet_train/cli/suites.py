"""The measurements of ``motet evaluate``: a suite for each kind of model."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, cast

import click

from motet.bundle.fields import Json
from motet.generate.base import GenerateModel
from motet.generate.model import CodesModel
from motet.models.base import BundleModel
from motet.models.describe import DescribeModel
from motet.models.language import LanguageModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.papers.tdbn_control import TdbnModel
from motet.predict.fill import FillModel
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
from motet_train.evaluate.tables import Goals, Report, Reports, json_ready, report_table
from motet_train.evaluate.text_adherence.bare import bare_report
from motet_train.evaluate.text_adherence.composed import composed_report
from motet_train.evaluate.text_adherence.numbers import numbers_report
from motet_train.evaluate.text_adherence.prompts import EVERYDAY_PROMPTS, OUTSIDE, Trial, read_trials, trained_on
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
class Inputs:
    """Inputs of a measurement.

    data: the path of each model's data. unit: the length unit of files that do not state theirs. search: the model
    whose space is used to compare motions and prompts. rival: whether to train a plain MLP next to predictors.
    """

    data: Mapping[str, Path | None]
    unit: str | None = None
    search: SearchModel | None = None
    rival: bool = False

    @property
    def first(self) -> Path:
        """The first path, on whose data all models are measured; for a suite that needs data."""
        return next(path for path in self.data.values() if path is not None)


Drawn = Callable[[], Mapping[str, Drawings]]


@dataclass(frozen=True)
class Results:
    """Figures of each model, ready for JSON; the same as text; and pictures, by their folder."""

    figures: Json
    text: str
    drawings: Drawn | None = None

    @staticmethod
    def of(reports: Reports, goals: Goals, drawings: Drawn | None = None) -> "Results":
        """The results of reports, next to their goals."""
        return Results(json_ready(reports), report_table(reports, goals), drawings)


@dataclass(frozen=True)
class Suite:
    """The measurements of a kind of models. what: its name in messages. data: the data required, "" if optional."""

    what: str
    measure: Callable[[Json, Inputs], Results]
    data: str = "the store that they were trained on"
    draws: bool = True


def as_steered(model: Any) -> SteerModel | None:
    """The steered figure that a model is, or that stands in for it; None if it is neither."""
    if model.manifest.loop == "session" and Driven.fits(model):
        return cast(SteerModel, Driven(model))
    return cast(SteerModel, model) if model.manifest.loop == "matching" else None


def _steered(models: Mapping[str, BundleModel], inputs: Inputs) -> Results:
    recorded = Recorded.of(Store.open(inputs.first))
    reports = {}
    for name, model in models.items():
        steered = as_steered(model)
        if steered:
            reports[name] = steer_report(steered, recorded)
    return Results(json_ready(reports), steer_text(reports))


def _control(models: Mapping[str, TdbnModel], inputs: Inputs) -> Results:
    studies = {}
    for name, model in models.items():
        studies[name] = study_of(model, read_clips(inputs.data[name], unit=inputs.unit))
    reports = {name: control_report(study) for name, study in studies.items()}
    return Results.of(
        reports, CONTROL_GOALS, lambda: {name: control_drawings(study) for name, study in studies.items()}
    )


def _filled(models: Mapping[str, FillModel], inputs: Inputs) -> Results:
    store = Store.open(inputs.first)
    return Results.of({name: fill_report(model, store) for name, model in models.items()}, FILL_GOALS)


def _language(models: Mapping[str, LanguageModel], inputs: Inputs) -> Results:
    """Models other than describe's are also measured with the first describe model of the same split."""
    store = Store.open(inputs.first)
    corpora = {name: split_as(model.manifest, store) for name, model in models.items()}
    reports = {name: _language_report(name, models, corpora) for name in models}
    results = Results.of(reports, {**LANGUAGE_GOALS, **SEARCH_GOALS}, lambda: _language_drawings(models, corpora))
    by_subject = [name for name, model in models.items() if model.manifest.training["split"]["by"] == "subject"]
    # a model divided by trial also shows the figures of its verb for people never seen in training
    people_unseen: dict[str, Json] = {}
    for name in by_subject:
        people_unseen.setdefault(models[name].VERB, results.figures[name])
    for name in models.keys() - by_subject:
        if models[name].VERB in people_unseen:
            results.figures[name]["people_unseen"] = people_unseen[models[name].VERB]
    return results


def _language_report(name: str, models: Json, corpora: Mapping[str, SplitStore]) -> Report:
    model = models[name]
    corpus = corpora[name]
    # a describe model of the same split closes the chain
    same_split = (other for key, other in models.items() if corpora[key].parts == corpus.parts)
    partner = next((other for other in same_split if other.VERB == "describe"), None)
    if model.VERB == "describe":
        return describe_report(model, corpus)
    if model.VERB == "search":
        return search_report(model, corpus, partner)
    report = generate_report(model, corpus, partner)
    if partner is None:
        click.echo(f"{name}: omitting tables 3 and 4, which need a describe model of the same split", err=True)
    if lacking := [f"asked.{key}" for key in ASKED if key not in report.get("asked", {})]:
        reason = "training motions of that kind, or a root block, are missing"
        click.echo(f"{name}: {', '.join(lacking)} cannot be measured: {reason}", err=True)
    return report


def _language_drawings(models: Mapping[str, LanguageModel], corpora: Mapping[str, SplitStore]) -> dict[str, Drawings]:
    draw: dict[str, Callable[..., Drawings]] = {"describe": describe_drawings, "generate": generate_drawings}
    drawings = {}
    for name, model in models.items():
        if model.VERB in draw:
            run = Path(name) if (Path(name) / LOG).is_file() else None
            drawings[name] = draw[model.VERB](model, corpora[name], run)
    return drawings


def _predict(models: mocap.Models, inputs: Inputs) -> Results:
    """By the protocol if its text files are given, else the joints' distances in held-out trials."""
    if not is_expmap(inputs.first):
        return _in_mocap(models, Store.open(inputs.first), inputs)
    results = protocol_results(models, read_expmap_files(inputs.first))
    return Results(json_ready(results.to_json()), results.text(), lambda: {"": protocol_drawings(results)})


def _in_mocap(models: mocap.Models, store: Store, inputs: Inputs) -> Results:
    trials = mocap.held_out(models, store)
    motions = {entry.name: motion for entry, motion in trials.items()}
    fps = next(iter(models.values())).fps
    rival = mocap.plain_mlp(models, store) if inputs.rival else None
    measured = mocap.measured(models, motions, mocap.chosen_decays(models, store), rival)
    reports = mocap.mocap_report(models, measured, list(trials))
    # whether predictions stay alive, next to those of motion codes
    writer = load_as(CodesModel, "generate")
    alive = {name: liveliness.measured(model, writer, motions) for name, model in models.items()}
    texts = [mocap.mocap_text(reports, fps), liveliness.alive_table(alive)]
    figures = json_ready({name: {**report, "alive": alive[name]} for name, report in reports.items()})
    return Results(
        figures, "\n\n".join(filter(None, texts)), lambda: {"": _mocap_drawings(models, motions, measured, fps)}
    )


def _mocap_drawings(
    models: mocap.Models, motions: Mapping[str, Motion], measured: mocap.Measured, fps: float
) -> Drawings:
    """Errors over time by measure, and strips of poses of about three trials."""
    # how errors grow, by measure
    errors = {}
    for measure, title in mocap.TITLES.items():
        errors[title] = {name: system[measure].mean(axis=0) for name, system in measured.distances.items()}
    drawings: dict[str, Any] = {"predict-distance": partial(error_over_time, errors, fps, "cm")}
    # and what predictions look like
    for name in islice(motions, 0, None, max(1, len(motions) // 3)):
        rows = mocap.shown(models, motions[name])
        drawings[f"predict-{name}"] = partial(strips, list(rows.values()), list(rows), name)
    return drawings


def _says(models: Mapping[str, GenerateModel], inputs: Inputs) -> Results:
    data = next(iter(inputs.data.values()))
    trials = [] if data is None else list(read_trials(data, inputs.unit))
    if data is not None and not trials:
        raise DataError(f"{data} has no usable motion")
    reports = {name: _says_report(model, trials, inputs.search) for name, model in models.items()}
    drawings = {name: says_drawings(best_of(model)) for name, model in models.items()}
    return Results(json_ready(reports), says_text(reports), lambda: drawings)


def _says_report(model: GenerateModel, trials: Sequence[Trial], search: SearchModel | None) -> dict[str, Any]:
    report = says_table(best_of(model), trials, trained_on(model.manifest, trials), search=search)
    if isinstance(model, CodesModel):
        report |= composed_report(model, seeds=range(3))
        report |= numbers_report(model, seeds=range(3))
        report |= bare_report(model, seeds=range(3))
    report["said_outside"] = {
        "outside": said_to_be_outside(model, OUTSIDE),
        "prompts": said_to_be_outside(model, [prompt.text for prompt in EVERYDAY_PROMPTS]),
    }
    return report


def _composed(models: Mapping[str, CodesModel], inputs: Inputs) -> Results:
    reports = {name: compose_report(model) for name, model in models.items()}
    composed = {name: report["composed"] for name, report in reports.items()}
    unconstrained = {f"{name}, no constraints": report["unconstrained"] for name, report in reports.items()}
    return Results(json_ready(reports), report_table(composed, COMPOSE_GOALS, unconstrained))


def _actions(models: Mapping[str, DescribeModel], inputs: Inputs, clips: str) -> Results:
    """Of clips by their names, or of the test motions of each model's own split if ``clips`` is "test"."""
    store = Store.open(inputs.first)
    reports = {}
    for name, model in models.items():
        corpus = split_as(model.manifest, store) if clips == "test" else clips_apart(store, clips)
        reports[name] = actions_report(model, corpus)
    return Results.of(reports, {})


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
"""Verb -> the suite of its models; steered figures have their own."""


def suite_of(
    models: Mapping[str, BundleModel], says: bool = False, clips: str | None = None, composed: bool = False
) -> Suite:
    """The suite of all models; UsageError if they need several.

    says: the suite of everyday prompts. clips: patterns of clips whose descriptions are judged. composed: the suite of
    compositions.
    """
    if clips is not None:
        _check(models, lambda model: model.VERB == "describe", "--actions takes describe models")
        return Suite("describe models", partial(_actions, clips=clips), draws=False)
    if composed:
        _check(models, lambda model: isinstance(model, CodesModel), "--composed takes models that generate codes")
        return Suite("generate models", _composed, data="", draws=False)
    if says:
        _check(models, lambda model: model.VERB == "generate", "--says takes generate models")
        return Suite("generate models", _says, data="")
    # all others by their verb; models of one call share a suite
    first, *others = {SUITES["steered" if as_steered(model) else model.VERB] for model in models.values()}
    if others:
        raise click.UsageError("evaluate control, fill, predict and language models separately: their data differ")
    return first


def _check(models: Mapping[str, BundleModel], fits: Callable[[BundleModel], bool], takes: str) -> None:
    """UsageError with the names of models that an option does not take."""
    wrong = [name for name, model in models.items() if not fits(model)]
    if wrong:
        raise click.UsageError(f"{takes}, not {', '.join(wrong)}")
