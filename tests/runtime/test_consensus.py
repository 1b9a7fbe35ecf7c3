from collections import Counter
from itertools import product

import numpy as np
import pytest
from fake_models import STATE, Array, FakeGraph, word_step
from numpy.typing import NDArray

from motet.decode.beam import Drawn, Limits, agreement, by_consensus, draw_sequences

pytestmark = pytest.mark.numeric

START, END, WORDS = 0, 1, 5
LIMITS = Limits(START, END, 6)


def contexts(rows: int) -> NDArray[np.float32]:
    return np.random.default_rng(7).normal(size=(rows, 3)).astype(np.float32)


def naive(step: FakeGraph, context: Array, draws: int, temperature: float, limits: Limits) -> list[tuple[int, ...]]:
    """The sequences of one row: the draws with one beginning are handed on together, beginning by beginning."""
    noise = np.random.default_rng(0).random((limits.longest + 1, draws), np.float32)
    found: list[tuple[int, ...]] = [()] * draws

    def follow(those: list[int], ids: tuple[int, ...], state: Array) -> None:
        word = np.array([ids[-1] if ids else limits.start])
        out = step({"word": word, "context": context[None], "state": state})
        weights = np.exp(out["log_probabilities"][0].astype(float) / temperature)
        weights[list(limits.banned)] = 0
        if len(ids) == limits.longest:
            weights *= np.arange(WORDS) == limits.end
        bounds = weights.cumsum() / weights.sum()
        taken: dict[int, list[int]] = {}
        for rank, draw in enumerate(those):
            place = (rank + float(noise[len(ids), those[0]])) / len(those)
            taken.setdefault(next(i for i in range(WORDS) if bounds[i] > place), []).append(draw)
        for chosen, some in taken.items():
            if chosen == limits.end:
                for draw in some:
                    found[draw] = ids
            else:
                follow(some, (*ids, chosen), out["next_state"])

    follow(list(range(draws)), (), np.zeros((1, STATE), np.float32))
    return found


def log_probability(step: FakeGraph, context: Array, ids: tuple[int, ...]) -> float:
    state, total = np.zeros((1, STATE), np.float32), 0.0
    for word, following in zip((START, *ids), (*ids, END), strict=True):
        out = step({"word": np.array([word]), "context": context[None], "state": state})
        total, state = total + float(out["log_probabilities"][0, following]), out["next_state"]
    return total


@pytest.mark.parametrize("draws", [1, 2, 30])
@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("banned", [(), (0, 3)])
def test_draws_are_those_of_each_row_alone(draws: int, temperature: float, banned: tuple[int, ...]) -> None:
    step, context = word_step(5, WORDS, 3, 0.5), contexts(6)
    limits = LIMITS._replace(banned=banned)
    together = draw_sequences(step, {"context": context}, limits, draws, temperature)
    for row, found in zip(context, together, strict=True):
        assert {d.ids: d.times for d in found} == Counter(naive(step, row, draws, temperature, limits))
        assert [d.log_probability for d in found] == pytest.approx(
            [log_probability(step, row, d.ids) for d in found], abs=1e-5
        )
        assert draw_sequences(step, {"context": row[None]}, limits, draws, temperature) == [found]


def test_sequences_come_as_often_as_they_are_probable() -> None:
    step, context = word_step(6, WORDS, 3, 0.3), contexts(1)
    (found,) = draw_sequences(step, {"context": context}, Limits(START, END, 2), 20000, 1.0)
    came = {d.ids: d.times / 20000 for d in found}
    normal = [word for word in range(WORDS) if word != END]
    for ids in ((), *product(normal, repeat=1)):
        assert came.get(ids, 0.0) == pytest.approx(np.exp(log_probability(step, context[0], ids)), abs=2e-4)
    assert sum(came.values()) == pytest.approx(1)
    assert max(map(len, came)) == 2


def test_cold_draws_are_the_greedy_sequence() -> None:
    step, context = word_step(4, WORDS, 3), contexts(3)
    for row, found in zip(context, draw_sequences(step, {"context": context}, LIMITS, 50, 0.01), strict=True):
        ids, word, state = [], START, np.zeros((1, STATE), np.float32)
        while len(ids) < LIMITS.longest:
            out = step({"word": np.array([word]), "context": row[None], "state": state})
            word, state = int(out["log_probabilities"].argmax()), out["next_state"]
            if word == END:
                break
            ids.append(word)
        assert [(d.ids, d.times) for d in found] == [(tuple(ids), 50)]


def test_one_call_for_each_step_of_the_whole_batch_and_none_for_no_rows() -> None:
    step = word_step(6, WORDS, 3, 0.01)
    draw_sequences(step, {"context": contexts(9)}, Limits(START, END, 4), 20, 1.0)
    assert step.calls == 5
    assert draw_sequences(step, {"context": contexts(0)}, LIMITS, 20, 1.0) == []
    assert step.calls == 5


def test_agreement_is_the_mean_f1_with_every_draw() -> None:
    rng = np.random.default_rng(3)
    sequences = list({tuple(rng.integers(4, size=rng.integers(8)).tolist()) for _ in range(30)})
    times = rng.integers(1, 5, len(sequences))
    every = [ids for ids, count in zip(sequences, times, strict=True) for _ in range(count)]
    wanted = [np.mean([[f1(ids, other, n) for n in (1, 2)] for other in every]) for ids in sequences]
    np.testing.assert_allclose(agreement(sequences, times), wanted, atol=1e-12)


def f1(one: tuple[int, ...], other: tuple[int, ...], order: int) -> float:
    grams = [Counter(ids[i : i + order] for i in range(len(ids) - order + 1)) for ids in (one, other)]
    size = sum(map(Counter.total, grams))
    return 2 * (grams[0] & grams[1]).total() / size if size else 0.0


def test_the_best_is_the_one_others_resemble_not_the_most_probable() -> None:
    drawn = [
        Drawn((9, 9, 9), -0.5, 3),
        Drawn((1, 2, 3, 4), -2.0, 1),
        Drawn((1, 2, 3, 5), -1.0, 2),
        Drawn((1, 2, 3, 6), -1.5, 2),
    ]
    ranked = by_consensus(drawn)
    assert [h.ids for h in ranked] == [(1, 2, 3, 5), (1, 2, 3, 6), (1, 2, 3, 4), (9, 9, 9)]
    assert [h.log_probability for h in ranked] == [-1.0, -1.5, -2.0, -0.5]
    swapped = [drawn[i]._replace(log_probability=-float(i)) for i in (3, 2, 1, 0)]
    assert by_consensus(swapped)[0].ids == (1, 2, 3, 5)
