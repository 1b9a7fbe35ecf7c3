"""The ``motet train`` commands that train one net on a store: describe, search, codec, actions, codes, fill, ..."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepare import CORPUS
from motet_train.cli.prepared import prepared
from motet_train.cli.train_options import SPLIT, train_command
from motet_train.data.store import Store
from motet_train.papers.plappert2017 import recipe as plappert2017
from motet_train.papers.plappert2017.language_to_motion import LOSSES
from motet_train.papers.tdbn import steered
from motet_train.recipes import actions, codec, codes, describe, fill, matching, search
from motet_train.recipes.actions import WordVectors
from motet_train.recipes.language import train_language
from motet_train.recipes.recipe import Job, Recipe
from motet_train.runs import Run

DATA = (click.option("--data", type=Path, required=True, help="A prepared store, or a corpus: folder or zip."), *CORPUS)
STEPS = (click.option("--steps", type=click.IntRange(1), help="[default: the preset's]"), SPLIT)
EPOCHS = (
    click.option("--epochs", type=click.IntRange(1), help="[default: the preset's]"),
    click.option("--batch", type=click.IntRange(1), help="Motions per batch. [default: the preset's]"),
    SPLIT,
    click.option("--mirror/--no-mirror", default=None, help="Mirror left and right at random. [default: the preset's]"),
)
LOSS = click.option(
    "--loss", type=click.Choice(list(LOSSES)), help="Eq. 12, or the true likelihood. [default: the preset's]"
)
VECTORS = (
    click.option("--word-vectors", type=Path, help="Initial word vectors: a word and its numbers per line."),
    click.option("--vectors-from", help="Source and licence of the vectors, for the manifest."),
)
START = click.option("--start", type=Path, help="Run of a codec: train its decoder alone (--preset decoder, sharp).")
PARTS = (
    click.option("--codec", type=Path, required=True, help="Run of a codec, trained on the same data and split."),
    click.option(
        "--actions", type=Path, required=True, help="Run of an action net, trained on the same data and split."
    ),
)

RUNS = ("start", "codec", "actions")
"""Options that name runs."""


def _command(
    name: str, text: str, recipes: Mapping[str, Recipe], train: Callable[..., Run], *options: Callable[..., Any]
) -> click.Command:
    """A command that calls a recipe's function with a store, the job, the store's name and its own options."""

    def run(job: Job, data: Path, **given: Any) -> Run:
        corpus = {key: given.pop(key) for key in ("sentences", "people", "gaits", "unit_in", "figure")}
        runs = {key: Run.load(given[key]) for key in RUNS if given.get(key)}
        return train(prepared(data, job, **corpus), job, data.name, **{**given, **runs})

    run.__doc__ = text
    return train_command(name, recipes, *DATA, *options)(run)


def _actions(store: Store, job: Job, data: str, by: str, word_vectors: Path | None, vectors_from: str | None) -> Run:
    vectors = None if word_vectors is None else WordVectors(word_vectors, vectors_from)
    return actions.train_actions(store, job, data, by, vectors)


DESCRIBE = "Train motion to language: a net that describes a motion in words."
SEARCH = "Train a joint embedding for search: motions and sentences in one space."
MIXTURE = "Train language to motion, after Plappert et al. 2017: frame by frame from a mixture."
CODEC = "Train a codec of motions: frames to codes and back."
ACTIONS = "Train a net that recognizes the action a sentence asks for."
CODES = "Train a code writer: from a sentence to motion, code by code."
FILL = "Train a net that fills gaps in motions from the frames before and after."
MATCHING = "Train a steerable figure: motion matching on recordings of gaits."
STEERED = "Train a steerable figure: the thesis' nets on recordings of walking and running."

COMMANDS = (
    _command("describe", DESCRIBE, describe.RECIPES, train_language, *EPOCHS),
    _command("search", SEARCH, search.RECIPES, search.train_search, *EPOCHS),
    _command("mixture", MIXTURE, plappert2017.RECIPES, train_language, *EPOCHS, LOSS),
    _command("codec", CODEC, codec.RECIPES, codec.train_codec, *STEPS, START),
    _command("actions", ACTIONS, actions.RECIPES, _actions, *STEPS, *VECTORS),
    _command("codes", CODES, codes.RECIPES, codes.train_codes, *STEPS, *PARTS),
    _command("fill", FILL, fill.RECIPES, fill.train_fill, *STEPS),
    _command("matching", MATCHING, matching.RECIPES, matching.train_matching, STEPS[0]),
    _command("steered-tdbn", STEERED, steered.RECIPES, steered.train_steered),
)
