"""``motet train codec``, ``actions`` and ``codes``: what turns motions into codes and back, what tells which action a
sentence asks for, and what writes codes for an action."""

from pathlib import Path
from typing import Any

import click

from motet_train.cli.prepared import prepared
from motet_train.cli.train_language import DATA, SPLIT
from motet_train.cli.train_options import train_command
from motet_train.recipes import actions as reading
from motet_train.recipes import codec as coding
from motet_train.recipes import codes as writing
from motet_train.recipes.actions import WordVectors, train_actions
from motet_train.recipes.codec import train_codec
from motet_train.recipes.codes import train_codes
from motet_train.recipes.recipe import Job
from motet_train.runs import Run

STEPS = click.option("--steps", type=click.IntRange(1), help="[default: the preset's]")

START = click.option("--start", type=Path, help="Run of a codec whose decoder alone is trained on (--preset decoder).")


@train_command("codec", coding.RECIPES, *DATA, SPLIT, STEPS, START)
def codec(job: Job, data: Path, start: Path | None, by: str, **corpus: Any) -> Run:
    """Train a codec of motions: frames to codes and back."""
    run = None if start is None else Run.load(start)
    return train_codec(prepared(data, job, **corpus), job, data.name, by, run)


@train_command(
    "actions",
    reading.RECIPES,
    *DATA,
    SPLIT,
    STEPS,
    click.option("--word-vectors", type=Path, help="Vectors to start from: a word and its numbers in each line."),
    click.option("--vectors-from", help="Whose vectors they are, and their licence, for the manifest."),
)
def actions(job: Job, data: Path, by: str, word_vectors: Path | None, vectors_from: str | None, **corpus: Any) -> Run:
    """Train a net that tells which action a sentence asks for."""
    vectors = None if word_vectors is None else WordVectors(word_vectors, vectors_from)
    return train_actions(prepared(data, job, **corpus), job, data.name, by, vectors)


@train_command(
    "codes",
    writing.RECIPES,
    *DATA,
    SPLIT,
    STEPS,
    click.option("--codec", type=Path, required=True, help="Run of a codec, trained on the same data and split."),
    click.option("--actions", type=Path, required=True, help="Run of a net of actions, trained on the same."),
)
def codes(job: Job, data: Path, codec: Path, actions: Path, by: str, **corpus: Any) -> Run:
    """Train a writer of codes: a sentence to motion, code by code."""
    return train_codes(prepared(data, job, **corpus), Run.load(codec), Run.load(actions), job, data.name, by)
