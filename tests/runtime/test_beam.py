"""Beams and draws against searches of one row and one sequence at a time."""

from collections import Counter
from itertools import product
from typing import Any

import numpy as np
import pytest
from fake_models import STATE, Array, FakeGraph, word_step

from motet.decode.beam import Drawn, Hypothesis, Limits, agreement, beam_search, by_consensus, draw_sequences

pytestmark = pytest.mark.numeric

START, END, WORDS = 0, 1, 5
NORMAL = [word for word in range(WORDS) if word != END]
LIMITS = Limits(START, END, 6)


def contexts(rows: int) -> Array:
    return np.random.default_rng(7).normal(size=(rows, 3)).astype(np.float32)


def log_probability(step: FakeGraph, context: Array, ids: tuple[int, ...]) -> float:
    """Of a whole sequence, step by step."""
    state, total = np.zeros((1, STATE), np.float32), 0.0
    for word, following in zip((START, *ids), (*ids, END), strict=True):
        out = step({"word": np.array([word]), "context": context[None], "state": state})
        total, state = total + float(out["log_probabilities"][0, following]), out["next_state"]
    return total


def naive(step: FakeGraph, context: Array, beams: int, longest: int) -> list[Hypothesis]:
    """One row, one hypothesis at a time, sorting all that there is."""
    hypotheses = [((), 0.0, np.zeros((1, STATE), np.float32), False)]
    for length in range(longest + 1):
        pool = [h for h in hypotheses if h[3]]
        for ids, score, state, _ in (h for h in hypotheses if not h[3]):
            word = np.array([ids[-1] if ids else START])
            out = step({"word": word, "context": context[None], "state": state})
            for following in [END] if length == longest else range(WORDS):
                total = score + float(out["log_probabilities"][0, following])
                ended = following == END
                pool.append((ids if ended else (*ids, following), total, out["next_state"], ended))
        hypotheses = sorted(pool, key=lambda h: -h[1])[:beams]
    return [Hypothesis(ids, score, score) for ids, score, _, _ in hypotheses]


def test_a_wide_beam_finds_what_exhaustive_search_finds() -> None:
    step, context = word_step(4, WORDS, 3), contexts(2)
    every = [ids for length in range(4) for ids in product(NORMAL, repeat=length)]
    found = beam_search(step, {"context": context}, Limits(START, END, 3), len(every))
    for row, ranked in zip(context, found, strict=True):
        best = sorted(((log_probability(step, row, ids), ids) for ids in every), reverse=True)
        assert [h.ids for h in ranked] == [ids for _, ids in best]
        np.testing.assert_allclose([score for _, score, _ in ranked], [score for score, _ in best], atol=1e-5)


@pytest.mark.parametrize("beams", [1, 2, 5])
@pytest.mark.parametrize("sharpness", [0.1, 1.0, 3.0])
def test_as_the_naive_search_of_each_row(beams: int, sharpness: float) -> None:
    step, context = word_step(5, WORDS, 3, sharpness), contexts(8)
    together = beam_search(step, {"context": context}, LIMITS, beams)
    for row, found in zip(context, together, strict=True):
        wanted = naive(step, row, beams, 6)
        assert [h.ids for h in found] == [h.ids for h in wanted]
        np.testing.assert_allclose([h.score for h in found], [h.log_probability for h in wanted], atol=1e-5)
        assert beam_search(step, {"context": row[None]}, LIMITS, beams) == [found]


def test_scores_are_those_of_whole_sequences_also_at_the_longest() -> None:
    step, context = word_step(6, WORDS, 3, 0.01), contexts(3)  # ends are rare
    for row, found in zip(context, beam_search(step, {"context": context}, Limits(START, END, 3), 4), strict=True):
        assert {len(h.ids) for h in found} <= {0, 1, 2, 3}
        for ids, score, _ in found:
            assert score == pytest.approx(log_probability(step, row, ids), abs=1e-5)


def test_banned_words_never_come() -> None:
    step, context = word_step(4, WORDS, 3), contexts(4)
    for row in beam_search(step, {"context": context}, Limits(START, END, 4, [0, 3]), 20):
        assert row
        assert all(set(h.ids) <= {2, 4} for h in row)


def test_there_may_be_fewer_sequences_than_beams() -> None:
    step = word_step(4, WORDS, 3)
    assert [h.ids for h in beam_search(step, {"context": contexts(1)}, Limits(START, END, 0), 5)[0]] == [()]
    assert len(beam_search(step, {"context": contexts(1)}, Limits(START, END, 1), 50)[0]) == WORDS


@pytest.mark.parametrize(("search", "settings"), [(beam_search, (5,)), (draw_sequences, (20, 1.0))])
def test_one_call_for_each_step_of_the_whole_batch_and_none_for_no_rows(search: Any, settings: tuple[float]) -> None:
    step = word_step(6, WORDS, 3, 0.01)
    search(step, {"context": contexts(9)}, Limits(START, END, 4), *settings)
    assert step.calls == 5
    assert search(step, {"context": contexts(0)}, LIMITS, *settings) == []
    assert step.calls == 5


def naive_draws(
    step: FakeGraph, context: Array, draws: int, temperature: float, limits: Limits
) -> list[tuple[int, ...]]:
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


@pytest.mark.parametrize("draws", [1, 2, 30])
@pytest.mark.parametrize("temperature", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("banned", [(), (0, 3)])
def test_draws_are_those_of_each_row_alone(draws: int, temperature: float, banned: tuple[int, ...]) -> None:
    step, context = word_step(5, WORDS, 3, 0.5), contexts(6)
    limits = LIMITS._replace(banned=banned)
    together = draw_sequences(step, {"context": context}, limits, draws, temperature)
    for row, found in zip(context, together, strict=True):
        assert {d.ids: d.times for d in found} == Counter(naive_draws(step, row, draws, temperature, limits))
        assert [d.log_probability for d in found] == pytest.approx(
            [log_probability(step, row, d.ids) for d in found], abs=1e-5
        )
        assert draw_sequences(step, {"context": row[None]}, limits, draws, temperature) == [found]


def test_sequences_come_as_often_as_they_are_probable() -> None:
    step, context = word_step(6, WORDS, 3, 0.3), contexts(1)
    (found,) = draw_sequences(step, {"context": context}, Limits(START, END, 2), 20000, 1.0)
    came = {d.ids: d.times / 20000 for d in found}
    for ids in ((), *product(NORMAL, repeat=1)):
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
