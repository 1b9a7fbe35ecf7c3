"""Known motions that answer: kinds are summed, ways are measured, and what is far away gets no answer."""

from dataclasses import replace

import numpy as np
import pytest
from fake_models import CONTRACT, FakeGraph, describe_model, moving, spec

from motet.errors import BundleError, DecodingError
from motet.models.describe import DescribeModel
from motet.models.nearest_neighbour import GOES_RIGHT, NOTHING, AnswerSettings, Known, Seen, path_of
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS

pytestmark = pytest.mark.numeric

WALK, RUN, SIT = np.eye(3, dtype=np.float32)
SENTENCES = ("he strolls", "a person walks", "she walks and turns left", "he runs straight ahead", "somebody sits")
KNOWN = Known(
    vectors=(np.array([[WALK], [WALK + 0.1 * RUN], [RUN], [SIT]]) * 127).astype(np.int8),
    actions=np.array([0, 1, 2, 3], np.int16),
    shown=np.array([[2, 0, 0], [2, 0, 0], [1, 2, 0], [0, 0, 2]], np.uint8),
    sentences=SENTENCES,
    sentence_actions=np.array([0, 1, 1, 2, 3], np.int16),
    names=np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.uint8),
    ways=np.array([[0, 0, 1], [0, 0, 1], [1, 0, 1], [2, 0, 1], [0, 0, 0]], np.int16),
    settings=AnswerSettings(near=4, outside=0.2),
)
TABLES = {
    "known_vectors": KNOWN.vectors,
    "known_actions": KNOWN.actions,
    "known_shown": KNOWN.shown,
    "known_sentences": np.frombuffer("\n".join(SENTENCES).encode(), np.uint8),
    "known_said": KNOWN.sentence_actions,
    "known_names": KNOWN.names,
    "known_ways": KNOWN.ways,
}


def said(
    vector: np.ndarray, turn: float | None = None, seconds: float = 3.0, count: int = 1, ahead: float = 0.0
) -> list[str]:
    (row,) = KNOWN.answers([Seen(vector.astype(np.float32), seconds, turn, ahead)], count)
    return [answer.text for answer in row]


def test_wordings_of_one_kind_count_together() -> None:
    between = (0.72 * RUN + 0.7 * WALK).astype(np.float32)  # nearest to the run, but two walks are near, too
    counted, alike = replace(KNOWN, settings=AnswerSettings(near=4, temperature=0.3)).near(between[None])
    np.testing.assert_allclose(counted.sum(axis=1), 1)
    weights = np.exp([0.7 / 0.3, (0.7 + 0.072) / 0.3, 0.72 / 0.3, 0])
    np.testing.assert_allclose(counted[0], weights / weights.sum(), rtol=0.06)  # bytes are coarse
    assert alike[0] == pytest.approx(0.77, abs=0.01)
    assert KNOWN.shares(counted)[0].max() == pytest.approx(counted[0, :2].sum())  # that somebody walks


def test_the_likeliest_kinds_come_first_each_once() -> None:
    assert said(WALK)[0] in SENTENCES[:3]
    texts = said(WALK + 0.9 * RUN, count=9)
    assert len(texts) == 3
    assert texts[-1] == "somebody sits"


def test_turns_are_measured_and_told() -> None:
    assert said(WALK, 90) == ["she walks and turns left"]
    assert said(WALK, -90)[0].endswith(", turning right")
    assert said(WALK, 5) != ["she walks and turns left"]
    assert said(RUN, 100) == ["he runs straight ahead, turning left"]
    assert said(SIT, 100) == ["somebody sits"]


def test_between_straight_and_turned_the_other_side_is_not_told() -> None:
    ways = KNOWN.ways.copy()
    ways[0, 0] = GOES_RIGHT
    known = replace(KNOWN, ways=ways)
    texts = {}
    for turn in (-35.0, 35.0):
        ((answer,),) = known.answers([Seen(WALK, 3.0, turn, 0.0)])
        texts[turn] = answer.text
    assert texts == {-35.0: "he strolls", 35.0: "a person walks"}


def test_who_goes_backwards_is_told_to() -> None:
    assert said(WALK, ahead=-0.3)[0].endswith(", backwards")
    assert said(WALK, -90, ahead=-0.3)[0].endswith(", backwards, turning right")
    assert not said(WALK, ahead=-0.1)[0].endswith("backwards")
    assert said(SIT, ahead=-0.3) == ["somebody sits"]
    told = replace(KNOWN, sentences=("he retreats", "a person walks backwards", *SENTENCES[2:]))
    (row,) = told.answers([Seen(WALK, 3.0, 0.0, -0.3)])
    assert row[0].text in told.sentences[:2]


