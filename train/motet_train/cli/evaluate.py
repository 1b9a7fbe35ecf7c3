"""``motet evaluate``."""

import json
import shlex
from collections.abc import Callable, Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import click
import torch
from tqdm import tqdm

from motet.bundle.manifest import Manifest
from motet.bundle.session import SessionOptions
from motet.cli.options import session_options
from motet.models.base import BundleModel
from motet.models.fill import FillModel
from motet.models.generate import GenerateModel
from motet.models.load import build, load, load_as
from motet.models.predict import PredictModel
from motet.models.search import SearchModel
from motet.models.tdbn_control import TdbnModel
from motet_train.cli.evaluate_fill import fill_figures
from motet_train.cli.evaluate_language import Models, by_subject, language_reports
from motet_train.cli.evaluate_predict import predict_reports
from motet_train.cli.evaluate_says import says_reports
from motet_train.cli.evaluate_steer import as_steered, steer_reports
from motet_train.cli.prepared import store_beside
from motet_train.cli.train_options import unit_in
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX
from motet_train.evaluate.fill.report import fill_text
from motet_train.evaluate.language.report import GOALS as LANGUAGE_GOALS
from motet_train.evaluate.language.search import GOALS as SEARCH_GOALS
from motet_train.evaluate.steer.report import steer_text
from motet_train.evaluate.tables import Report, json_ready, report_table
from motet_train.evaluate.text_adherence.table import Best, says_drawings, says_text
from motet_train.papers.tdbn.clips import Clips, read_clips
from motet_train.papers.tdbn.experiments.report import GOALS, control_report, study_of
from motet_train.recipes.recipe import SETTINGS
from motet_train.runs import MANIFEST, Run
from motet_train.settings import read_settings

Measured = tuple[dict[str, Any], str]
"""The figures of each model, ready for JSON, and all of them as text."""

Experiments = Callable[[Mapping[str, Any], Path | None, Path | None, str | None], Measured]
"""What measures models of one verb: with their data, a folder for pictures and the unit of the data."""


@click.command()
@click.argument("models", nargs=-1, required=True)
@click.option(
    "--data",
    type=Path,
    help="Control: the clips. [default: those it was trained on] Describe, generate, search and figures that "
    "are steered, fill: the store. [default: that of the run] "
    "Predict: text files of the protocol, or the store. With --says: a store or a folder or zip of motion files "
    "with a table of sentences, for the columns of real trials and of the look-up.",
)
@click.option(
    "--says", is_flag=True, help="Generate: ask everyday prompts, and count the motions that do what they say."
)
@click.option(
    "--search",
    default="search",
    show_default=True,
    help="With --says: the name or path of a search bundle, in whose space motions and prompts are compared.",
)
@click.option("--json", "as_json", is_flag=True, help="Print one nested object with stable keys.")
@click.option("--plots", type=Path, help="Folder for the figures of the papers.")
@unit_in
@session_options
@click.option("--save", is_flag=True, help="Save the figures in each run, to be exported with it.")
def evaluate(
    models: tuple[str, ...],
    data: Path | None,
    says: bool,
    search: str,
    as_json: bool,
    plots: Path | None,
    unit_in: str | None,
    save: bool,
    session: SessionOptions,
) -> None:
    """Run the papers' experiments on MODELS: run folders, or names and paths of bundles.

    Control: the thesis' experiments. Figures that are steered: how well their feet stand, whether they go where they
    are told, whether their poses stay whole whatever they are told, beside recordings. Describe and generate: BLEU,
    floors, attributes, measures; with both, of the same split, also the chain from sentence to motion and back.
    Fill: how far joints are from where they were in gaps of trials, beside interpolation. Predict: the protocol's Euler
    errors on its text files, beside floors and published rows, or distances in held out motion files, by kinds of
    motions. With --says, generate: the share of motions that do what everyday
    prompts say, how good they are, whatever they show, and how near they are to their prompts and to recorded motions
    in the space of a search model.
    """
    if says and save:
        raise click.UsageError("--says prints figures, and draws them with --plots; it does not go with --save")
    torch.set_num_threads(1)
    runs = {name: Run.load(Path(name)) for name in models if (Path(name) / MANIFEST).is_file()}
    if save and (bundles := [name for name in models if name not in runs]):
        raise click.UsageError(f"--save keeps figures in training runs; {', '.join(bundles)} is a bundle")
    loaded = {name: _model(runs[name]) if name in runs else load(name, session) for name in models}
    ready, text = (
        _says(loaded, data, unit_in, load_as(SearchModel, search, session), plots)
        if says
        else _measured(loaded, _own_store(runs, data), plots, unit_in)
    )
    for name in runs if save else ():
        Run({**runs[name].manifest, "quality": ready[name]}, runs[name].model).save(Path(name))
    click.echo(json.dumps(ready[models[0]] if len(models) == 1 else ready) if as_json else text)


