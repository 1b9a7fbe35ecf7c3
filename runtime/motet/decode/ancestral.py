"""Sentences drawn word by word from a model's distribution (ancestral sampling), spread evenly over it."""

from typing import NamedTuple

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.beam import Limits
from motet.decode.rollout import Ids, Scores, advance, two_rows, zero_state


class Drawn(NamedTuple):
    """A sequence without start and end, the sum of its steps' log-probabilities, end included, and how often it came.

    The log-probability is the model's own, whatever the temperature was.
    """

    ids: tuple[int, ...]
    log_probability: float
    times: int


def noise_of(limits: Limits, draws: int, seed: int = 0) -> Floats:
    """The uniform numbers (longest + 1, draws) float32 that every row is drawn with, and so as it would be alone."""
    return np.random.Generator(np.random.PCG64(seed)).random((limits.longest + 1, draws), np.float32)


def draw_sequences(
    step: Graph, context: Floats, limits: Limits, draws: int, temperature: float, noise: Floats | None = None
) -> list[list[Drawn]]:
    """For each row of ``context`` (B, C) the different ones of ``draws`` sequences; ``draws`` in all.

    step: word (N,), context (N, C) and fed back states -> log_probabilities (N, V); N is how many different beginnings
    the draws have. Temperature T divides the log-probabilities. A sequence that is ``longest`` can only end.

    The n draws that begin alike take the words at u / n, (1 + u) / n, ... (n - 1 + u) / n of the distribution, with one
    uniform number u (systematic sampling). A word of probability p then comes n p times, rounded up or down, and n p
    times on average: the draws show the distribution better than independent ones.

    noise: uniform numbers (longest + 1, draws), those of :func:`noise_of` by default.
    """
    rows = len(context)
    noise = noise_of(limits, draws) if noise is None else noise
    found = np.full((rows * draws, limits.longest + 1), limits.end, dtype=np.int64)
    scores = np.zeros(rows * draws)
    alive = np.arange(rows * draws)  # the draws that have not ended; those that begin alike are neighbours
    row = two_rows(np.arange(rows))  # of each beginning, as the last word and the state
    last, state = np.full(len(row), limits.start, dtype=np.int64), zero_state(step, len(row))
    begun = alive // draws  # of each draw the beginning
    for length in range(limits.longest + 1):
        if not len(alive):
            break
        outputs, following = advance(step, state, {"word": last, "context": context[row]})
        shares = _shares(outputs["log_probabilities"], temperature, limits, only_end=length == limits.longest)
        chosen = _spread(shares, begun, noise[length, alive % draws])
        found[alive, length] = chosen
        scores[alive] += outputs["log_probabilities"][begun, chosen]
        goes_on = chosen != limits.end
        longer = (begun * shares.shape[1] + chosen)[goes_on]
        alive, unique = alive[goes_on], two_rows(np.unique(longer))
        begun = np.searchsorted(unique, longer)
        parent, last = np.divmod(unique, shares.shape[1])
        row, state = row[parent], {name: array[parent] for name, array in following.items()}
    pairs = zip(found.reshape(rows, draws, limits.longest + 1), scores.reshape(rows, draws), strict=True)
    return [_counted(*pair, limits.end) for pair in pairs]


def _shares(log_probabilities: Floats, temperature: float, limits: Limits, only_end: bool) -> Scores:
    """Where each word's share of 0 to 1 ends, (N, V)."""
    left = log_probabilities.astype(np.float64)
    left[:, list(limits.banned)] = -np.inf
    if only_end:
        left[:, np.arange(left.shape[1]) != limits.end] = -np.inf
    shares: Scores = np.cumsum(np.exp((left - left.max(axis=1, keepdims=True)) / temperature), axis=1)
    return shares / shares[:, -1:]


def _spread(shares: Scores, begun: Ids, uniform: Floats) -> Ids:
    """The word of each draw (n,), from row ``begun`` of ``shares``; ``begun`` is sorted."""
    first = np.searchsorted(begun, begun)
    rank = np.arange(len(begun)) - first
    place = (rank + uniform[first].astype(np.float64)) / np.bincount(begun)[begun]
    chosen: Ids = (shares[begun] > place[:, None]).argmax(axis=1)
    return chosen


def _counted(found: Ids, scores: Scores, end: int) -> list[Drawn]:
    different: dict[tuple[int, ...], Drawn] = {}
    for sequence, score in zip(found.tolist(), scores.tolist(), strict=True):
        ids = tuple(sequence[: sequence.index(end)])
        before = different[ids].times if ids in different else 0
        different[ids] = Drawn(ids, score, before + 1)
    return list(different.values())
