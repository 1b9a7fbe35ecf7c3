"""``motet evaluate``."""

import json
import shlex
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import click
import torch

from motet.bundle.graph import SessionOptions
from motet.cli.options import session_options
from motet.models.base import BundleModel
from motet.models.load import load, load_as
from motet.search.model import SearchModel
from motet_train.cli.prepare import store_beside
from motet_train.cli.suites import Inputs, Results, Suite, suite_of
from motet_train.cli.train_options import unit_in, with_options
from motet_train.data.errors import DataError
from motet_train.data.store import INDEX, part
from motet_train.evaluate.figures import make_folder, save
from motet_train.recipes.recipe import SETTINGS
from motet_train.runs import RUN_MANIFEST, Run
from motet_train.settings import read_settings

measurements = with_options(
    click.option(
        "--data",
        type=Path,
        help="Control: the clips. Predict: text files of the protocol, or the store. Others: the store. [default: the "
        "run's training data] With --says: a store, or a folder or zip of motion files with a table of sentences, for "
        "the columns of real trials and of the look-up.",
    ),
    click.option(
        "--says", is_flag=True, help="Generate: try everyday prompts, and count the motions that follow them."
    ),
    click.option(
        "--search",
        default="search",
        show_default=True,
        help="With --says: name or path of the search bundle whose space is used to compare motions and prompts.",
    ),
    click.option(
        "--actions",
        metavar="PATTERNS",
        help="Describe: whether the action is right, and the sure ones, of clips of --data by their names, such as "
        "'ACCAD_*,CC0_*', whatever the model was trained on; or of its own 'test' part.",
    ),
    click.option("--composed", is_flag=True, help="Generate: how well compositions meet places, poses and times."),
    click.option(
        "--rival",
        is_flag=True,
        help="Predict, motion files: also train a plain MLP on positions of joints with the same data (five minutes), "
        "and measure it.",
    ),
)

outputs = with_options(
    click.option("--json", "as_json", is_flag=True, help="Print one nested object with stable keys."),
    click.option("--plots", type=Path, help="Folder for the figures of the papers."),
)


@click.command()
@click.argument("models", nargs=-1, required=True)
@measurements
@outputs
@unit_in
@session_options
@click.option("--save", "keep", is_flag=True, help="Save the figures in each run, for export.")
def evaluate(
    models: tuple[str, ...],
    data: Path | None,
    says: bool,
    search: str,
    actions: str | None,
    composed: bool,
    rival: bool,
    as_json: bool,
    plots: Path | None,
    unit_in: str | None,
    keep: bool,
    session: SessionOptions,
) -> None:
    """Measure MODELS: run folders, or names and paths of bundles, of one kind.

    Control: the thesis' experiments. Steered figures: foot contact, path following and pose integrity under any
    control, next to recordings. Describe and generate: BLEU, floors, attributes, measures; with both, on the same
    split, also the chain from sentence to motion and back. Search: retrieval. Fill: joint distances from the originals
    in gaps of trials, next to interpolation. Predict: the protocol's Euler errors on its text files, next to floors and
    published rows, or distances in held-out motion files, by kind of motion. With --says, generate: the share of
    motions that follow everyday prompts, their quality, and their distance to their prompts and to recorded motions in
    the space of a search model.
    """
    # the models and their measurements
    torch.set_num_threads(1)
    if (says or actions or composed) and keep:
        raise click.UsageError("--says, --actions and --composed only print figures: drop --save")
    runs = {name: Run.load(Path(name)) for name in models if (Path(name) / RUN_MANIFEST).is_file()}
    loaded: dict[str, BundleModel] = {}
    for name in models:
        loaded[name] = runs[name].bundle_model() if name in runs else load(name, session)
    suite = suite_of(loaded, says, actions, composed)
    _check_outputs(models, runs if keep else None, suite, plots)

    # their data, and the figures
    data_paths = dict.fromkeys(loaded, data) if says or composed else data_of(loaded, suite, data)
    search_model = load_as(SearchModel, search, session) if says else None
    results = suite.measure(loaded, Inputs(data_paths, unit_in, search_model, rival))
    _finish(results, runs if keep else {}, plots)
    figures = results.figures[models[0]] if len(models) == 1 else results.figures
    click.echo(json.dumps(figures) if as_json else results.text)


def _check_outputs(models: tuple[str, ...], runs: Mapping[str, Run] | None, suite: Suite, plots: Path | None) -> None:
    """Fail before hours of measuring if figures cannot be saved in ``runs``, or pictures not drawn."""
    bundles = [name for name in models if runs is not None and name not in runs]
    if bundles:
        raise click.UsageError(f"--save stores figures in training runs, but {', '.join(bundles)} is a bundle")
    if plots is not None:
        if not suite.draws:
            raise click.UsageError(f"--plots is not available for {suite.what}")
        make_folder(plots)


def _finish(results: Results, runs: Mapping[str, Run], plots: Path | None) -> None:
    """Draw pictures of one model into the folder, those of several into a subfolder each; save figures in runs."""
    if plots is not None and results.drawings is not None:
        drawings = results.drawings()
        for name, drawn in drawings.items():
            save(drawn, plots / Path(name).name if len(drawings) > 1 else plots)
    for name, run in runs.items():
        Run({**run.manifest, "quality": results.figures[name]}, run.model).save(Path(name))


def data_of(models: Mapping[str, BundleModel], suite: Suite, data: Path | None) -> dict[str, Path | None]:
    """The path of the data to measure each model on.

    Without --data, or if it is a model's training corpus, the store prepared from that corpus; otherwise --data;
    otherwise the model's training data, if it still exists.
    """
    paths: dict[str, Path | None] = {}
    lost = ""
    for name, model in models.items():
        trained_on = _training_data(name, model)
        path = _data_path(Path(name), trained_on, data, not suite.data)
        paths[name] = path and part(path, model.manifest.motion.representation)
        if trained_on and not path:
            lost = lost or f"{name} was trained on {trained_on}, which is missing"
    if suite.data and not any(paths.values()):
        raise click.UsageError(f"{suite.what} need --data: {suite.data}" + (f" ({lost})" if lost else ""))
    if lost and not suite.data:
        raise DataError(f"{lost}: give --data")
    return paths


def _data_path(run: Path, trained_on: Path | None, data: Path | None, bundled: bool) -> Path | None:
    """The data of one model. bundled: also look for the training data of a bundle."""
    is_corpus = trained_on is not None and data is not None and data.resolve() == trained_on.resolve()
    if (data is None or is_corpus) and (store_beside(run) / INDEX).is_file():
        return store_beside(run)
    if data is None and trained_on is not None and trained_on.exists() and (bundled or (run / SETTINGS).is_file()):
        return trained_on
    return data


def _training_data(name: str, model: BundleModel) -> Path | None:
    """The --data of a model's training: from the settings of a run, or the command of a bundle."""
    if (Path(name) / SETTINGS).is_file():
        options, _ = read_settings(Path(name) / SETTINGS)
        return Path(str(options["data"])) if "data" in options else None
    words = shlex.split(str(model.manifest.training.get("command", "")))
    values = [word.removeprefix("--data=") for word in words if word.startswith("--data=")]
    values += [after for word, after in pairwise(words) if word == "--data"]
    return Path(values[-1]) if values else None
