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
from motet.motion.motion import Motion
from motet_train.data.clips import CMU_FOLDER
from motet_train.data.expmap_files import CMU_LAYOUT, ExpmapCorpus, is_expmap, read_expmap
from motet_train.data.predict_data import STRIDE
from motet_train.data.store import Store
from motet_train.evaluate.predict import curves, mocap, strips
from motet_train.evaluate.predict.ablations import ablated, ablation_table
from motet_train.evaluate.predict.costs import cost_table
from motet_train.evaluate.predict.protocol_table import protocol_table
from motet_train.evaluate.predict.seed_groups import SeedGroup, pooled, seed_groups, spread

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
        raise click.UsageError("predictors need --data: text files of the protocol, or the store they were trained on")
    return _protocol(models, data, plots) if is_expmap(data) else _mocap(models, data, plots)


def _protocol(models: Models, data: Path, plots: Path | None) -> Result:
    corpus, groups = read_expmap(data), seed_groups(models)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    with tqdm(total=len(curves.COUNTS) * (1 + len(models)), unit=" systems", disable=None, leave=False) as bar:
        found = curves.curves(models, corpus, lambda name: bar.update())
    shown, apart = curves.by_group(found, groups), curves.by_group(found, groups, spread)
    if plots is not None:
        _draw_protocol(_drawn(models, groups), corpus, shown, plots)
    parts = [protocol_table(shown, corpus), cost_table(models, groups)]
    if said := ablated(models, groups):
        parts.append(ablation_table(shown, said))
    runs, means, spreads = (partial(curves.to_json, errors) for errors in (found, shown, apart))
    return _ready(models, groups, runs, means, spreads), "\n\n".join(parts)


def _draw_protocol(models: Models, corpus: ExpmapCorpus, shown: curves.Curves, plots: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.evaluate.predict.plots import error_over_time, strips_drawing

    many = shown[curves.MANY]
    errors = {action: {name: many[name][action] for name in many} for action in many[curves.ZERO]}
    drawings = {"predict-error": partial(error_over_time, errors, corpus.layout.fps / STRIDE, "Euler error")}
    if corpus.layout is CMU_LAYOUT:  # of Human3.6M's figure there are no bones
        skeleton = skeleton_of(read_motion(CMU_FOLDER / BONES))
        for action in (action for action in DRAWN if action in corpus.test):
            drawn = strips.strips(models, corpus, action, skeleton)
            drawings[f"predict-{action}"] = partial(strips_drawing, drawn, skeleton, strips.GIVEN)
    save(drawings, plots)


def _mocap(models: Models, data: Path, plots: Path | None) -> Result:
    first, groups = next(iter(models.values())), seed_groups(models)
    trials = mocap.held_out(first, Store.open(data))
    found = mocap.distances(models, list(trials.values()))
    shown, apart = pooled(found, groups), pooled(found, groups, spread)
    if plots is not None:
        _draw_mocap(_drawn(models, groups), trials, shown, plots)
    runs, means, spreads = (partial(mocap.to_json, distances) for distances in (found, shown, apart))
    text = f"{mocap.distance_table(shown, first.fps)}\n\n{cost_table(models, groups)}"
    return _ready(models, groups, runs, means, spreads), text


def _draw_mocap(models: Models, trials: Mapping[str, Motion], shown: mocap.Distances, plots: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.evaluate.predict.plots import error_over_time, strips_drawing

    first = next(iter(models.values()))
    errors = {measure: {name: shown[name][measure] for name in shown} for measure in shown[curves.ZERO]}
    drawings = {"predict-distance": partial(error_over_time, errors, first.fps, "cm")}
    for name in list(trials)[:: max(1, len(trials) // STRIPS)]:
        drawn = mocap.strips(models, trials[name], every=3)
        drawings[f"predict-{name}"] = partial(strips_drawing, drawn, skeleton_of(trials[name]))
    save(drawings, plots)


def _drawn(models: Models, groups: Sequence[SeedGroup]) -> Models:
    """The first run of each group: a mean of poses is none."""
    return {group.runs[0]: models[group.runs[0]] for group in groups}


Figures = Callable[[str], dict[str, Any]]


def _ready(models: Models, groups: Sequence[SeedGroup], runs: Figures, means: Figures, spreads: Figures) -> Ready:
    """The figures of each run and, under "zero_velocity", of the baseline.

    Of several models also "grouped": title of each group of several runs -> their names as "runs", the figures of their
    mean, and as "spread" the largest minus the smallest.
    """
    ready: Ready = {name: {**runs(name), "zero_velocity": runs(curves.ZERO)} for name in models}
    if len(models) > 1:
        ready["grouped"] = {
            group.title: {"runs": list(group.runs), **means(group.title), "spread": spreads(group.title)}
            for group in groups
            if len(group.runs) > 1
        }
    return ready
