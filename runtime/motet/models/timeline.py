"""Where a long motion changes: short windows, candidate sentences for each, and the best path through them.

The path of a hidden Markov model (Viterbi 1967) whose states are sentences and whose changes all cost the same.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, ClassVar

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.rollout import Ids, Scores
from motet.decode.score import score_words
from motet.models.language import padded
from motet.settings import Progress, Range, Settings, silent

ROWS = 512
"""Pairs scored at once."""

Span = tuple[int, int]


@dataclass(frozen=True)
class TimelineSettings(Settings):
    """How a motion is cut into parts.

    window, hop: the length of a window, and the time from one to the next. Longer windows miss short actions: of the
        joins between motions of validation subjects, 1.5 s finds four fifths, 3 s half.
    change: the cost of a change of sentence. Three windows cover each moment, so with 12 nats a new sentence pays where
        it is e^4 times as probable for the length of a window.
    near: the distance within which a window is scored for other windows' sentences.
    """

    FEATURE: ClassVar[str] = "timeline"
    window: Annotated[float, Range(0.1, 30, "s")] = 1.5
    hop: Annotated[float, Range(0.1, 30, "s")] = 0.5
    change: Annotated[float, Range(0, 1000, "nats")] = 12.0
    near: Annotated[float, Range(0, 600, "s")] = 15.0

    @property
    def reach(self) -> int:
        """``near`` in windows."""
        return round(self.near / self.hop)


def windows(frames: int, fps: float, settings: TimelineSettings) -> list[Span]:
    """Frames (start, stop) of overlapping windows, evenly spread, of the settings' length or the motion's."""
    length, hop = max(2, round(settings.window * fps)), max(1, round(settings.hop * fps))
    count = max(1, 1 + -(-(frames - length) // hop))
    starts = np.linspace(0, max(0, frames - length), count).round().astype(int).tolist()
    return [(start, min(start + length, frames)) for start in starts]


def near_scores(
    step: Graph, contexts: Floats, said: Sequence[tuple[int, ...]], near: int, progress: Progress = silent
) -> Scores:
    """Log-probabilities (W, S) of the sentences of W windows, sorted by their ids, given each window.

    said: the ids of a sentence for each window, from the start to the end. near: how many windows before and after a
    window are scored for its sentence; the others get minus infinity. progress: counts windows.
    """
    sentences = sorted(set(said))
    words = padded([np.array(ids) for ids in sentences], "int64")[0]
    places = {ids: place for place, ids in enumerate(sentences)}
    own = np.array([places[ids] for ids in said])
    found = np.full((len(said), len(sentences)), -np.inf)
    for rows, columns in _chunks(own, near):
        found[rows, columns] = score_words(step, contexts, rows, words[columns])
        progress(int(rows[-1]) + 1, len(said))
    return found


def _chunks(own: Ids, near: int) -> Iterator[tuple[Ids, Ids]]:
    """Windows and sentences to be paired, both (N,), in chunks of about :data:`ROWS` pairs."""
    rows: list[int] = []
    columns: list[int] = []
    for row in range(len(own)):
        asked = np.unique(own[max(0, row - near) : row + near + 1]).tolist()
        rows += [row] * len(asked)
        columns += asked
        if len(rows) >= ROWS or row == len(own) - 1:
            yield np.array(rows), np.array(columns)
            rows, columns = [], []


def best_path(scores: Scores, change: float) -> list[int]:
    """For each window the column of (W, S) such that the sum, less ``change`` for each change of column, is largest."""
    best, back = scores[0], []
    for row in scores[1:]:
        leader = int(best.argmax())
        stays = best >= best[leader] - change
        back.append(np.where(stays, np.arange(len(best)), leader))
        best = np.where(stays, best, best[leader] - change) + row
    path = [int(best.argmax())]
    for before in reversed(back):
        path.append(int(before[path[-1]]))
    return path[::-1]


def edges(spans: Sequence[Span], path: Sequence[int]) -> list[int]:
    """The boundaries of parts in frames: the first, the last, and the middle between two windows that differ."""
    middles = [(start + stop) / 2 for start, stop in spans]
    steps = zip(pairwise(middles), pairwise(path), strict=True)
    return [spans[0][0], *(round(sum(two) / 2) for two, (a, b) in steps if a != b), spans[-1][1]]