def test_what_is_short_or_far_gets_no_answer() -> None:
    assert said(WALK, seconds=0.4) == [NOTHING]
    assert said(-WALK - RUN - SIT) == [NOTHING]


def test_the_probability_is_a_logistic_function() -> None:
    found = replace(KNOWN, settings=AnswerSettings(bias=0.5, share=2.0)).probability(np.array([0.8]))
    score = 0.5 + 2 * np.log(0.8 / 0.2)
    assert found[0] == pytest.approx(1 / (1 + np.exp(-score)))


def test_the_turn_and_the_speed_of_a_path() -> None:
    contract = MotionContract("root_angles", ROOT_BLOCK, ROOT_BLOCK_UNITS, 10.0, np.zeros(6), np.ones(6), None)
    frames = np.zeros((21, 6))
    frames[:, 2] = np.radians(45.0) if ROOT_BLOCK_UNITS[2].startswith("rad") else 45.0
    frames[1:, 0] = np.linspace(-0.6, 0.2, 20)
    assert path_of(frames, contract) == (pytest.approx(90.0), pytest.approx(-0.2))
    assert path_of(frames[:1], contract) == (0.0, 0.0)
    frames[3, 4] = np.radians(80.0) if ROOT_BLOCK_UNITS[4].startswith("rad") else 80.0
    assert path_of(frames, contract) == (None, 0.0)
    assert path_of(frames[:, :3], CONTRACT) == (None, 0.0)


def knowing(**tables: np.ndarray) -> DescribeModel:
    """A model whose space is the mean of its channels."""

    def space(frames: np.ndarray, lengths: np.ndarray) -> tuple[np.ndarray]:
        mean = np.stack([row[:length].mean(axis=0) for row, length in zip(frames, lengths, strict=True)])
        return (mean / np.linalg.norm(mean, axis=1, keepdims=True),)

    base = describe_model()
    inputs = {"frames": "batch time D", "lengths": "*batch"}
    graph = FakeGraph(spec(inputs, {"vector": "batch E"}, {"D": 3, "E": 3}), space)
    return DescribeModel(base.manifest, {**base.graphs, "space": graph}, {**TABLES, **tables})


def test_a_model_with_known_motions_answers_by_them() -> None:
    model, motions = knowing(), [moving(length, seed=length) for length in (20, 12, 30)]
    rows = model.describe(motions, beams=2)
    for motion, row in zip(motions, rows, strict=True):
        assert [one.text for one in model.describe(motion, beams=2)] == [one.text for one in row]
        assert all(one.probability == pytest.approx(one.score, abs=1e-5) for one in row)
        assert row[0].to_json()["probability"] == pytest.approx(row[0].score, abs=1e-5)
    assert {one.text for one in model.describe(motions[0], decoding="beam")}.isdisjoint(SENTENCES)
    assert len(model.describe(motions[0], draws=7)) > 0
    parts = model.timeline(motions[2])
    assert (parts[0].start, parts[-1].stop) == (0, pytest.approx(motions[2].duration, abs=0.11))
    assert model.describe(moving(3))[0].text == NOTHING


def test_known_motions_are_asked_for_only_where_there_are_some() -> None:
    with pytest.raises(DecodingError, match="one of beam, consensus, not 'known'"):
        describe_model().describe(moving(20), decoding="known")
    with pytest.raises(DecodingError, match="without draws"):
        knowing().describe(moving(20), draws=3, decoding="known")


@pytest.mark.parametrize(
    ("table", "wrong", "reason"),
    [
        ("known_said", np.array([0, 1, 1, 2, 9], np.int16), "none of 4 actions"),
        ("known_actions", np.array([0, -1, 2, 3], np.int16), "none of 4 actions"),
        ("known_sentences", np.frombuffer(b"one\ntwo", np.uint8), "2 lines, expected 5"),
        ("known_vectors", KNOWN.vectors[:3], "known_actions"),
    ],
)
def test_tables_that_do_not_fit(table: str, wrong: np.ndarray, reason: str) -> None:
    with pytest.raises(BundleError, match=reason):
        knowing(**{table: wrong})
