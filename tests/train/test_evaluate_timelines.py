"""Joins and cuts, right and wrong, by hand."""

from typing import Any

import numpy as np
import pytest
from language_models import FRAMES, STORE, FakeDescribe, told

from motet.models.describe import ConfidenceSettings, Description, Part
from motet.motion.motion import Motion
from motet_train.evaluate.language.attributes import action_right
from motet_train.evaluate.language.confidence import ENOUGH, calibrated, confidence, joined, matched, timeline_figures
from motet_train.evaluate.language.split_store import SplitStore, split_as


@pytest.fixture(scope="module")
def corpus() -> SplitStore:
    return split_as(told(STORE, "describe"), STORE)


def test_a_join_is_found_by_one_cut_within_a_second() -> None:
    assert matched([4.0, 8.0], [4.9, 7.1]) == 2
    assert matched([4.0, 8.0], [4.5, 3.5, 9.1]) == 1
    assert matched([4.0, 5.0], [4.5]) == 1
    assert matched([4.0], []) == matched([], [4.0]) == 0


@pytest.mark.parametrize(
    ("text", "right"),
    [
        ("somebody walks off", True),
        ("somebody walks and waves", True),
        ("somebody walks and jumps", False),
        ("somebody stands there", False),
    ],
)
def test_an_action_is_right_if_somebody_named_it(text: str, right: bool) -> None:
    assert action_right(text, ["a person walks", "a person strolls", "a person waves while walking"]) is right


class Unsure(FakeDescribe):
    """Says of every other motion that somebody dances, which is wrong; how sure it is depends on that, but for one."""

    def describe(self, motions: Any, beams: int = 5) -> Any:
        logs = [0.0, -7.0, 0.0, -0.1, -6.0]
        rows = super().describe(motions, 1)
        texts = ["somebody dances" if i % 2 else row[0].text for i, row in enumerate(rows)]
        return [[Description(text, log, log, log > -5)] for text, log in zip(texts, logs, strict=True)]


def test_confidence_by_hand(corpus: SplitStore) -> None:
    model: Any = Unsure(STORE)
    found = confidence(model, corpus, corpus.parts.validation)
    assert found == pytest.approx(
        {
            **{"of": 5, "right": 3 / 5, "confident": 3 / 5, "right_if_confident": 2 / 3, "right_if_not": 1 / 2},
            **{"kept": 2 / 3, "auc": 5 / 6, "auc_word": 5 / 6},  # one right one loses to the wrong one that is sure
        }
    )


def test_the_limit_is_the_one_that_is_most_often_right() -> None:
    rng = np.random.default_rng(0)
    for count in (ENOUGH, 61):
        scores = rng.normal(-5, 2, count)
        right = scores + rng.normal(0, 2, count) > -5
        limit = calibrated(scores, right).log_probability
        told = [int(((scores >= other) == right).sum()) for other in (limit, *scores, 0.0)]
        assert told[0] == max(told)
    assert calibrated(np.linspace(-9, -1, ENOUGH), np.ones(ENOUGH, np.bool_)).log_probability < -9
    assert calibrated(np.linspace(-9, -1, ENOUGH), np.zeros(ENOUGH, np.bool_)).log_probability > -1
    assert calibrated(scores[: ENOUGH - 1], right[: ENOUGH - 1]) == ConfidenceSettings()


class Blind(FakeDescribe):
    """Says the same of all there is, and is not sure."""

    def timeline(self, motion: Motion) -> list[Part]:
        return [Part("somebody walks", -7.0, 0.0, False, 0.0, motion.duration)]


def test_timelines_of_a_model_that_sees_no_change(corpus: SplitStore) -> None:
    model: Any = Blind(STORE)
    found = timeline_figures(model, corpus, corpus.parts.validation)
    assert (found["joins_found"], found["parts"], found["time_confident"]) == (0, 1, 0)
    assert np.isnan([found["cuts_right"], found["time_right_if_confident"]]).all()
    assert 0.2 < found["time_right"] < 0.5  # walks are one of three actions, and never come twice in a row
    assert timeline_figures(model, corpus, corpus.parts.validation[:1]) == {}


def test_joined_motions_follow_each_other(corpus: SplitStore) -> None:
    motions = corpus.motions(corpus.parts.validation[:3])
    found = joined(motions)
    assert len(found) == 3 * FRAMES
    np.testing.assert_array_equal(found[FRAMES : 2 * FRAMES].values, motions[1].values)
