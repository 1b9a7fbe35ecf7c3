"""Beam search over words. Section 4.2.3 of Plappert et al. 2017."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode.loop import Loop
from motet.decode.rollout import Ids, Scores, advance, two_rows, zero_state
from motet.settings import Range, Settings


@dataclass(frozen=True)
class BeamSettings(Settings):
    """max_words: the longest sentence, in words. beams: hypotheses kept, and returned."""

    max_words: Annotated[int, Range(1, 1000)]
    beams: Annotated[int, Range(1, 100)] = 5


class Limits(NamedTuple):
    """Ids of start and end, the most words in a sequence, and ids never chosen."""

    start: int
    end: int
    longest: int
    banned: Sequence[int] = ()


class Hypothesis(NamedTuple):
    """A finished sequence: its ids without start and end, and the sum of its steps' log-probabilities, end included.

    score: what sequences are ranked by, the higher the better.
    """

    ids: tuple[int, ...]
    log_probability: float
    score: float


def beam_search(step: Graph, context: Floats, limits: Limits, beams: int) -> list[list[Hypothesis]]:
    """For each row of ``context`` (B, C) up to ``beams`` hypotheses, the most probable first.

    step: word (N,), context (N, C) and fed back states -> log_probabilities (N, V). One call for all rows and beams.
    Scores are not divided by length. A hypothesis that ended keeps its score and its place as long as no ``beams``
    others are better; a row is done when all of its have ended. After the longest sequence nothing but the end is
    possible, so every score is that of a whole sequence. Scores are log-probabilities.
    """
    rows, end = len(context), limits.end
    scores = np.where(np.arange(beams) == 0, 0.0, -np.inf) * np.ones((rows, 1))
    words = np.full((rows, beams, 1), limits.start, dtype=np.int64)
    state = zero_state(step, rows * beams)
    for length in range(limits.longest + 1):
        alive = two_rows(np.flatnonzero((words[:, :, -1] != end) & np.isfinite(scores)))
        if not len(alive):
            break
        inputs: Arrays = {"word": words[:, :, -1].ravel()[alive], "context": context[alive // beams]}
        outputs, following = advance(step, {name: array[alive] for name, array in state.items()}, inputs)
        only = end if length == limits.longest else None
        best, gains = _best_words(outputs["log_probabilities"], beams, only, limits.banned)
        scores, parents, chosen = _merge(scores, alive, best, gains, end)
        words = np.concatenate([np.take_along_axis(words, parents[:, :, None], 1), chosen[:, :, None]], axis=2)
        places = np.searchsorted(alive, parents + np.arange(rows)[:, None] * beams).ravel() % len(alive)
        state = {name: np.take(array, places, axis=0) for name, array in following.items()}
    return [_hypotheses(ids, score, end) for ids, score in zip(words[:, :, 1:], scores, strict=True)]


def _best_words(log_probabilities: Floats, count: int, only: int | None, banned: Sequence[int]) -> tuple[Ids, Floats]:
    """The ``count`` most probable words of each row, best first: ids and log-probabilities (N, count)."""
    left = np.array(log_probabilities)
    left[:, list(banned)] = -np.inf
    if only is not None:
        left[:, np.arange(left.shape[1]) != only] = -np.inf
    count = min(count, left.shape[1])
    ids = np.empty((len(left), count), dtype=np.int64)
    gains = np.empty((len(left), count), dtype=np.float32)
    row = np.arange(len(left))
    for place in range(count):  # a few passes of argmax take a fraction of argpartition's time
        ids[:, place] = left.argmax(axis=1)
        gains[:, place] = left[row, ids[:, place]]
        left[row, ids[:, place]] = -np.inf
    return ids, gains


def _merge(scores: Scores, alive: Ids, best: Ids, gains: Floats, end: int) -> tuple[Scores, Ids, Ids]:
    """The best hypotheses of each row among ended ones and the extensions: score, parent and word, each (B, beams)."""
    rows, beams = scores.shape
    width = best.shape[1]
    pool = np.full((rows * beams, width), -np.inf)
    pool[:, 0] = scores.ravel()  # ended hypotheses are kept unchanged
    pool[alive] = scores.ravel()[alive, None] + gains
    words = np.full((rows * beams, width), end, dtype=np.int64)
    words[alive] = best
    pool, words = pool.reshape(rows, -1), words.reshape(rows, -1)
    order = np.argsort(-pool, axis=1, kind="stable")[:, :beams]
    return np.take_along_axis(pool, order, 1), order // width, np.take_along_axis(words, order, 1)


def _hypotheses(ids: Ids, scores: Scores, end: int) -> list[Hypothesis]:
    found = []
    for sequence, score in zip(ids.tolist(), scores.tolist(), strict=True):
        if np.isfinite(score):
            found.append(Hypothesis(tuple(sequence[: sequence.index(end)]), score, score))
    return found


INPUTS, OUTPUTS = {"word": "*batch", "context": "batch C"}, {"log_probabilities": "batch V"}
"""Of the step of every loop over words."""

LOOP = Loop(beam_search, INPUTS, OUTPUTS, BeamSettings, batch=128)
