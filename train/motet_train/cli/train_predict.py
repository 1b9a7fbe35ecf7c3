"""``motet train predict``."""

from pathlib import Path

import click
from tqdm import tqdm

from motet_train import distributed
from motet_train.cli.train_options import train_command, unit_in
from motet_train.data.errors import DataError
from motet_train.data.expmap_files import ExpmapCorpus, is_expmap, read_expmap
from motet_train.data.predict_data import Material, expmap_material, mocap_material, read_trials
from motet_train.recipes.predict import RECIPES, train_predict
from motet_train.recipes.recipe import Job
from motet_train.runs import Run


@train_command(
    "predict",
    RECIPES,
    click.option(
        "--data",
        type=Path,
        required=True,
        help="Folder or zip: exponential-map text files, or motion files of one figure.",
    ),
    unit_in,
    click.option(
        "--split",
        "by",
        type=click.Choice(["trial", "subject"]),
        help="How motion files are held out: by chance, or all of a person. [default: subject]",
    ),
    click.option("--steps", type=click.IntRange(1), help="[default: the preset's]"),
)
def predict(job: Job, data: Path, unit_in: str | None, by: str | None) -> Run:
    """Train a predictor: a net that continues a motion from its last frames.

    From text files of the protocol it learns what `motet evaluate` measures; from motion files (.amc .bvh .npz) it
    learns to continue files of the same figure.
    """
    return train_predict(_material(data, unit_in, by), job)


def _material(data: Path, unit_in: str | None, by: str | None) -> Material:
    if is_expmap(data):
        if by is not None:
            raise DataError(f"{data} has test files of its own: --split is for motion files")
        return expmap_material(read_expmap_files(data))
    with tqdm(unit=" files", disable=None, leave=False) as bar:
        trials, skipped = read_trials(data, lambda clip: bar.update(), unit_in)
    material = mocap_material(trials, skipped, data.name, by or "subject")
    if (names := material.about["skipped"]) and distributed.rank() == 0:
        click.echo(f"motet: {len(names)} files cannot be used: {', '.join(names)}", err=True)
    return material


def read_expmap_files(data: Path) -> ExpmapCorpus:
    """The corpus of text files in a folder or zip; those that are missing are named."""
    corpus = read_expmap(data)
    if corpus.missing and distributed.rank() == 0:
        click.echo(f"motet: {data} lacks {len(corpus.missing)} files: {', '.join(corpus.missing)}", err=True)
    return corpus
