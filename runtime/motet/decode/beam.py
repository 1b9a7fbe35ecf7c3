"""Loops over words: beam search, draws from a model's distribution, and the sentence that agrees best with all draws.

Beam search: section 4.2.3 of Plappert et al. 2017. Agreement is minimum Bayes risk decoding (Kumar and Byrne 2004),
from many draws, as Eikema and Aziz (2020) do: "Is MAP decoding all you need?"
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode.loop import Ids, Loop, Scores, State, advance, taken, two_rows, zero_state
from motet.settings import Range, Settings


class Limits(NamedTuple):
    """Ids of start and end, the most words in a sequence, and ids never chosen."""

    start: int
    end: int
    longest: int
    banned: Sequence[int] = ()

    def exclude(self, log_probabilities: NDArray[Any], length: int) -> None:
        """Set to -inf, in place, what cannot follow ``length`` words (N, V): after the longest, all but the end."""
        log_probabilities[:, list(self.banned)] = -np.inf
        if length == self.longest:
            log_probabilities[:, np.arange(log_probabilities.shape[1]) != self.end] = -np.inf


class Hypothesis(NamedTuple):
    """A finished sequence: its ids without start and end, and the sum of its steps' log-probabilities, end included.

    score: what sequences are ranked by, the higher the better.
    """

    ids: tuple[int, ...]
    log_probability: float
    score: float


class Drawn(NamedTuple):
    """A sequence as in :class:`Hypothesis`, and how often it came.

    The log-probability is the model's own, whatever the temperature was.
    """

    ids: tuple[int, ...]
    log_probability: float
    times: int


def beam_search(step: Graph, contexts: Arrays, limits: Limits, beams: int) -> list[list[Hypothesis]]:
    """For each row of ``contexts`` up to ``beams`` hypotheses, the most probable first.

    step: word (N,), contexts (N, ...) and fed back states -> log_probabilities (N, V). One call for all rows and beams.
    contexts: what is known of each row, by the step's inputs: "context" (B, C), and with attention further ones.
    Scores are log-probabilities, not divided by length. A hypothesis that ended keeps its score and its place as long
    as no ``beams`` others are better; a row is done when all of its have ended.
    """
    rows = len(contexts["context"])
    row = np.arange(rows)[:, None]
    scores = np.where(np.arange(beams) == 0, 0.0, -np.inf) * np.ones((rows, 1))
    words = np.full((rows, beams, 1), limits.start, dtype=np.int64)
    state = zero_state(step, rows * beams)
    places = np.arange(rows * beams)
    for length in range(limits.longest + 1):
        last = words[:, :, -1]
        alive = two_rows(np.flatnonzero((last != limits.end) & np.isfinite(scores)))
        if not len(alive):
            break

        # the graph: the words that may follow those that have not ended
        inputs: Arrays = {"word": last.ravel()[alive], **taken(contexts, alive // beams)}
        outputs, state = advance(step, taken(state, places[alive]), inputs)
        log_probabilities = outputs["log_probabilities"]
        limits.exclude(log_probabilities, length)

        # the best of each row, each behind its parent's words
        scores, parents, chosen = _best(scores, alive, log_probabilities, limits.end)
        words = np.concatenate([words[row, parents], chosen[:, :, None]], axis=2)

        # where the states of the parents are; one that has ended gets that of some other, which is never used
        places = np.searchsorted(alive, parents + row * beams).ravel() % len(alive)
    sequences = zip(words[:, :, 1:].tolist(), scores.tolist(), strict=True)
    return [_hypotheses(ids, row_scores, limits.end) for ids, row_scores in sequences]


def _hypotheses(sequences: list[list[int]], scores: list[float], end: int) -> list[Hypothesis]:
    """The hypotheses of one row, without the places that none took."""
    hypotheses = []
    for ids, score in zip(sequences, scores, strict=True):
        if np.isfinite(score):
            hypotheses.append(Hypothesis(tuple(ids[: ids.index(end)]), score, score))
    return hypotheses


def _best(scores: Scores, alive: Ids, left: NDArray[Any], end: int) -> tuple[Scores, Ids, Ids]:
    """The best hypotheses of each row among ended ones and the extensions: score, parent and word, each (B, beams).

    left: log-probabilities (N, V) of the words after those ``alive``; used up.
    """
    rows, beams = scores.shape
    width = min(beams, left.shape[1])
    size = (rows * beams, width)
    pool = np.full(size, -np.inf)
    words = np.full(size, end, dtype=np.int64)

    # ended hypotheses are kept unchanged
    pool[:, 0] = scores.ravel()

    words[alive], log_probabilities = _likeliest(left, width)
    pool[alive] = pool[alive, :1] + log_probabilities

    pool = pool.reshape(rows, -1)
    words = words.reshape(rows, -1)
    row = np.arange(rows)[:, None]
    best = np.argsort(-pool, kind="stable")[:, :beams]
    return pool[row, best], best // width, words[row, best]


def _likeliest(log_probabilities: NDArray[Any], count: int) -> tuple[Ids, NDArray[Any]]:
    """The ``count`` likeliest words of each row (N, V), which is used up, and their log-probabilities: (N, count)."""
    rows, size = log_probabilities.shape
    words = np.empty((count, rows), dtype=np.int64)
    values = np.empty((count, rows), dtype=log_probabilities.dtype)
    flat = log_probabilities.reshape(-1)
    starts = np.arange(0, rows * size, size)
    for number in range(count):  # a few passes of argmax take a fraction of argpartition's time
        words[number] = log_probabilities.argmax(axis=1)
        places = words[number] + starts
        values[number] = flat[places]
        flat[places] = -np.inf
    return words.T, values.T


def noise_of(limits: Limits, draws: int, seed: int = 0) -> Floats:
    """The uniform numbers (longest + 1, draws) float32 that every row is drawn with, and so as it would be alone."""
    return np.random.Generator(np.random.PCG64(seed)).random((limits.longest + 1, draws), np.float32)


def draw_sequences(
    step: Graph, contexts: Arrays, limits: Limits, draws: int, temperature: float, noise: Floats | None = None
) -> list[list[Drawn]]:
    """For each row of ``contexts`` the different ones of ``draws`` sequences; ``draws`` in all.

    step, contexts: as :func:`beam_search`; N is how many different beginnings the draws have. Temperature T divides the
    log-probabilities. noise: uniform numbers (longest + 1, draws), those of :func:`noise_of` by default.

    The n draws that begin alike take the words at u / n, (1 + u) / n, ... (n - 1 + u) / n of the distribution, with one
    uniform number u (systematic sampling). A word of probability p then comes n p times, rounded up or down, and n p
    times on average: the draws show the distribution better than independent ones.
    """
    noise = noise_of(limits, draws) if noise is None else noise
    sequences = _Draws(step, contexts, limits, draws)
    for length in range(limits.longest + 1):
        if not len(sequences.alive):
            break
        sequences.advance(length, temperature, noise[length])
    return sequences.counted()


class _Draws:
    """B rows of n draws, word by word.

    alive: (A,) the draws that have not ended; those that begin alike are neighbours. beginning: (A,) of each of these.
    row, last, state: of each different beginning the row of contexts, the last word and the graph's states.
    """

    def __init__(self, step: Graph, contexts: Arrays, limits: Limits, draws: int) -> None:
        rows = len(contexts["context"])
        self.step = step
        self.contexts = contexts
        self.limits = limits
        self.draws = draws
        self.words = np.full((rows * draws, limits.longest + 1), limits.end, dtype=np.int64)
        self.scores = np.zeros(rows * draws)
        self.alive = np.arange(rows * draws)
        self.beginning = self.alive // draws
        self.row = two_rows(np.arange(rows))
        self.last = np.full(len(self.row), limits.start, dtype=np.int64)
        self.state = zero_state(step, len(self.row))

    def advance(self, length: int, temperature: float, uniform: Floats) -> None:
        """One more word for each draw that has not ended, by uniform numbers (n,)."""
        # the graph: the words that may follow each beginning
        inputs: Arrays = {"word": self.last, **taken(self.contexts, self.row)}
        outputs, following = advance(self.step, self.state, inputs)
        log_probabilities = outputs["log_probabilities"]
        possible = log_probabilities.astype(np.float64)
        self.limits.exclude(possible, length)

        # the word of each draw
        relative = np.exp((possible - possible.max(axis=1, keepdims=True)) / temperature)
        ends = np.cumsum(relative, axis=1)
        chosen = _spread(ends / ends[:, -1:], self.beginning, uniform[self.alive % self.draws])
        self.words[self.alive, length] = chosen
        self.scores[self.alive] += log_probabilities[self.beginning, chosen]
        self._begin(chosen, following, possible.shape[1])

    def _begin(self, chosen: Ids, following: State, words: int) -> None:
        """The beginnings with the chosen words (A,) behind them; what has ended leaves."""
        goes_on = chosen != self.limits.end
        longer = (self.beginning * words + chosen)[goes_on]
        self.alive = self.alive[goes_on]
        unique = two_rows(np.unique(longer))
        self.beginning = np.searchsorted(unique, longer)
        parent, self.last = np.divmod(unique, words)
        self.row = self.row[parent]
        self.state = taken(following, parent)

    def counted(self) -> list[list[Drawn]]:
        """Of each row the different sequences."""
        counted = []
        for first in range(0, len(self.words), self.draws):
            of_row = slice(first, first + self.draws)
            counted.append(_counted(self.words[of_row].tolist(), self.scores[of_row].tolist(), self.limits.end))
        return counted


def _spread(shares: Scores, begun: Ids, uniform: Floats) -> Ids:
    """The word of each draw (n,), from row ``begun`` of where each word's share of 0 to 1 ends (N, V), sorted."""
    first = np.searchsorted(begun, begun)
    rank = np.arange(len(begun)) - first
    place = (rank + uniform[first].astype(np.float64)) / np.bincount(begun)[begun]
    chosen: Ids = (shares[begun] > place[:, None]).argmax(axis=1)
    return chosen


