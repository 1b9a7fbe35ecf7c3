"""The sentence that agrees best with all others: minimum Bayes risk decoding (Kumar and Byrne 2004).

From many draws, as Eikema and Aziz (2020) do: "Is MAP decoding all you need?"
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.ancestral import Drawn, draw_sequences
from motet.decode.beam import INPUTS, OUTPUTS, BeamSettings, Hypothesis, Limits
from motet.decode.loop import Loop
from motet.decode.rollout import Ids, Scores
from motet.settings import Range

ORDERS = (1, 2)
"""Words, and pairs of words that follow each other."""


def consensus(
    step: Graph,
    context: Floats,
    limits: Limits,
    beams: int,
    draws: int,
    temperature: float,
    noise: Floats | None = None,
) -> list[list[Hypothesis]]:
    """For each row of ``context`` (B, C) up to ``beams`` of the sequences drawn, the one that agrees best first.

    step, draws, temperature, noise: see :func:`motet.decode.ancestral.draw_sequences`. Scores are agreements, 0 to 1.
    """
    drawn = draw_sequences(step, context, limits, draws, temperature, noise)
    return [by_consensus(row)[:beams] for row in drawn]


def by_consensus(drawn: Sequence[Drawn]) -> list[Hypothesis]:
    """The drawn sequences by falling :func:`agreement` with all draws; of equal ones the most probable first."""
    scores = agreement([one.ids for one in drawn], np.array([one.times for one in drawn]))
    falling = -scores.round(9)  # what only rounding tells apart is equal
    order = sorted(range(len(drawn)), key=lambda i: (falling[i], -drawn[i].log_probability))
    return [Hypothesis(drawn[i].ids, drawn[i].log_probability, float(scores[i])) for i in order]


def agreement(sequences: Sequence[tuple[int, ...]], times: Ids) -> Scores:
    """What each of S sequences has in common with the others and itself, each as often as it came: means (S,), 0 to 1.

    In common: the mean of two F1, of the words and of the pairs that both have.
    """
    found = np.zeros(len(sequences))
    for order in ORDERS:
        marks = _marks(sequences, order)
        sizes = marks.sum(axis=1)
        shared = 2 * (marks @ marks.T) / np.maximum(sizes[:, None] + sizes, 1)
        found += shared @ (times / times.sum()) / len(ORDERS)
    return found


def _marks(sequences: Sequence[tuple[int, ...]], order: int) -> Scores:
    """(S, G) of 0 and 1: whether a sequence has an n-gram for the first, second, ... time.

    The product of two rows is the number of n-grams that both have.
    """
    columns: dict[tuple[tuple[int, ...], int], int] = {}
    places = []
    for row, ids in enumerate(sequences):
        seen: Counter[tuple[int, ...]] = Counter()
        for gram in zip(*(ids[shift:] for shift in range(order)), strict=False):
            seen[gram] += 1
            places.append((row, columns.setdefault((gram, seen[gram]), len(columns))))
    marks = np.zeros((len(sequences), len(columns)))
    marks[tuple(np.array(places, dtype=np.intp).reshape(-1, 2).T)] = 1
    return marks


@dataclass(frozen=True)
class ConsensusSettings(BeamSettings):
    """beams: sentences that are given. draws: sentences that are drawn."""

    draws: Annotated[int, Range(1, 1000)] = 100
    temperature: Annotated[float, Range(0.01, 100)] = 1.0


LOOP = Loop(consensus, INPUTS, OUTPUTS, ConsensusSettings, batch=16)
