from itertools import product

import numpy as np
import pytest
from fake_models import STATE, FakeGraph, word_step
from numpy.typing import NDArray

from motet.decode.beam import Hypothesis, Limits, beam_search

pytestmark = pytest.mark.numeric

START, END, WORDS = 0, 1, 5


def contexts(rows: int) -> NDArray[np.float32]:
    return np.random.default_rng(7).normal(size=(rows, 3)).astype(np.float32)


def log_probability(step: FakeGraph, context: NDArray[np.float32], ids: tuple[int, ...]) -> float:
    """Of a whole sequence, step by step."""
    state, total = np.zeros((1, STATE), np.float32), 0.0
    for word, following in zip((START, *ids), (*ids, END), strict=True):
        out = step({"word": np.array([word]), "context": context[None], "state": state})
        total, state = total + float(out["log_probabilities"][0, following]), out["next_state"]
    return total


def naive(step: FakeGraph, context: NDArray[np.float32], beams: int, longest: int) -> list[Hypothesis]:
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
    normal = [word for word in range(WORDS) if word != END]
    every = [ids for length in range(4) for ids in product(normal, repeat=length)]
    found = beam_search(step, {"context": context}, Limits(START, END, 3), len(every))
    for row, ranked in zip(context, found, strict=True):
        best = sorted(((log_probability(step, row, ids), ids) for ids in every), reverse=True)
        assert [h.ids for h in ranked] == [ids for _, ids in best]
        np.testing.assert_allclose([score for _, score, _ in ranked], [score for score, _ in best], atol=1e-5)


@pytest.mark.parametrize("beams", [1, 2, 5])
@pytest.mark.parametrize("sharpness", [0.1, 1.0, 3.0])
def test_as_the_naive_search_of_each_row(beams: int, sharpness: float) -> None:
    step, context = word_step(5, WORDS, 3, sharpness), contexts(8)
    together = beam_search(step, {"context": context}, Limits(START, END, 6), beams)
    for row, found in zip(context, together, strict=True):
        wanted = naive(step, row, beams, 6)
        assert [h.ids for h in found] == [h.ids for h in wanted]
        np.testing.assert_allclose([h.score for h in found], [h.log_probability for h in wanted], atol=1e-5)
        assert beam_search(step, {"context": row[None]}, Limits(START, END, 6), beams) == [found]


def test_scores_are_those_of_whole_sequences_also_at_the_longest() -> None:
    step, context = word_step(6, WORDS, 3, 0.01), contexts(3)  # ends are rare
    for row, found in zip(context, beam_search(step, {"context": context}, Limits(START, END, 3), 4), strict=True):
        assert {len(h.ids) for h in found} <= {0, 1, 2, 3}
        for ids, score, _ in found:
            assert score == pytest.approx(log_probability(step, row, ids), abs=1e-5)


def test_one_call_for_each_step_of_the_whole_batch() -> None:
    step = word_step(6, WORDS, 3, 0.01)
    beam_search(step, {"context": contexts(9)}, Limits(START, END, 4), 5)
    assert step.calls == 5


def test_banned_words_never_come() -> None:
    step, context = word_step(4, WORDS, 3), contexts(4)
    for row in beam_search(step, {"context": context}, Limits(START, END, 4, [0, 3]), 20):
        assert row
        assert all(set(h.ids) <= {2, 4} for h in row)


def test_fewer_sequences_than_beams_and_no_rows() -> None:
    step = word_step(4, WORDS, 3)
    assert [h.ids for h in beam_search(step, {"context": contexts(1)}, Limits(START, END, 0), 5)[0]] == [()]
    assert len(beam_search(step, {"context": contexts(1)}, Limits(START, END, 1), 50)[0]) == WORDS
    assert beam_search(step, {"context": contexts(0)}, Limits(START, END, 3), 5) == []