def _counted(words: list[list[int]], scores: list[float], end: int) -> list[Drawn]:
    sequences = [tuple(ids[: ids.index(end)]) for ids in words]
    score = dict(zip(sequences, scores, strict=True))
    return [Drawn(ids, score[ids], times) for ids, times in Counter(sequences).items()]


def consensus(
    step: Graph,
    contexts: Arrays,
    limits: Limits,
    beams: int,
    draws: int,
    temperature: float,
    noise: Floats | None = None,
) -> list[list[Hypothesis]]:
    """For each row of ``contexts`` up to ``beams`` of the sequences drawn, the one that agrees best first.

    The others: see :func:`draw_sequences`. Scores are agreements, 0 to 1.
    """
    return [by_consensus(row)[:beams] for row in draw_sequences(step, contexts, limits, draws, temperature, noise)]


def by_consensus(drawn: Sequence[Drawn]) -> list[Hypothesis]:
    """The drawn sequences by falling :func:`agreement` with all draws; of equal ones the most probable first."""
    scores = agreement([sequence.ids for sequence in drawn], np.array([sequence.times for sequence in drawn]))
    falling = -scores.round(9)  # what only rounding tells apart is equal
    order = sorted(range(len(drawn)), key=lambda i: (falling[i], -drawn[i].log_probability))
    return [Hypothesis(drawn[i].ids, drawn[i].log_probability, float(scores[i])) for i in order]


