"""A small describe bundle whose step attends to the encoder's states, without torch: tests/export made it."""

from pathlib import Path

import numpy as np
import pytest

from motet.bundle.bundle import Bundle
from motet.models.describe import DescribeModel
from motet.models.load import load, verify
from motet.motion.motion import Motion

pytestmark = pytest.mark.numeric

PLACE = Path(__file__).parent / "attentive.zip"


@pytest.fixture(scope="module")
def model() -> DescribeModel:
    loaded = load(PLACE)
    assert isinstance(loaded, DescribeModel)
    return loaded


def motions(model: DescribeModel, lengths: tuple[int, ...]) -> list[Motion]:
    rng = np.random.default_rng(0)
    drawn = [rng.normal(size=(length, len(model.contract.channels))) for length in lengths]
    return [model.contract.features(steps.cumsum(axis=0)) for steps in drawn]


def test_it_computes_its_golden_vectors() -> None:
    assert max(verify(Bundle.open(PLACE)).errors.values()) < 1e-4


@pytest.mark.parametrize("draws", [None, 40])
def test_a_motion_gets_in_a_batch_what_it_gets_alone(model: DescribeModel, draws: int | None) -> None:
    rows = motions(model, (2, 300, 33, 17, 16, 15, 48, 33, 34, 5))
    together = model.describe(rows, 5, draws)
    assert len({row[0].text for row in together}) > 1
    for motion, row in zip(rows, together, strict=True):
        assert model.describe(motion, 5, draws) == row
    assert model.describe([], 5, draws) == []


def test_a_sentence_scores_what_the_beam_says(model: DescribeModel) -> None:
    (motion,) = motions(model, (40,))
    for description in model.describe(motion, beams=5):
        if description.text:
            assert model.score(motion, description.text) == pytest.approx(description.log_probability, abs=1e-4)


def test_a_timeline_of_a_net_that_attends(model: DescribeModel) -> None:
    (motion,) = motions(model, (130,))
    parts = model.timeline(motion)
    assert parts[0].start == 0
    assert parts[-1].stop == pytest.approx(13.0)
