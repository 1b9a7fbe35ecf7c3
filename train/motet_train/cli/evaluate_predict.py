"""``motet evaluate`` of models that predict."""

from functools import partial
from pathlib import Path

import click
from tqdm import tqdm

from motet.formats import read_motion
from motet.motion.kinematics import skeleton_of
from motet_train.cli.evaluate_mocap import mocap_reports
from motet_train.data.cmu_trials import cmu_trial
from motet_train.evaluate.predict.seed_groups import Models, Ready, drawn
from motet_train.papers.li2018 import curves, strips
from motet_train.papers.li2018.expmap_files import CMU_LAYOUT, ExpmapCorpus, is_expmap, read_expmap
from motet_train.papers.li2018.material import STRIDE
from motet_train.papers.li2018.results import Results, results_json, results_of, results_text
from motet_train.papers.li2018.text_floors import TEXT_FLOORS

DRAWN = ("running", "jumping")
"""Actions of the text files of which stick figures are drawn (Li et al. 2018, figure 5)."""

BONES = "39_14"
"""The trial whose skeleton they have: the text files do not hold one."""

ERRORS = "predict-error"
"""The name of the figure of errors over time."""


def predict_reports(models: Models, data: Path | None, plots: Path | None) -> tuple[Ready, str]:
    """The figures of each model, ready for JSON, and the tables.

    By the protocol where ``data`` has its text files, else the joints' distances in trials that were held out. Runs
    that differ in their seed alone are one row of the table.
    """
    if data is None:
        raise click.UsageError("predictors need --data: text files of the protocol, or the store they were trained on")
    return _protocol(models, data, plots) if is_expmap(data) else mocap_reports(models, data, plots)


def _protocol(models: Models, data: Path, plots: Path | None) -> tuple[Ready, str]:
    corpus = read_expmap(data)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    results = _measured(models, corpus)
    if plots is not None:
        _draw(results, plots)
    return results_json(results), results_text(results)


def _measured(models: Models, corpus: ExpmapCorpus) -> Results:
    total = len(curves.COUNTS) * (len(TEXT_FLOORS) + len(models))
    with tqdm(total=total, unit=" systems", disable=None, leave=False) as bar:
        return results_of(models, corpus, lambda name: bar.update())


def _draw(results: Results, plots: Path) -> None:
    from motet_train.evaluate.figures import save
    from motet_train.evaluate.predict.plots import error_over_time, strips_drawing

    many, corpus = results.means[curves.MANY], results.corpus
    errors = {action: {name: many[name][action] for name in many} for action in next(iter(many.values()))}
    drawings = {ERRORS: partial(error_over_time, errors, corpus.layout.fps / STRIDE, "Euler error")}
    if corpus.layout is CMU_LAYOUT:  # of Human3.6M's figure there are no bones
        skeleton = skeleton_of(read_motion(cmu_trial(BONES)))
        for action in (action for action in DRAWN if action in corpus.test):
            poses = strips.strips(drawn(results.models, results.groups), corpus, action, skeleton)
            drawings[f"predict-{action}"] = partial(strips_drawing, poses, skeleton, strips.GIVEN)
    save(drawings, plots)
