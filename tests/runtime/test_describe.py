from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_models import CHANNELS, CONTRACT, VOCABULARY, FakeGraph, describe_model, moving

from motet.bench.cases import CASE_WORDS, cases
from motet.errors import BundleError, DecodingError, MotionError, TextError, TextWarning
from motet.formats import write_motion
from motet.models.describe import DescribeModel, Description
from motet.models.language import padded


@pytest.fixture(scope="module")
def model() -> DescribeModel:
    return describe_model()


def test_hypotheses_are_ranked_and_scored(model: DescribeModel) -> None:
    motion = moving(20)
    row = model.describe(motion)
    assert [type(d) for d in row] == [Description] * 5
    scores = [d.log_probability for d in row]
    assert scores == sorted(scores, reverse=True)
    assert scores == [d.score for d in row]
    for description in row:
        if description.text:
            assert model.score(motion, description.text) == pytest.approx(description.log_probability, abs=1e-4)


def test_more_motions_than_fit_one_batch_come_back_in_order(
    model: DescribeModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    motions = [moving(3 + i % 7, seed=i) for i in range(11)]
    whole, vectors = model.describe(motions), model.embed(motions)
    monkeypatch.setattr(model, "loop", replace(model.loop, batch=4))
    assert [[d.text for d in row] for row in model.describe(motions)] == [[d.text for d in row] for row in whole]
    np.testing.assert_allclose(model.embed(motions), vectors, atol=1e-5)


def test_context_vectors(model: DescribeModel) -> None:
    motions = [moving(9, seed=1), moving(4, seed=2)]
    wanted = [(model.frames(m) - CONTRACT.mean).mean(axis=0) / [0.5, 10, 1] for m in motions]
    found = model.embed(motions)
    assert (found.dtype, found.shape) == (np.float32, (2, 3))
    np.testing.assert_allclose(found, wanted, atol=1e-5)
    assert model.embed(motions[0]).shape == (3,)
    np.testing.assert_array_equal(model.embed(motions[0]), found[0])


def test_channels_in_another_order_and_unit_and_rate_are_the_same_motion(model: DescribeModel) -> None:
    motion = moving(31)
    frames = model.frames(motion)
    np.testing.assert_allclose(frames[:, 1], np.degrees(motion.values[:, 3]))
    assert frames.shape == (31, len(CHANNELS))
    ordered = motion.select(CHANNELS)
    np.testing.assert_array_equal(model.frames(ordered), frames)
    fast = ordered.resample(40)
    np.testing.assert_allclose(model.frames(fast), frames, atol=1e-9)
    assert model.describe(fast)[0].text == model.describe(motion)[0].text


def test_a_motion_that_does_not_fit(model: DescribeModel) -> None:
    motion = moving(20)
    lacking = motion.select(("knee.ry", "knee.rz"))
    for bad, reason in (
        (lacking, r"lacks 2 of 3 channels: hips.ty, knee.rx"),
        (motion[:1], "needs two frames at 10 fps, but the motion has 1"),
        (motion[:0], "has 0"),
        (replace(motion, fps=200.0), "two frames at 10 fps"),
        (moving(301), r"lasts 30.1 s, but the model takes at most 30 s"),
        (replace(motion, units=("m", "deg", "m", "rad")), "does not convert"),
    ):
        with pytest.raises(MotionError, match=reason):
            model.describe([motion, bad])
    assert model.describe(moving(300))


def test_a_long_motion_goes_in_windows(model: DescribeModel) -> None:
    long = moving(901)  # 90.1 s
    windows = model.windows(long)
    assert [start for start, _ in windows] == [0.0, 22.5, 45.0, 67.6]
    np.testing.assert_array_equal(np.concatenate([part.values for _, part in windows]), long.values)
    assert max(part.duration for _, part in windows) <= 30
    assert len(model.describe([part for _, part in windows])) == 4
    ((start, whole),) = model.windows(moving(300))
    assert (start, len(whole)) == (0.0, 300)
    assert len(model.windows(moving(0))) == 1


@pytest.mark.parametrize(("frames", "fps"), [(2877, 23.976), (8991, 29.97)])
def test_windows_hold_whole_frames_of_no_more_than_the_model_takes(
    model: DescribeModel, frames: int, fps: float
) -> None:
    windows = model.windows(moving(frames, fps=fps))
    assert sum(len(part) for _, part in windows) == frames
    for _, part in windows:
        model.frames(part)


def test_what_the_model_sees_is_prepared_once(model: DescribeModel) -> None:
    motion = moving(47, fps=25.0)
    np.testing.assert_array_equal(model.frames(model.prepared(motion)), model.frames(motion))


def drawing(temperature: float) -> DescribeModel:
    """The model with 30 draws as its default; it is sharp, so that only hot draws differ."""
    model = describe_model()
    defaults = {**model.defaults, "draws": 30, "temperature": temperature}
    return DescribeModel(replace(model.manifest, loop="consensus", defaults=defaults), model.graphs)


def test_a_motion_is_described_by_draws_as_it_is_alone_and_every_time() -> None:
    model = drawing(6.0)
    motions = [moving(3 + i % 7, seed=i) for i in range(21)]  # more than are drawn for at once
    together = model.describe(motions, beams=4)
    for motion, row in zip(motions, together, strict=True):
        assert len({found.text for found in row}) == len(row) == 4
        assert 1 >= row[0].score >= row[1].score >= row[3].score >= 0
        alone = model.describe(motion, beams=4)
        assert [found.text for found in alone] == [found.text for found in row]
        for found in row:
            if found.text:
                assert model.score(motion, found.text) == pytest.approx(found.log_probability, abs=1e-4)
    assert model.describe([]) == []


def test_the_bundle_says_how_hypotheses_are_ranked(model: DescribeModel) -> None:
    motion, searched = moving(20), model.describe(moving(20))
    cold, hot = drawing(1.0), drawing(6.0)
    assert searched == model.describe(motion, decoding="beam") == hot.describe(motion, decoding="beam")
    assert cold.describe(motion) == model.describe(motion, draws=30)  # without a default the temperature is 1
    assert hot.describe(motion) not in (searched, cold.describe(motion))
    assert model.describe(motion, decoding="consensus") == model.describe(motion, draws=100)
    with pytest.raises(DecodingError, match="no setting 'draws'"):
        model.describe(motion, draws=30, decoding="beam")
    with pytest.raises(DecodingError, match="decoding must be one of beam, consensus, not 'greedy'"):
        model.describe(motion, decoding="greedy")  # type: ignore[call-overload]


def test_draws_are_of_their_seed() -> None:
    model = drawing(6.0)
    motions = [moving(20), moving(9)]
    other = model.describe(motions, seed=1)
    assert other == [model.describe(motion, seed=np.int64(1)) for motion in motions] != model.describe(motions)
    assert model.describe(motions, seed=0) == model.describe(motions)
    with pytest.raises(DecodingError, match="seed of 0 or more"):
        model.describe(motions, seed=-1)


@pytest.mark.parametrize(
    ("setting", "value", "most"),
    [*(("draws", value, 1000) for value in (-1, 0, 1001)), *(("beams", value, 100) for value in (-1, 0, 101))],
)
def test_settings_out_of_range(model: DescribeModel, setting: str, value: int, most: int) -> None:
    with pytest.raises(DecodingError, match=f"{setting} must be between 1 and {most}, not {value}"):
        model.describe(moving(20), **{setting: value})


def test_scored_sentences(model: DescribeModel) -> None:
    motion = moving(20)
    assert model.score(motion, "A person walks.") == model.score(motion, "a PERSON walks!")
    assert model.score(motion, "a person walks") > model.score(motion, "a person walks a person walks")
    with pytest.warns(TextWarning, match=r"does not know zebra \(in 'a zebra walks'\)"):
        assert np.isfinite(model.score(motion, "a zebra walks"))
    with pytest.raises(TextError, match="has no words"):
        model.score(motion, "")


def test_the_model_holds_no_state(model: DescribeModel) -> None:
    before = dict(vars(model))
    first = model.describe(moving(20))
    model.describe([moving(9), moving(11)], beams=2)
    assert model.describe(moving(20)) == first
    assert vars(model) == before


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"vocabulary": ("a",)}, "manifest, vocabulary: a vocabulary starts with PAD"),
        ({"vocabulary": (*VOCABULARY.words, "more")}, r"graphs.step: 'log_probabilities' is float32 \['batch', 10\]"),
        ({"text": None}, "manifest, text: is missing"),
        ({"text": {"rules": 2}}, "manifest, text.rules: must be a whole number between 1 and 1, not 2"),
        ({"defaults": {"beams": 5}}, "manifest, defaults.max_words: is missing"),
        (
            {"defaults": {"beams": 5, "max_words": "x"}},
            "defaults.max_words must be between 1 and 1000, not x",
        ),
        ({"defaults": {"beams": 2.5, "max_words": 5}}, "beams must be a whole number, not 2.5"),
        ({"loop": "mixture"}, "manifest, loop: 'mixture' does not describe; expected one of beam, consensus"),
        ({"verb": "generate"}, "manifest, verb: 'generate', expected 'describe'"),
    ],
)
def test_a_manifest_that_does_not_fit(model: DescribeModel, change: dict[str, Any], reason: str) -> None:
    with pytest.raises(BundleError, match=reason):
        DescribeModel(replace(model.manifest, **change), model.graphs)


def test_padding() -> None:
    values, lengths = padded([np.ones((2, 3)), np.ones((1, 3))], "float32")
    assert (values.shape, values.dtype, lengths.tolist()) == ((2, 2, 3), np.float32, [2, 1])
    assert (values[1, 1] == 0).all()


def test_the_benchmark_measures_sentences_of_one_length(tmp_path: Path) -> None:
    model = describe_model()
    write_motion(tmp_path / "a.npz", moving(20))
    found = cases(model, tmp_path / "a.npz")
    parts = ("descriptions", "descriptions", "one", "consensus", "encoder", "step", "file")
    assert [case.name for case in found] == [f"describe.{part}" for part in parts]
    assert [case.count for case in found] == [32, 128, 1, 1, 1, 1, 1]
    step = model.graphs["step"]
    assert isinstance(step, FakeGraph)
    for case, calls in zip(found, [CASE_WORDS + 1] * 4 + [0, 1], strict=False):
        step.calls = 0
        case.call()
        assert step.calls == calls, case.name
    assert found[-1].call() == model.describe(moving(20))
