"""``motet train all`` and ``motet train generate``: all shipped kinds, or the generator, in one command."""

import shlex
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import torch

from motet_train import distributed
from motet_train.cli.prepare import SOURCE, corpus_of
from motet_train.cli.train_options import SPLIT, WHERE, show_lines
from motet_train.cli.train_store import VECTORS
from motet_train.data.errors import DataError
from motet_train.data.store import is_store
from motet_train.manifest import About
from motet_train.plan import STAGES, VERBS, Plan
from motet_train.recipes.actions import WordVectors
from motet_train.settings import read_stages

OPTIONS = (
    click.option("-o", "--out", type=Path, required=True, help="Folder of the runs; the same command resumes there."),
    *SOURCE,
    SPLIT,
    *VECTORS,
    click.option("--config", type=Path, help="TOML file of settings: [describe.training] is for describe."),
    *WHERE,
)


def _options(function: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(OPTIONS):
        function = option(function)
    return function


@click.command("all", short_help="Train all shipped kinds on your own recordings: one command, resumable.")
@click.argument("data", type=Path, nargs=-1, required=True)
@click.option("--only", "verbs", type=click.Choice(VERBS), multiple=True, help="Only these. [default: all]")
@_options
def everything(verbs: tuple[str, ...], **given: Any) -> None:
    """Train all shipped kinds on DATA: folders or zips of motion files with a table of sentences, or their store.

    Motions are prepared once, into OUT/store; then one run per verb is trained, of the kind that ships with motet.
    Repeat the command to continue: finished runs are skipped, interrupted ones resume.
    """
    _train(verbs or VERBS, **given)


@click.command(short_help="Train the shipped kind of generate, in five stages.")
@click.option("--data", type=Path, multiple=True, required=True, help="A store, or a corpus: folder or zip.")
@_options
def generate(**given: Any) -> None:
    """Train sentence to motion, the shipped kind: codec, decoder (twice), actions, and the writer of codes.

    Like `motet train all --only generate`: the runs go into the folder OUT, the last is OUT/generate.
    """
    _train(("generate",), **given)


def _train(verbs: tuple[str, ...], data: tuple[Path, ...], out: Path, **given: Any) -> None:
    if distributed.launched():
        raise DataError("torchrun trains one stage at a time: use the command of the stage, such as motet train codec")
    torch.set_num_threads(given["threads"])
    show_lines()
    command = shlex.join(["motet", *sys.argv[1:]])
    vectors = given["word_vectors"] and WordVectors(given["word_vectors"], given["vectors_from"])
    changes = read_stages(given["config"], STAGES) if given["config"] else {}
    about = About("", command, given["seed"], given["licence"], given["data_licence"])
    source = {key: given[key] for key in ("sentences", "people", "gaits", "unit_in")}
    place = data[0] if len(data) == 1 and is_store(data[0]) else corpus_of(data, **source)
    Plan(place, out, verbs, given["by"], given["device"], vectors, changes, about).train()
    click.echo(f"next: motet export {out} -o bundles, then motet bundle verify bundles/NAME.zip")
    for verb in verbs:
        click.echo(f"      motet evaluate {out / verb}")
