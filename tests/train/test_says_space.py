"""R-precision and Frechet distance: by draws, closed forms and scipy, and by a model whose space is known."""

from collections.abc import Sequence

import numpy as np
import pytest
from language_models import WholeMotions
from numpy.typing import NDArray
from scipy.linalg import sqrtm
from test_says_table import LEFT, LYING, STILL, ZOMBIE, Half, gliding, only

import motet
from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion.motion import Motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.evaluate.text_adherence import table
from motet_train.evaluate.text_adherence.prompts import EVERYDAY_PROMPTS, Trial
from motet_train.evaluate.text_adherence.table import (
    CHOICES,
    embedded,
    frechet,
    r_precision,
    rivals,
    says_table,
    space_report,
)

Array = NDArray[np.float64]
STAND, LIE = gliding(), gliding(tip=90)
TRIALS = (
    Trial("ACCAD_Male2_A1_Stand", ("someone stands",), STAND),
    Trial("ACCAD_Female1_A01_Stand", ("she stands there",), STAND),
    Trial("ACCAD_Male2_A9_Lie", ("a man is lying on the floor",), LIE),
    Trial("ACCAD_Male2_A9_Lie_again", ("nobody knows",), LIE),
)


class Known(WholeMotions):
    """A space of three directions: whoever lies, whoever stands, and anything else that is asked for."""

    sizes = {"E": 3}  # noqa: RUF012

    def embed(self, motions: Sequence[Motion]) -> NDArray[np.float32]:
        return np.eye(3, dtype=np.float32)[[int(np.ptp(motion.values[0, 3:6]) < 1) for motion in motions]]

    def embed_text(self, texts: Sequence[str]) -> NDArray[np.float32]:
        return np.eye(3, dtype=np.float32)[[{LYING: 0, STILL: 1}.get(text, 2) for text in texts]]


def test_r_precision_is_the_mean_over_draws() -> None:
    rng = np.random.default_rng(0)
    own, others = rng.normal(1.5, 0.2, 6), rng.normal(size=(6, 60))
    hits = np.zeros(3)
    for _ in range(4000):
        for mine, row in zip(own, others, strict=True):
            place = (rng.choice(row, CHOICES - 1, replace=False) > mine).sum()
            hits += place < np.array([1, 2, 3])
    expected = hits / (6 * 4000)
    assert 0.05 < expected[0] < expected[2] < 0.9
    np.testing.assert_allclose(list(r_precision(own, others).values()), expected, atol=0.01)


def test_r_precision_of_who_knows_nothing_and_of_few_rivals() -> None:
    others = np.tile(np.arange(60.0), (61, 1))
    guessed = r_precision(np.arange(61.0) - 0.5, others)  # every place among the 60 as often
    assert list(guessed.values()) == pytest.approx([1 / CHOICES, 2 / CHOICES, 3 / CHOICES])
    assert r_precision(np.array([0.5, 2.5]), np.array([[0.0, 1.0, 2.0]] * 2)) == {"1": 0.5, "2": 0.5, "3": 1.0}
    assert r_precision(np.array([1.0, np.nan]), np.array([[1.0], [0.0]])) == {"1": 0.0, "2": 1.0, "3": 1.0}
    assert r_precision(np.empty(0), np.empty((0, 40))) == {"1": 0.0, "2": 0.0, "3": 0.0}
    assert np.isnan(r_precision(np.ones(2), np.empty((2, 0)))["1"])


def test_rivals_ask_for_something_else() -> None:
    asked = EVERYDAY_PROMPTS
    texts = [prompt.text for prompt in asked]
    found = {texts[own]: {texts[i] for i in others} for own, others in enumerate(rivals(asked))}
    assert "a fighter does a high kick" not in found["a person kicks with the left leg"]
    assert "a man is lying on the floor" in found["a person kicks with the left leg"]
    assert min(map(len, found.values())) >= CHOICES - 1
    assert all(own not in others and all(own in found[other] for other in others) for own, others in found.items())


