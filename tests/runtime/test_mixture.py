from collections.abc import Sequence

import numpy as np
import pytest
from fake_models import STATE, FakeGraph, frame_step, log_likelihood
from numpy.typing import NDArray

from motet.decode.loop import Sample
from motet.papers.mixture import draw, log_density, mixture_search

pytestmark = pytest.mark.numeric

SIZE, CONTEXT = 3, 4


def contexts(rows: int) -> NDArray[np.float32]:
    return np.random.default_rng(7).normal(size=(rows, CONTEXT)).astype(np.float32)


def naive(
    step: FakeGraph, context: NDArray[np.float32], seed: int, width: int, candidates: int, heat: float, longest: int
) -> list[Sample]:
    """One row, one hypothesis and one candidate at a time."""
    rng = np.random.Generator(np.random.PCG64(seed))
    empty = np.zeros((0, SIZE), np.float32)
    beam = [(empty, 0.0, np.zeros((1, STATE), np.float32), False)] * width
    for length in range(longest + 1):
        if all(ended for *_, ended in beam):
            break
        normal = rng.standard_normal((width, candidates, SIZE), np.float32)
        uniform = rng.random((width, candidates, 2), np.float32)
        pool = []
        for slot, (frames, score, state, ended) in enumerate(beam):
            if ended:
                pool.append((frames, score, state, True))
                continue
            last = np.append(frames[-1], 1) if length else np.ones(SIZE + 1)
            out = step({"frame": last[None].astype(np.float32), "context": context[None], "state": state})
            weights = np.exp(out["log_weights"][0])
            for i in range(candidates):
                k = np.searchsorted(np.cumsum(weights / weights.sum()), uniform[slot, i, 0], side="right")
                x = out["means"][0, k] + np.sqrt(heat) * out["stds"][0, k] * normal[slot, i]
                goes_on = length == 0 or (length < longest and uniform[slot, i, 1] < out["active"][0])
                if not goes_on and any(ended and frames is other for other, _, _, ended in pool):
                    continue  # it has drawn its end already
                total = score + log_likelihood(np.append(x, goes_on), out, 0)
                longer = np.concatenate([frames, [x]]).astype(np.float32) if goes_on else frames
                pool.append((longer, total, out["next_state"], not goes_on))
        beam = sorted(pool, key=lambda h: -h[1] / len(h[0]))[:width]
    return [Sample(frames, score) for frames, score, _, _ in beam]


def search(
    step: FakeGraph,
    context: NDArray[np.float32],
    seeds: Sequence[int],
    width: int,
    candidates: int,
    heat: float,
    longest: int,
) -> list[list[Sample]]:
    noise = [np.random.Generator(np.random.PCG64(seed)) for seed in seeds]
    return mixture_search(step, context, noise, longest, width, candidates, heat)


@pytest.mark.parametrize(("width", "candidates", "heat"), [(1, 1, 1.0), (4, 1, 1.0), (3, 4, 1.0), (5, 2, 0.3)])
def test_as_the_naive_search_of_each_row(width: int, candidates: int, heat: float) -> None:
    step, context, seeds = frame_step(2, SIZE, CONTEXT), contexts(6), [3, 1, 4, 1, 5, 9]
    together = search(step, context, seeds, width, candidates, heat, 12)
    for row, seed, found in zip(context, seeds, together, strict=True):
        wanted = naive(step, row, seed, width, candidates, heat, 12)
        assert [len(s.frames) for s in found] == [len(s.frames) for s in wanted]
        for one, other in zip(found, wanted, strict=True):
            np.testing.assert_allclose(one.frames, other.frames, atol=1e-4)
            assert one.log_likelihood == pytest.approx(other.log_likelihood, abs=1e-3)


def test_one_candidate_gives_independent_samples_of_the_mixture() -> None:
    """Against the mixture's own moments and the flag's probability, over many hypotheses."""
    step, context = frame_step(2, SIZE, CONTEXT, stop=0.5), contexts(1)
    samples = search(step, context, [0], 20_000, 1, 1.0, 2)[0]
    zeros = np.zeros((1, STATE), np.float32)
    out = step({"frame": np.ones((1, SIZE + 1), np.float32), "context": context, "state": zeros})
    weights, means, stds = np.exp(out["log_weights"][0])[:, None], out["means"][0], out["stds"][0]
    mean = (weights * means).sum(axis=0)
    variance = (weights * (stds**2 + means**2)).sum(axis=0) - mean**2
    first = np.stack([sample.frames[0] for sample in samples])
    np.testing.assert_allclose(first.mean(axis=0), mean, atol=0.05)
    np.testing.assert_allclose(first.var(axis=0), variance, rtol=0.05)
    frames = np.column_stack([first, np.ones(len(first))]).astype(np.float32)
    repeated = {"context": context.repeat(len(first), 0), "state": out["next_state"].repeat(len(first), 0)}
    expected = step({"frame": frames, **repeated})["active"].mean()
    assert np.mean([len(sample.frames) == 2 for sample in samples]) == pytest.approx(expected, abs=0.01)


def test_temperature_scales_variance_and_leaves_the_components() -> None:
    rows = np.ones((50_000, 1), np.float32)
    outputs = {
        "log_weights": rows * np.log([0.8, 0.2], dtype=np.float32),
        "means": rows[:, :, None] * np.float32([[10.0], [-10.0]]),
        "stds": rows[:, :, None] * np.ones((2, 1), np.float32),
        "active": rows[:, 0] * np.float32(0.5),
    }
    rng = np.random.default_rng(0)
    normal = rng.standard_normal((len(rows), 1, 1), np.float32)
    uniform = rng.random((len(rows), 1, 2), np.float32)
    for temperature in (0.25, 1.0, 4.0):
        frames, flags, _ = draw(outputs, normal, uniform, temperature, None)
        high = frames[:, 0, 0] > 0
        assert frames[high, 0, 0].std() == pytest.approx(np.sqrt(temperature), rel=0.03)
        assert high.mean() == pytest.approx(0.8, abs=0.01)
        assert flags.mean() == pytest.approx(0.5, abs=0.01)


def test_log_density_survives_where_the_density_itself_underflows() -> None:
    rng = np.random.default_rng(1)
    frames, means = rng.normal(size=(4, 2, 62)) * 30, rng.normal(size=(4, 5, 62))
    stds = np.exp(rng.normal(size=(4, 5, 62)))
    weights = rng.dirichlet(np.ones(5), size=4)
    found = log_density(*(a.astype(np.float32) for a in (frames, np.log(weights), means, stds)))
    for n in range(4):
        for c in range(2):
            z = (frames[n, c] - means[n]) / stds[n]
            terms = np.log(weights[n]) - (0.5 * z**2 + np.log(stds[n]) + 0.5 * np.log(2 * np.pi)).sum(axis=1)
            assert found[n, c] == pytest.approx(np.logaddexp.reduce(terms), rel=1e-5)
    assert (found < -1000).all()


def test_motions_are_neither_empty_nor_longer_than_allowed() -> None:
    context = contexts(4)
    for stop, length in ((50.0, 1), (-50.0, 7)):
        step = frame_step(2, SIZE, CONTEXT, stop=stop)
        for row in search(step, context, range(4), 3, 2, 1.0, 7):
            assert [len(sample.frames) for sample in row] == [length] * 3
            assert all(np.isfinite(sample.log_likelihood) for sample in row)
