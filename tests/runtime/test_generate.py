import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fake_models import CONTRACT, generate_model, moving
from figures import walker

from motet.bench.cases import CASE_SECONDS, cases
from motet.errors import DecodingError, MotionError, TextError, TextWarning
from motet.formats import read_motion
from motet.generate.base import Generated, GenerateModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.papers.mixture import Sample
from motet.representation.contract import MotionContract
from motet.representation.root_block import from_root_block, plant_feet, to_root_block


def contract_of(features: Motion) -> MotionContract:
    mean, std = features.values.mean(axis=0), np.ones(len(features.channels))
    return MotionContract("root_angles", features.channels, features.units, 10.0, mean, std, features.skeleton)


TEXTS = ["a person walks", "walks", "a person walks left 80"]


@pytest.fixture(scope="module")
def model() -> GenerateModel:
    return generate_model()


def assert_same(one: list[Generated], other: list[Generated]) -> None:
    assert [g.log_likelihood for g in one] == [g.log_likelihood for g in other]
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.motion.values, b.motion.values)


def test_motions_are_ranked_and_scored(model: GenerateModel) -> None:
    for row in model.generate(TEXTS, 4, candidates=3):
        rates = [g.log_likelihood / len(g.frames) for g in row]
        assert rates == sorted(rates, reverse=True)
        for generated in row:
            motion = generated.features
            assert (motion.channels, motion.fps, motion.skeleton is None) == (CONTRACT.channels, 10.0, False)
            assert 1 <= len(motion) <= 30


def test_the_log_likelihood_is_the_score_of_the_motion(model: GenerateModel) -> None:
    for text, row in zip(TEXTS, model.generate(TEXTS, 3, candidates=2, max_seconds=1), strict=True):
        for generated in row:
            if len(generated.frames) > 1:
                assert model.score(text, generated.features) == pytest.approx(generated.log_likelihood, abs=1e-3)


def test_more_sentences_than_fit_one_batch_come_back_in_order(
    model: GenerateModel, monkeypatch: pytest.MonkeyPatch
) -> None:
    texts = [TEXTS[i % 3] for i in range(7)]
    whole, vectors = model.generate(texts, seed=range(7)), model.embed(texts)
    monkeypatch.setattr(model, "loop", replace(model.loop, batch=2))
    for one, other in zip(model.generate(texts, seed=range(7)), whole, strict=True):
        assert_same(one, other)
    np.testing.assert_allclose(model.embed(texts), vectors, atol=1e-6)
    np.testing.assert_allclose(model.embed(texts[0]), vectors[0], atol=1e-6)


def test_settings_are_the_bundles_unless_given(model: GenerateModel) -> None:
    assert_same(
        model.generate("walks"),
        model.generate("walks", 3, candidates=4, temperature=1.0, max_seconds=3),
    )
    assert max(len(g.frames) for g in model.generate("walks", 20, max_seconds=0.5)) == 5
    cold, hot = (
        np.std([g.frames[0, 0] for g in model.generate("walks", 50, candidates=1, temperature=t)]) for t in (0.05, 1.0)
    )
    assert cold < 0.7 * hot


def test_unknown_words_are_named(model: GenerateModel) -> None:
    with pytest.warns(TextWarning, match="does not know zebra, backwards"):
        generated, *_ = model.generate("a zebra walks backwards")
    assert generated.unknown == ("zebra", "backwards")
    assert model.unknown("a person") == []
    with pytest.warns(TextWarning, match="zebra"):
        model.embed(["a zebra"])


@pytest.mark.parametrize(
    ("text", "reason"), [("", "no words"), ("zebra", "knows no word"), ("walks " * 41, "41 words, but at most 40")]
)
def test_a_sentence_that_cannot_be_moved(model: GenerateModel, text: str, reason: str) -> None:
    with pytest.raises(TextError, match=reason):
        model.generate(["a person walks", text])


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"hypotheses": 0}, "hypotheses must be between 1 and 100"),
        ({"candidates": 0}, "candidates must be between 1 and 100"),
        ({"temperature": 0.0}, r"temperature must be between 0.01 and 100, not 0.0"),
        ({"temperature": float("nan")}, "not nan"),
        ({"max_seconds": 0}, "max_seconds must be between 0.01 and 600"),
        ({"seed": -1}, "seed of 0 or more"),
        ({"seed": 1.5}, "not 1.5"),
        ({"seed": [1, 2]}, "one for each of 1"),
    ],
)
def test_settings_out_of_range(model: GenerateModel, settings: dict[str, float], reason: str) -> None:
    with pytest.raises(DecodingError, match=reason):
        model.generate("walks", **settings)


