"""``motet evaluate`` of models that predict."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from os.path import relpath
from pathlib import Path

import click
from tqdm import tqdm

from motet.files import check_place, write_whole
from motet.formats import read_motion
from motet.motion.kinematics import skeleton_of
from motet_train.cli.evaluate_mocap import mocap_reports
from motet_train.data.clips import CMU_FOLDER
from motet_train.data.expmap_files import CMU_LAYOUT, ExpmapCorpus, is_expmap, read_expmap
from motet_train.data.predict_data import STRIDE
from motet_train.evaluate.predict import curves, strips
from motet_train.evaluate.predict.commands import run_words, shown
from motet_train.evaluate.predict.page import Surroundings, page, sentences
from motet_train.evaluate.predict.results import Models, Ready, Results, results_json, results_of, results_text
from motet_train.evaluate.predict.seed_groups import drawn
from motet_train.evaluate.predict.sentences import Figures
from motet_train.evaluate.predict.text_floors import TEXT_FLOORS
from motet_train.runs import MANIFEST

DRAWN = ("running", "jumping")
"""Actions of the text files of which stick figures are drawn (Li et al. 2018, figure 5)."""

BONES = "39_14.amc"
"""The trial whose skeleton they have: the text files do not hold one."""

ERRORS = "predict-error"
"""The name of the figure of errors over time."""


@dataclass(frozen=True)
class PageOptions:
    """Where the page of results goes, and the folder of runs that are its ablations, with these."""

    path: Path
    folder: Path | None = None
    ablations: Models = field(default_factory=dict)


def predict_reports(
    models: Models, data: Path | None, plots: Path | None, options: PageOptions | None = None
) -> tuple[Ready, str]:
    """The figures of each model, ready for JSON, and the tables.

    By the protocol where ``data`` has its text files, else the joints' distances in trials that were held out. Runs
    that differ in their seed alone are one row of the table. options: of the page of the protocol's results, if that is
    to be written.
    """
    if data is None:
        raise click.UsageError("predictors need --data: text files of the protocol, or the store they were trained on")
    if is_expmap(data):
        return _protocol(models, data, plots, options)
    if options is not None:
        raise click.UsageError("--page is of the protocol's results: it needs --data with text files")
    return mocap_reports(models, data, plots)


def _protocol(models: Models, data: Path, plots: Path | None, options: PageOptions | None) -> tuple[Ready, str]:
    if options is not None:
        check_place(options.path)  # what cannot be written is said before hours of measuring
    corpus = read_expmap(data)
    if corpus.missing:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    results = _measured(models, corpus)
    pictures = {} if plots is None else _draw(results, plots)
    if options is not None:
        ablations = _measured(options.ablations, corpus) if options.ablations else None
        around = Surroundings(_command(models, data, plots, options), _beside(pictures, options.path))
        write_whole(options.path, page(results, around, ablations))
    text = [results_text(results), *(f"* {line}" for line in sentences(Figures(results)))]
    return results_json(results), "\n".join([text[0], "", *text[1:]])


def _measured(models: Models, corpus: ExpmapCorpus) -> Results:
    total = len(curves.COUNTS) * (len(TEXT_FLOORS) + len(models))
    with tqdm(total=total, unit=" systems", disable=None, leave=False) as bar:
        return results_of(models, corpus, lambda name: bar.update())


def _command(models: Models, data: Path, plots: Path | None, options: PageOptions) -> str:
    """The command that writes the page."""
    parents = {Path(name).parent for name in models}
    runs = [path.parent.name for path in parents.pop().glob(f"*/{MANIFEST}")] if len(parents) == 1 else []
    words = ["motet", "evaluate", *run_words(list(models), runs), "--data", str(data)]
    places = {"--ablations": options.folder, "--plots": plots, "--page": options.path}
    words += [word for option, path in places.items() if path is not None for word in (option, str(path))]
    return shown(shlex.join(words))


def _beside(pictures: Mapping[str, Path], path: Path) -> dict[str, str]:
    """The pictures by title, as the page says where they are."""
    return {title: Path(relpath(picture, path.parent)).as_posix() for title, picture in pictures.items()}


def _draw(results: Results, plots: Path) -> dict[str, Path]:
    """Draw; title -> file."""
    from motet_train.evaluate.figures import save
    from motet_train.evaluate.predict.plots import error_over_time, strips_drawing

    many, corpus = results.means[curves.MANY], results.corpus
    errors = {action: {name: many[name][action] for name in many} for action in (*results.actions, curves.MEAN)}
    drawings = {ERRORS: partial(error_over_time, errors, corpus.layout.fps / STRIDE, "Euler error")}
    titles = {ERRORS: "Error over time"}
    if corpus.layout is CMU_LAYOUT:  # of Human3.6M's figure there are no bones
        skeleton = skeleton_of(read_motion(CMU_FOLDER / BONES))
        for action in (action for action in DRAWN if action in corpus.test):
            poses = strips.strips(drawn(results.models, results.groups), corpus, action, skeleton)
            drawings[f"predict-{action}"] = partial(strips_drawing, poses, skeleton, strips.GIVEN)
            titles[f"predict-{action}"] = f"{action.capitalize()}: the truth, and what each predicts"
    return dict(zip(titles.values(), save(drawings, plots), strict=True))