def agreement(sequences: Sequence[tuple[int, ...]], times: Ids) -> Scores:
    """What each of S sequences has in common with the others and itself, each as often as it came: means (S,), 0 to 1.

    In common: the mean of two F1, of the words and of the pairs of neighbouring words that both have.
    """
    agreements = np.zeros(len(sequences))
    for order in (1, 2):
        marks = _marks(sequences, order)
        sizes = marks.sum(axis=1)
        # a product counts what both have
        f1 = 2 * (marks @ marks.T) / np.maximum(sizes[:, None] + sizes, 1)
        agreements += f1 @ (times / times.sum()) / 2
    return agreements


def _marks(sequences: Sequence[tuple[int, ...]], order: int) -> Scores:
    """(S, N): 1 where a sequence has an n-gram of that order; its second, third, ... time is a column of its own."""
    columns: dict[tuple[tuple[int, ...], int], int] = {}
    rows = []
    places = []
    for row, ids in enumerate(sequences):
        times: Counter[tuple[int, ...]] = Counter()
        for first in range(len(ids) - order + 1):
            gram = ids[first : first + order]
            times[gram] += 1
            rows.append(row)
            places.append(columns.setdefault((gram, times[gram]), len(columns)))
    marks = np.zeros((len(sequences), len(columns)))
    marks[rows, places] = 1
    return marks


def score_words(step: Graph, contexts: Arrays, rows: Ids, words: Ids) -> Scores:
    """Log-probabilities (N,) of N sequences of words, each under the context of its row.

    step, contexts: as :func:`beam_search`. rows: (N,) of contexts. words: (N, W), the start, the words, the
    end, and 0 behind it. Sequences of one row share the steps of the words with which they all begin.
    """
    totals = np.zeros(len(rows))
    group = rows
    state = zero_state(step, len(contexts["context"]))
    count = int(words.max()) + 1
    for previous, coming in zip(words.T, words.T[1:], strict=False):
        alive = np.flatnonzero(coming)
        if not len(alive):
            break

        # those that have begun alike are one row of the step
        beginnings = group[alive] * count + previous[alive]
        _, first, same = np.unique(beginnings, return_index=True, return_inverse=True)
        chosen = two_rows(alive[first])
        row = rows[chosen]
        inputs: Arrays = {"word": previous[chosen], **taken(contexts, row)}
        outputs, state = advance(step, taken(state, group[chosen]), inputs)

        group = np.zeros_like(rows)
        group[alive] = same
        totals[alive] += outputs["log_probabilities"][same, coming[alive]]
    return totals


@dataclass(frozen=True)
class BeamSettings(Settings):
    """max_words: the longest sentence, in words. beams: hypotheses kept, and returned."""

    max_words: Annotated[int, Range(1, 1000)]
    beams: Annotated[int, Range(1, 100)] = 5


@dataclass(frozen=True)
class ConsensusSettings(BeamSettings):
    """beams: sentences that are given. draws: sentences that are drawn."""

    draws: Annotated[int, Range(1, 1000)] = 100
    temperature: Annotated[float, Range(0.01, 100)] = 1.0


_STEP = {"word": "*batch", "context": "batch C"}, {"log_probabilities": "batch V"}

LOOPS: Mapping[str, Loop] = {
    "beam": Loop(beam_search, *_STEP, BeamSettings, batch=128),
    "consensus": Loop(consensus, *_STEP, ConsensusSettings, batch=16),
}
