"""``motet evaluate`` of models that predict."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from motet.formats import read_motion
from motet.models.predict import PredictModel
from motet.motion.kinematics import skeleton_of
from motet_train.data.clips import CMU as CLIPS
from motet_train.data.expmap_files import CMU, ExpmapCorpus, is_expmap, read_expmap
from motet_train.data.predict_data import STRIDE, Trial, read_trials
from motet_train.evaluate.predict import mocap, report, strips
from motet_train.evaluate.predict.ablations import ablated, ablations
from motet_train.evaluate.predict.costs import costs
from motet_train.evaluate.predict.rows import Row, pooled, rows_of, spread
from motet_train.evaluate.predict.table import table

STRIPS = 3
"""Trials of motion files, about, of which stick figures are drawn."""

DRAWN = ("running", "jumping")
"""Actions of the text files of which stick figures are drawn (Li et al. 2018, figure 5)."""

BONES = "39_14.amc"
"""The trial whose skeleton they have: the text files do not hold one."""

Models = Mapping[str, PredictModel]
Ready = dict[str, dict[str, Any]]
Result = tuple[Ready, str]
"""The figures of each model, ready for JSON, see :func:`_ready`, and the table."""


def predict_reports(models: Models, data: Path | None, plots: Path | None) -> Result:
    """By the protocol where ``data`` has its text files, else the joints' distances in trials that were held out.

    Runs that differ in their seed alone are one row of the table.
    """
    if data is None:
        raise click.UsageError("models that predict need --data: text files of the protocol, or motion files")
    return _protocol(models, data, plots) if is_expmap(data) else _mocap(models, data, plots)


def _protocol(models: Models, data: Path, plots: Path | None) -> Result:
    corpus, rows = read_expmap(data), rows_of(models)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    with tqdm(total=len(report.COUNTS) * (1 + len(models)), unit=" systems", disable=None, leave=False) as bar:
        found = report.curves(models, corpus, lambda name: bar.update())
    shown, apart = report.by_row(found, rows), report.by_row(found, rows, spread)
    if plots is not None:
        _draw_protocol(_drawn(models, rows), corpus, shown, plots)
    parts = [table(shown, corpus), costs(models, rows)]
    if said := ablated(models, rows):
        parts.append(ablations(shown, said))
    runs, means, spreads = (partial(report.to_json, curves) for curves in (found, shown, apart))
    return _ready(models, rows, runs, means, spreads), "\n\n".join(parts)


def _draw_protocol(models: Models, corpus: ExpmapCorpus, shown: report.Curves, plots: Path) -> None:
    from motet_train.evaluate.predict.plots import error_over_time, stick_figures

    many = shown[report.MANY]
    panels = {action: {name: many[name][action] for name in many} for action in many[report.ZERO]}
    error_over_time(panels, corpus.layout.fps / STRIDE, "Euler error", plots / "predict-error.png")
    if corpus.layout is CMU:  # of Human3.6M's figure there are no bones
        skeleton = skeleton_of(read_motion(CLIPS / BONES))
        for action in (action for action in DRAWN if action in corpus.test):
            drawn = strips.strips(models, corpus, action, skeleton)
            stick_figures(drawn, skeleton, plots / f"predict-{action}.png", strips.GIVEN)


def _mocap(models: Models, data: Path, plots: Path | None) -> Result:
    first, rows = next(iter(models.values())), rows_of(models)
    with tqdm(unit=" files", disable=None, leave=False) as bar:
        trials = mocap.held_out(first, read_trials(data, lambda clip: bar.update())[0])
    found = mocap.distances(models, trials)
    shown, apart = pooled(found, rows), pooled(found, rows, spread)
    if plots is not None:
        _draw_mocap(_drawn(models, rows), trials, shown, plots)
    runs, means, spreads = (partial(mocap.to_json, distances) for distances in (found, shown, apart))
    text = f"{mocap.table(shown, first.fps)}\n\n{costs(models, rows)}"
    return _ready(models, rows, runs, means, spreads), text


def _draw_mocap(models: Models, trials: Sequence[Trial], shown: mocap.Distances, plots: Path) -> None:
    from motet_train.evaluate.predict.plots import error_over_time, stick_figures

    first = next(iter(models.values()))
    panels = {measure: {name: shown[name][measure] for name in shown} for measure in shown[report.ZERO]}
    error_over_time(panels, first.fps, "cm", plots / "predict-distance.png")
    for trial in trials[:: max(1, len(trials) // STRIPS)]:
        drawn = mocap.strips(models, trial.motion, every=3)
        stick_figures(drawn, skeleton_of(trial.motion), plots / f"predict-{trial.name}.png")


def _drawn(models: Models, rows: Sequence[Row]) -> Models:
    """The first run of each row: a mean of poses is none."""
    return {row.runs[0]: models[row.runs[0]] for row in rows}


Figures = Callable[[str], dict[str, Any]]


def _ready(models: Models, rows: Sequence[Row], runs: Figures, means: Figures, spreads: Figures) -> Ready:
    """The figures of each run and, under "zero_velocity", of the baseline.

    Of several models also "grouped": title of each row of several runs -> their names as "runs", the figures of their
    mean, and as "spread" the largest minus the smallest.
    """
    ready: Ready = {name: {**runs(name), "zero_velocity": runs(report.ZERO)} for name in models}
    if len(models) > 1:
        ready["grouped"] = {
            row.title: {"runs": list(row.runs), **means(row.title), "spread": spreads(row.title)}
            for row in rows
            if len(row.runs) > 1
        }
    return ready
