"""Bare commands, the words that people type first: whether the motion does it, or at least a warning says that it does
not."""

from collections.abc import Mapping, Sequence

import numpy as np

from motet.bundle.fields import Json
from motet.errors import TextWarning, collected
from motet.generate.base import Generated, GenerateModel, Story
from motet.text.clauses import stem
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.table import read_toml
from motet_train.evaluate.tables import Figures, Report
from motet_train.evaluate.text_adherence.prompts import holds
from motet_train.evaluate.text_adherence.track import track_of

BARE_COMMANDS = read_toml(__file__, "bare.toml")
"""Commands with the rules that a motion must keep, "bare", and stems of words for other acts, "odd"."""


def bare_report(model: GenerateModel, seeds: Sequence[int]) -> Report:
    """Shares from 0 to 1 of motions that do what a command says ("right"), and of those that do not and come without a
    warning ("unwarned"); of the half that may be chosen by, and of the half kept back ("kept_").

    "bare_right" and "bare_unwarned" have them by command.
    """
    right: Figures = {}
    unwarned: Figures = {}
    for row in BARE_COMMANDS["bare"]:
        outcomes = [_outcome(model, row, seed) for seed in seeds]
        right[row["text"]] = float(np.mean([does for does, _ in outcomes]))
        unwarned[row["text"]] = float(np.mean([not does and not warned for does, warned in outcomes]))
    means = {
        "right": _mean(right, False),
        "unwarned": _mean(unwarned, False),
        "kept_right": _mean(right, True),
        "kept_unwarned": _mean(unwarned, True),
    }
    return {"bare": means, "bare_right": right, "bare_unwarned": unwarned}


def _mean(shares: Mapping[str, float], kept: bool) -> float:
    """The mean over the half of the commands that is kept back, or over the other."""
    return float(np.mean([shares[row["text"]] for row in BARE_COMMANDS["bare"] if row.get("kept", False) == kept]))


def _outcome(model: GenerateModel, row: Json, seed: int) -> tuple[bool, bool]:
    """Whether the motion of a command does what it says, and whether there was a warning."""
    with collected(TextWarning) as warnings:
        (generated,) = model.generate(row["text"], seed=seed)
    does = holds(track_of(generated.motion), row["rules"]) and not odd_words(generated, row)
    return does, bool(warnings)


def odd_words(generated: Generated, row: Json) -> set[str]:
    """The stems of words for other acts in the sentences of the actions that a motion shows."""
    shown = [generated.action]
    if isinstance(generated, Story):
        shown += [passage.action for passage in generated.passages]
    stems = set(map(stem, NEW_MODEL_RULES.words(" ".join(shown))))
    allowed = {*map(stem, NEW_MODEL_RULES.words(row["text"])), *row.get("also", ())}
    return stems & set(BARE_COMMANDS["odd"]) - allowed
