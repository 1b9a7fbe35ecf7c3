"""``motet evaluate`` of models that predict, in recorded motions that were held out."""

from collections.abc import Mapping
from functools import partial
from pathlib import Path

from motet.models.generate_codes import CodesModel
from motet.models.load import load_as
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet_train.data.store import Store
from motet_train.evaluate.predict import calibration, liveliness, mocap
from motet_train.evaluate.predict.calibration import Calibration
from motet_train.evaluate.predict.costs import cost_table, harness_table
from motet_train.evaluate.predict.floors import FLOORS
from motet_train.evaluate.predict.mocap import Measured
from motet_train.evaluate.predict.mocap_table import (
    TITLES,
    Part,
    distance_table,
    kinds_table,
    part_json,
    part_of,
    parts_of,
)
from motet_train.evaluate.predict.seed_groups import Models, Ready, drawn, ready, seed_groups
from motet_train.evaluate.tables import json_ready

STRIPS = 3
"""Trials of motion files, about, of which stick figures are drawn."""


def mocap_reports(models: Models, data: Path, plots: Path | None) -> tuple[Ready, str]:
    """The distances in all held-out motions and by kinds of them, and how true models are of their own errors."""
    fps, groups, store = next(iter(models.values())).fps, seed_groups(models), Store.open(data)
    trials = mocap.held_out(models, store)
    motions = {entry.name: motion for entry, motion in trials.items()}
    found = mocap.measured(models, motions, mocap.chosen_decays(models, store))
    whole, parts = part_of(found, list(trials), groups), parts_of(found, list(trials), groups)
    if plots is not None:
        _draw(drawn(models, groups), motions, whole, plots)
    known = _calibrations(models, found, parts)
    tables = [distance_table(whole, fps), kinds_table(parts, fps)]
    tables += [calibration.calibration_table(one, name) for name, one in known.items()]
    tables += [harness_table(models, groups), cost_table(models, groups)]
    means = (partial(mocap.to_json, distances) for distances in (found.mean(), whole.means, whole.spreads))
    figures = ready(models, groups, FLOORS, *means)
    for name in models:
        figures[name]["kinds"] = {kind: part_json(found, part, name) for kind, part in parts.items()}
    for name, one in known.items():
        figures[name]["calibration"] = calibration.to_json(one)
    gone = _alive(drawn(models, groups), motions)
    for name, reports in gone.items():
        figures[name]["alive"] = {kind: json_ready(report) for kind, report in reports.items()}
    return figures, "\n\n".join(part for part in (*tables, liveliness.alive_table(gone)) if part)


def _alive(models: Models, motions: Mapping[str, Motion]) -> dict[str, liveliness.Figures]:
    """What the models predict for half a minute."""
    writer = load_as(CodesModel, "generate")
    return {name: liveliness.measured(model, writer, motions) for name, model in models.items()}


def _calibrations(models: Models, found: Measured, parts: Mapping[str, Part]) -> dict[str, Calibration]:
    """Of the models that know their errors."""
    kinds = {kind: part.recordings for kind, part in parts.items()}
    every = {name: calibration.calibration_of(model, found, name, kinds) for name, model in models.items()}
    return {name: one for name, one in every.items() if one is not None}


def _draw(models: Models, motions: Mapping[str, Motion], whole: Part, plots: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.evaluate.predict.plots import error_over_time, strips_drawing

    fps = next(iter(models.values())).fps
    errors = {title: {name: whole.means[name][measure] for name in whole.means} for measure, title in TITLES.items()}
    drawings = {"predict-distance": partial(error_over_time, errors, fps, "cm")}
    for name in list(motions)[:: max(1, len(motions) // STRIPS)]:
        poses = mocap.strips(models, motions[name], every=3)
        drawings[f"predict-{name}"] = partial(strips_drawing, poses, skeleton_of(motions[name]))
    save(drawings, plots)