def whitened(rng: np.random.Generator, count: int, size: int) -> Array:
    """Vectors of mean 0 and covariance 1, exactly."""
    vectors = rng.normal(size=(count, size))
    q, _ = np.linalg.qr(vectors - vectors.mean(axis=0))
    return np.asarray(q * np.sqrt(count - 1))


def test_the_frechet_distance_of_gaussians() -> None:
    rng = np.random.default_rng(1)
    stds, means = rng.uniform(0.5, 2, (2, 4)), rng.normal(size=(2, 4))
    one, other = (whitened(rng, n, 4) * std + mean for n, std, mean in zip((30, 50), stds, means, strict=True))
    closed = ((means[0] - means[1]) ** 2).sum() + ((stds[0] - stds[1]) ** 2).sum()
    assert frechet(one, other) == pytest.approx(closed)
    one, other = one @ rng.normal(size=(4, 4)), other @ rng.normal(size=(4, 4))
    s, t = np.cov(one, rowvar=False), np.cov(other, rowvar=False)
    expected = ((one.mean(axis=0) - other.mean(axis=0)) ** 2).sum() + np.trace(s + t - 2 * sqrtm(s @ t).real)
    assert frechet(one, other) == pytest.approx(expected)
    assert frechet(one, one) == pytest.approx(0, abs=1e-9)
    assert np.isnan(frechet(one, other[:1]))


def test_the_frechet_distance_of_fewer_vectors_than_dimensions() -> None:
    rng = np.random.default_rng(2)
    few = rng.normal(size=(5, 40))
    assert frechet(few, few + 0.5) == pytest.approx(40 * 0.25)
    centred = few - few.mean(axis=0)
    assert frechet(centred, 3 * centred) == pytest.approx(4 * np.trace(np.cov(few, rowvar=False)))


def test_who_does_what_is_asked_is_found_and_near(monkeypatch: pytest.MonkeyPatch) -> None:
    asked, model = only(STILL, LYING, ZOMBIE), Known()
    made = {STILL: np.eye(3)[[1, 1]], LYING: np.eye(3)[[0]], ZOMBIE: np.eye(3)[[0]]}
    report = space_report(model, asked, {"": made}, TRIALS)  # type: ignore[arg-type]
    assert report["r_precision"] == pytest.approx({"1": 2 / 3, "2": 2 / 3, "3": 1})  # the "zombie" lies: 0 as standing
    assert report["r_precision_real"] == {"1": 1, "2": 1, "3": 1}
    # of the zombie there is no trial; those who stand and lie are as the three trials, of which one is not known
    assert report["frechet"]["generated"] == pytest.approx(0, abs=1e-9)
    assert (report["frechet"]["generated_motions"], report["frechet"]["trials_motions"]) == (3, 3)
    wrong = space_report(model, asked, {"": {**made, STILL: np.eye(3)[[0, 0]]}}, TRIALS)  # type: ignore[arg-type]
    assert wrong["frechet"]["generated"] > 0.5
    assert wrong["r_precision"]["1"] == pytest.approx(1 / 3)
    assert set(space_report(model, asked, {"": made}, ())) == {"r_precision"}  # type: ignore[arg-type]

    monkeypatch.setattr(table, "EVERYDAY_PROMPTS", only(STILL, LYING, LEFT, ZOMBIE))
    report = says_table(Half().generate, TRIALS, seeds=2, search=model)  # type: ignore[arg-type]
    assert report["r_precision"]["1"] == 0.25  # never lies, refuses the zombie, and turning is seen as standing
    assert report["r_precision_lookup"]["1"] == 0.5
    assert report["frechet"]["lookup_motions"] == 2


def test_what_is_too_short_has_no_vector() -> None:
    model, walk = motet.load("search"), read_motion(CMU_FOLDER / "39_14.amc")
    found = embedded(model, [walk[:100], walk[:30]])
    np.testing.assert_allclose(found[0], model.embed(walk[:100]), atol=1e-6)
    assert np.isnan(found[1]).all()
    assert embedded(model, []).shape == (0, model.sizes["E"])
    with pytest.raises(MotionError, match="lacks"):
        embedded(model, [STAND])