def test_a_motion_to_score_must_fit(model: GenerateModel) -> None:
    with pytest.raises(MotionError, match=r"lacks 1 of 3 channels: hips.ty"):
        model.score("walks", moving(20).select(("knee.rx", "knee.ry")))
    with pytest.raises(MotionError, match="two frames"):
        model.score("walks", moving(1))


def test_only_a_model_from_a_bundle_pickles(model: GenerateModel) -> None:
    with pytest.raises(TypeError, match="loaded from a bundle"):
        pickle.dumps(model)


def test_a_file_gets_the_roots_path_and_a_smooth_frame_rate() -> None:
    motion = walker(frames=30, fps=10.0)
    generated = Generated(contract_of(to_root_block(motion)), to_root_block(motion).values, 0.0)
    found = generated.playable(plant=False)
    assert (found.fps, len(found)) == (30.0, 88)
    places, source = positions(found)[::3, 0], positions(motion)[:, 0]
    travelled = np.linalg.norm(np.diff(places[:, [0, 2]], axis=0), axis=1).sum()
    assert travelled == pytest.approx(np.linalg.norm(np.diff(source[:, [0, 2]], axis=0), axis=1).sum(), rel=1e-6)
    np.testing.assert_allclose(places[:, 1], source[:, 1], atol=1e-9)
    assert len(generated.playable(5.0, plant=False)) == 15


def test_a_motion_has_planted_feet_and_is_there_as_drawn(monkeypatch: pytest.MonkeyPatch) -> None:
    """A model whose contract is the walker's, root block and all."""
    plain = to_root_block(walker(frames=30, fps=10.0))
    model = generate_model()
    model.contract = contract_of(plain)
    drawn = Sample((plain.values - model.contract.mean).astype(np.float32), -1.0)
    monkeypatch.setattr(model, "loop", replace(model.loop, run=lambda *given, **settings: [[drawn]]))
    (found,) = model.generate("walks")
    np.testing.assert_allclose(found.frames, plain.values, atol=1e-4)
    planted = plant_feet(model.contract.features(found.frames))
    np.testing.assert_array_equal(found.features.values, planted.values)
    assert np.abs(found.features.values - found.frames).max() > 0.1
    np.testing.assert_array_equal(found.motion.values, from_root_block(planted).resample(30).values)
    assert np.abs(positions(found.motion) - positions(found.playable(plant=False))).max() > 0.05
    model.contract = replace(model.contract, skeleton=None)
    (found,) = model.generate("walks")
    np.testing.assert_array_equal(found.features.values, found.frames)


def test_a_result_is_written_as_it_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    plain = to_root_block(walker(frames=30, fps=10.0))
    model = generate_model()
    model.contract = contract_of(plain)
    drawn = Sample((plain.values - model.contract.mean).astype(np.float32), -1.0)
    monkeypatch.setattr(model, "loop", replace(model.loop, run=lambda *given, **settings: [[drawn]]))
    (found,) = model.generate("walks")
    found.write(tmp_path / "x.bvh")
    again = read_motion(tmp_path / "x.bvh")
    assert (again.fps, len(again)) == (30.0, 88)
    np.testing.assert_allclose(positions(again), positions(found.motion), atol=1e-6)
    found.write(tmp_path / "y.npz", fps=15, plant=False)
    np.testing.assert_array_equal(read_motion(tmp_path / "y.npz").values, found.playable(15, plant=False).values)
    assert repr(found) == "Generated(30 frames, 3.0 s, log-likelihood -1.0)"


def test_the_benchmark_measures_motions_of_one_length(model: GenerateModel) -> None:
    found = {case.name: case for case in cases(model)}
    assert list(found) == ["generate.motions", "generate.one", "generate.encoder", "generate.step"]
    many, one = found["generate.motions"], found["generate.one"]
    made = [row[0].motion for row in [one.call(), *many.call()]]  # type: ignore[misc,index]
    assert len(made) == 1 + many.count
    assert {(len(motion) - 1) / motion.fps for motion in made} == {CASE_SECONDS - 1 / model.fps}