def _own_store(runs: Iterable[str], data: Path | None) -> Path | None:
    """The store that was prepared of the corpus that training was given, where that or nothing is given here."""
    for run in map(Path, runs):
        corpus = _given(run, "")
        asked = data is None or (corpus is not None and data.resolve() == corpus.resolve())
        if asked and (store_beside(run) / INDEX).is_file():
            return store_beside(run)
    return data


def _model(run: Run) -> BundleModel:
    return build(Manifest.from_json(run.manifest), run.torch_graphs(), run.tables())


def _says(
    models: Mapping[str, BundleModel], data: Path | None, unit: str | None, search: SearchModel, plots: Path | None
) -> Measured:
    """As :func:`_measured`, of everyday prompts."""
    found = {name: cast(GenerateModel, model) for name, model in models.items() if model.VERB == "generate"}
    if others := [name for name in models if name not in found]:
        raise click.UsageError(f"--says asks generate models; {', '.join(others)} is none")
    if plots is not None:
        from motet_train.evaluate.figures import save

        for name, model in found.items():
            save(says_drawings(Best(model)), plots if len(found) == 1 else plots / Path(name).name)
    reports = says_reports(found, data, unit, search)
    return {name: json_ready(report) for name, report in reports.items()}, says_text(reports)


def _measured(models: Mapping[str, BundleModel], data: Path | None, plots: Path | None, unit: str | None) -> Measured:
    """The figures of each model, ready for JSON, and all of them as text."""
    experiments = {_experiments(model) for model in models.values()}
    if len(experiments) > 1:
        raise click.UsageError("evaluate control, fill, predict and language models separately: their data differ")
    if plots is not None:
        from motet_train.evaluate.figures import make_folder

        make_folder(plots)  # what cannot be written is said before hours of measuring
    return experiments.pop()(models, data, plots, unit)


def _steered(models: Mapping[str, BundleModel], data: Path | None, plots: Path | None, _: str | None) -> Measured:
    if plots is not None:
        raise click.UsageError("figures that are steered have no --plots")
    reports = steer_reports({name: steered for name, m in models.items() if (steered := as_steered(m))}, data)
    return {name: json_ready(report) for name, report in reports.items()}, steer_text(reports)


def _filled(models: Mapping[str, FillModel], data: Path | None, plots: Path | None, _: str | None) -> Measured:
    if plots is not None:
        raise click.UsageError("models that fill gaps have no --plots")
    reports = fill_figures(models, data)
    return {name: json_ready(report) for name, report in reports.items()}, fill_text(reports)


def _predicted(models: Mapping[str, PredictModel], data: Path | None, plots: Path | None, _: str | None) -> Measured:
    return predict_reports(models, data, plots)


def _language(models: Models, data: Path | None, plots: Path | None, _: str | None) -> Measured:
    reports = language_reports(models, data, plots)
    ready: dict[str, Any] = {name: json_ready(report) for name, report in reports.items()}
    for name in models:
        if (other := by_subject(models, name)) is not None:
            ready[name]["people_unseen"] = json_ready(reports[other])
    return ready, report_table(reports, {**LANGUAGE_GOALS, **SEARCH_GOALS})


def _control(models: Mapping[str, TdbnModel], data: Path | None, plots: Path | None, unit: str | None) -> Measured:
    reports: dict[str, Report] = {}
    for name, model in models.items():
        study = study_of(model, _clips(name, model, data, unit))
        with tqdm(desc=name, unit=" experiments", disable=None, leave=False) as bar:
            reports[name] = control_report(study, lambda key, bar=bar: bar.update())  # type: ignore[misc]
        if plots is not None:
            from motet_train.evaluate.figures import save
            from motet_train.papers.tdbn.experiments.plots import drawings

            save(drawings(study), plots if len(models) == 1 else plots / Path(name).name)
    return {name: json_ready(report) for name, report in reports.items()}, report_table(reports, GOALS)


_EXPERIMENTS: Mapping[str, Experiments] = {
    "control": _control,
    "describe": _language,
    "fill": _filled,
    "generate": _language,
    "predict": _predicted,
    "search": _language,
}
"""What measures the models of a verb, but for figures that are steered."""


def _experiments(model: BundleModel) -> Experiments:
    return _EXPERIMENTS[model.VERB] if as_steered(model) is None else _steered


def _clips(name: str, model: TdbnModel, data: Path | None, unit: str | None = None) -> Clips:
    """The clips in ``data``, else those that training was given, else CMU's; DataError where they are gone."""
    if data is None:
        data = _given(Path(name), str(model.manifest.training.get("command", "")))
        if data is not None and not data.exists():
            raise DataError(f"the clips that {name} was trained on, {data}, are missing: give --data")
    return read_clips(data, unit=unit)


def _given(run: Path, command: str) -> Path | None:
    """What training was given as --data: by the settings of a run, or the command of a bundle."""
    if (run / SETTINGS).is_file():
        given = [str(value) for key, value in read_settings(run / SETTINGS)[0].items() if key == "data"]
    else:
        words = shlex.split(command)
        given = [word.removeprefix("--data=") for word in words if word.startswith("--data=")]
        given += [after for word, after in pairwise(words) if word == "--data"]
    return Path(given[-1]) if given else None
