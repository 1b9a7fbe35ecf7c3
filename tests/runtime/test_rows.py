"""The shipped models: whatever else is asked at the same time, everyone gets, to the bit, what they get alone."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from motet.decode.loop import advance
from motet.formats import read_motion
from motet.models.load import load
from motet.motion.motion import Motion

SENTENCES = ["a person walks", "a person runs and turns left", "someone jogs", "a person walks slowly to the right"]


@pytest.fixture(scope="module")
def motions(clips: Path) -> list[Motion]:
    """Pieces of the three trials, of different lengths."""
    trials = [read_motion(clips / name) for name in ("39_14.amc", "09_07.amc", "02_06.amc")]
    return [trial[start : start + 150 + 40 * i] for i, trial in enumerate(trials) for start in (0, 40)]


def check_equal(together: Sequence[NDArray[np.float32]], alone: Sequence[NDArray[np.float32]]) -> None:
    assert len(together) == len(alone) > 1
    for row, single in zip(together, alone, strict=True):
        np.testing.assert_array_equal(row, single)


@pytest.mark.parametrize("draws", [None, 30])
def test_descriptions(motions: list[Motion], draws: int | None) -> None:
    model = load("describe")
    assert model.describe(motions, draws=draws) == [model.describe([one], draws=draws)[0] for one in motions]


def test_contexts(motions: list[Motion]) -> None:
    model, generator = load("describe"), load("generate")
    check_equal(model.embed(motions), [model.embed([one])[0] for one in motions])
    check_equal(generator.embed(SENTENCES), [generator.embed([one])[0] for one in SENTENCES])


@pytest.mark.parametrize("count", [3, 13])
def test_vectors(count: int) -> None:
    model = load("search")
    contract = model.contract
    rng = np.random.default_rng(2)
    walks = contract.mean + contract.std * 0.05 * rng.normal(size=(count, 40, len(contract.channels))).cumsum(axis=1)
    motions = [contract.motion(walk) for walk in walks]
    check_equal(model.embed(motions), [model.embed(motion) for motion in motions])


@pytest.mark.parametrize("name", ["generate", "language-to-motion"])
def test_generated_motions(name: str) -> None:
    model = load(name)
    together = model.generate(SENTENCES, 3, seed=[5, 6, 7, 8], max_seconds=4)
    alone = [model.generate([one], 3, seed=[seed], max_seconds=4)[0] for seed, one in enumerate(SENTENCES, start=5)]
    for row, single in zip(together, alone, strict=True):
        assert [found.log_likelihood for found in row] == [found.log_likelihood for found in single]
        check_equal([found.motion.values for found in row], [found.motion.values for found in single])


def test_predicted_frames() -> None:
    model = load("predict")
    contract = model.contract
    rng = np.random.default_rng(0)
    seeds = contract.mean + contract.std * 0.3 * rng.normal(size=(5, model.seed_frames, len(contract.channels)))
    count = model.horizon + 5
    found = model.next_frames(seeds, count)
    check_equal(found, [model.next_frames(one[None], count)[0] for one in seeds])
    # the step hands out, one by one, what the loop takes at once
    state = {"trajectory": model.graphs["encoder"]({"frames": seeds.astype(np.float32)})["trajectory"]}
    for frame in found[:, : model.horizon].swapaxes(0, 1):
        given, state = advance(model.graphs["step"], state, {})
        np.testing.assert_array_equal(given["frame"], frame)


def test_expected_errors() -> None:
    model = load("predict")
    contract = model.contract
    rng = np.random.default_rng(1)
    walks = contract.mean + contract.std * 0.05 * rng.normal(size=(5, 30, len(contract.channels))).cumsum(axis=1)
    motions = [contract.motion(walk) for walk in walks]
    check_equal(model.expected_errors(motions), [model.expected_errors(motion) for motion in motions])


@pytest.mark.parametrize("variety", [0.0, 1.0])
def test_controlled_characters(variety: float) -> None:
    model = load("tdbn")
    track = np.random.default_rng(0).uniform(size=(30, 4, len(model.labels)))
    together = model.start("walk", characters=4, seed=3, variety=variety).frames(track)
    alone = [
        model.start("walk", characters=1, seed=3 + row, variety=variety).frames(track[:, [row]])[0] for row in range(4)
    ]
    check_equal(together, alone)
