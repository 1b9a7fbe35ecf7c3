"""``motet evaluate`` of models that predict."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click
from tqdm import tqdm

from motet.predict import PredictModel
from motet_train.data.expmap_files import is_expmap, read_expmap
from motet_train.data.predict_data import read_trials
from motet_train.evaluate.predict import mocap, report

STRIPS = 3
"""Trials, about, of which stick figures are drawn."""

Models = Mapping[str, PredictModel]
Result = tuple[dict[str, dict[str, Any]], str]
"""The figures of each model, ready for JSON, and the table."""


def predict_reports(models: Models, data: Path | None, plots: Path | None) -> Result:
    """By the protocol where ``data`` has its text files, else the joints' distances in trials that were held out."""
    if data is None:
        raise click.UsageError("models that predict need --data: text files of the protocol, or motion files")
    return _protocol(models, data, plots) if is_expmap(data) else _mocap(models, data, plots)


def _protocol(models: Models, data: Path, plots: Path | None) -> Result:
    corpus = read_expmap(data)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    found = report.curves(models, corpus)
    if plots is not None:
        from motet_train.evaluate.predict.plots import error_over_time

        many = found[report.COUNTS[-1]]
        panels = {action: {name: many[name][action] for name in many} for action in many[report.ZERO]}
        error_over_time(panels, corpus.layout.fps / 2, "Euler error", plots / "predict-error.png")
    zero = report.to_json(found, report.ZERO)
    ready = {name: {**report.to_json(found, name), "zero_velocity": zero} for name in models}
    return ready, report.table(found, corpus)


def _mocap(models: Models, data: Path, plots: Path | None) -> Result:
    first = next(iter(models.values()))
    with tqdm(unit=" files", disable=None, leave=False) as bar:
        trials = mocap.held_out(first, read_trials(data, lambda clip: bar.update())[0])
    found = mocap.distances(models, trials)
    if plots is not None:
        from motet_train.evaluate.predict.plots import error_over_time, stick_figures

        error_over_time(found, first.fps, "cm", plots / "predict-distance.png")
        for trial in trials[:: max(1, len(trials) // STRIPS)]:
            strips = mocap.strips(models, trial.motion)
            stick_figures(strips, every=3, path=plots / f"predict-{trial.name}.png")
    zero = mocap.to_json(found, report.ZERO)
    ready = {name: {**mocap.to_json(found, name), "zero_velocity": zero} for name in models}
    return ready, mocap.table(found, first.fps)
