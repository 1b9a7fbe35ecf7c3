"""Predictions of recorded motions by kinds, and whether a model's errors are what it expects them to be."""

import json
from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.data.store import Entry
from motet_train.evaluate.predict.calibration import (
    ALL,
    QUARTERS,
    calibrated,
    calibration_of,
    calibration_table,
    to_json,
)
from motet_train.evaluate.predict.floors import CONSTANT, DAMPED, FLOORS, ZERO
from motet_train.evaluate.predict.kinds import KINDS, REST, by_kind, kind_of
from motet_train.evaluate.predict.mocap import PLACE, POSE, Measured, held_out
from motet_train.evaluate.predict.mocap_table import distance_table, kinds_table, part_json, part_of, parts_of, worse
from motet_train.evaluate.predict.seed_groups import SeedGroup


def entry(name: str, action: str = "", *sentences: str, subject: str = "1") -> Entry:
    return Entry(name, subject, sentences, ((0, 10),), action=action)


@pytest.mark.parametrize(
    ("action", "sentences", "kind"),
    [
        ("walk, veer left", (), "walks and runs"),
        ("Run Jump Over", (), "walks and runs"),
        ("run/jog", (), "walks and runs"),
        ("jumping jacks, side twists, squats, jog", (), REST),
        ("charleston_side_by_side_female", ("Someone walks.",), "dance"),
        ("playground - climb, hang, swing", (), "climbing"),
        ("body jab right", (), "boxing"),
        ("walk with box", (), "walks and runs"),
        ("elephant (human subject)", ("Someone walks around heavily.",), REST),
        ("", ("A man walks.", "Someone goes ahead.", "He is walking."), "walks and runs"),
        ("", ("Runs up and kicks a ball.", "A shot.", "Someone kicks."), REST),
        ("", ("A dancer runs.",), "dance"),
        ("", (), REST),
    ],
)
def test_kinds_are_said_by_words(action: str, sentences: tuple[str, ...], kind: str) -> None:
    assert kind_of(entry("a", action, *sentences)) == kind


def test_kinds_are_listed_in_their_order() -> None:
    entries = [entry("a", "walk"), entry("b", "wave"), entry("c", "boxing"), entry("d", "run")]
    found = {kind: [one.name for one in members] for kind, members in by_kind(entries).items()}
    assert found == {"boxing": ["c"], "walks and runs": ["a", "d"], REST: ["b"]}
    assert list(found) == [kind for kind in (*KINDS, REST) if kind in found]


def measured(**systems: float) -> Measured:
    """Windows of four recordings: constant distances, ten times as large in "box", and once more in "one"'s pose."""
    names = ("box", "box", "walk", "run", "wave")
    factor = np.array([10.0, 10, 1, 1, 2])[:, None] * np.ones(25)
    every = {**dict(zip(FLOORS, (2.0, 3, 1, 3, 1), strict=True)), **systems}
    return Measured(names, {name: {PLACE: v * factor, POSE: 0.5 * v * factor} for name, v in every.items()}, ())


ENTRIES = [
    entry("box", "boxing"),
    entry("walk", "walk", subject="2"),
    entry("run", "run", subject="2"),
    entry("wave", "wave"),
    entry("short", "dance"),  # has no window
]


def test_distances_are_means_over_the_windows_of_a_kind() -> None:
    found = measured(a=1.0, b=2.0)
    parts = parts_of(found, ENTRIES, [SeedGroup("ab (2 seeds)", ("a", "b"))])
    assert list(parts) == ["boxing", "walks and runs", REST]
    boxing, walks = parts["boxing"], parts["walks and runs"]
    assert (boxing.recordings, boxing.people, boxing.windows) == (("box",), 1, 2)
    assert (walks.recordings, walks.people, walks.windows) == (("walk", "run"), 1, 2)
    np.testing.assert_allclose(boxing.means["ab (2 seeds)"][PLACE], 15.0)
    np.testing.assert_allclose(boxing.spreads["ab (2 seeds)"][PLACE], 10.0)
    np.testing.assert_allclose(walks.means[ZERO][POSE], 1.0)
    assert list(walks.means) == [*FLOORS, "ab (2 seeds)"]
    one = part_json(found, boxing, "b")
    assert one["place_cm"]["frame_24"] == 20.0
    assert one["constant_velocity"]["pose_cm"]["frame_1"] == 15.0
    assert (one["recordings"], one["windows"]) == (1, 2)
    with pytest.raises(DataError, match="no window"):
        part_of(found, ENTRIES[-1:], [])


def test_tables_say_where_a_model_is_worse_than_a_floor() -> None:
    found = measured(a=1.0)
    found.distances["a"][PLACE][:2, 13:] = 25.0  # of the boxing, where standing still is off by 20 and damped by 10
    parts = parts_of(found, ENTRIES, [SeedGroup("a", ("a",))])
    text = kinds_table(parts, 30.0)
    boxing = text.split("boxing: 1 person, 1 recording, 2 windows")[1].split("walks and runs: ")[0]
    assert "a: worse than standing still at 13, 24; worse than damped velocity at 13, 24" in boxing
    assert "constant velocity at" not in boxing
    assert "walks and runs: 1 person, 2 recordings, 2 windows" in text
    assert "a: nowhere worse than standing still, constant velocity, damped velocity" in text
    whole = distance_table(part_of(found, ENTRIES[:4], [SeedGroup("a", ("a",))]), 30.0).splitlines()
    assert whole[1].split() == ["milliseconds", "67", "133", "267", "333", "467", "833"]
    assert whole[2] == "2 people, 4 recordings, 5 windows"
    assert next(row.split() for row in whole if row.startswith("  a ")) == ["a", *["4.8"] * 4, *["10.8"] * 2]


def test_what_looks_the_same_is_not_worse() -> None:
    even = {ZERO: 1.0, CONSTANT: 1.0, DAMPED: 0.96, "a": 1.04}
    means = {name: {PLACE: np.full(25, value)} for name, value in even.items()}
    assert worse(means) == ["a: nowhere worse than standing still, constant velocity, damped velocity"]
    means["a"][PLACE][9] = 1.06
    assert worse(means) == [f"a: {'; '.join(f'worse than {w} at 9' for w in ('standing still', CONSTANT, DAMPED))}"]


def test_what_one_model_was_trained_on_is_not_held_out() -> None:
    models: Any = {
        name: SimpleNamespace(manifest=SimpleNamespace(training={"data": {"test": test}}))
        for name, test in (("a", ["x", "y"]), ("b", ["y", "z"]))
    }
    motions = [Motion(np.full((2, 1), float(n)), ("a",), ("1",), 30.0, None) for n in range(4)]
    store: Any = SimpleNamespace(
        records=[entry(name) for name in "wxyz"], representation="angles", motion=motions.__getitem__
    )
    found = held_out(models, store)
    assert {one.name: motion.values[0, 0] for one, motion in found.items()} == {"y": 2.0}
    models["b"].manifest.training["data"]["test"] = ["z"]
    with pytest.raises(DataError, match="none of the trials"):
        held_out(models, store)


class Honest:
    """A model that says how far it will be off."""

    def __init__(self, expected: Array, knows: bool = True) -> None:
        self.expected, self.knows_errors = expected, knows

    def expected_errors(self, motions: Sequence[Motion], /) -> Array:
        assert len(motions) == len(self.expected)
        return self.expected


def test_calibration_is_measured_over_expected() -> None:
    rng = np.random.default_rng(0)
    expected = rng.uniform(1, 5, (40, 25))
    true = 2 * expected
    true[:10] = 3 * expected[:10]
    kinds: dict[str, NDArray[Any]] = {"first": np.arange(10), "rest": np.arange(10, 40), "none": np.arange(0)}
    found = calibrated(expected, true, kinds)
    assert list(found.ratios) == [ALL, "first", "rest"]
    np.testing.assert_allclose(found.ratios["first"], 3.0)
    np.testing.assert_allclose(found.ratios["rest"], 2.0)
    np.testing.assert_allclose(found.ratios[ALL], true.mean(axis=0) / expected.mean(axis=0))
    least, _ = found.quarters[QUARTERS[0]]
    np.testing.assert_allclose(least, np.sort(expected, axis=0)[:10].mean(axis=0))
    most, measured_most = found.quarters[QUARTERS[3]]
    picked = np.argsort(expected[:, 7])[30:]
    assert (most[7], measured_most[7]) == pytest.approx((expected[picked, 7].mean(), true[picked, 7].mean()))
    assert [list(found.quarters), len(found.quarters)] == [list(QUARTERS), 4]


def test_ranks_are_correlated_whatever_the_scale() -> None:
    expected = np.array([[1.0, 5], [2, 5], [3, 5], [4, 5]])
    true = np.array([[1.0, 1], [10, 2], [1000, 3], [100, 4]])
    found = calibrated(expected, true, {}).ranks
    assert found[0] == pytest.approx(1 - 6 * 2 / (4 * 15))  # by Spearman's own formula, two ranks exchanged
    assert np.isnan(found[1])


def test_a_model_is_asked_for_its_errors_where_it_knows_them() -> None:
    found = Measured(
        ("box", "walk", "walk"), {"m": {PLACE: np.outer([4.0, 1, 3], np.ones(25))}}, tuple[Any]([None] * 3)
    )
    model = Honest(np.outer([2.0, 1, 1], np.ones(25)))
    one = calibration_of(model, found, "m", {"boxing": ["box"], "walks": ["walk"], "dance": []})
    assert one is not None
    assert {kind: ratio[24] for kind, ratio in one.ratios.items()} == {ALL: 2.0, "boxing": 2.0, "walks": 2.0}
    said = json.loads(json.dumps(to_json(one)))
    assert said["ratio"]["boxing"]["frame_24"] == 2.0
    assert said["quarters"][0] == {
        "expected_cm": dict.fromkeys(said["ratio"]["boxing"], 1.0),
        "measured_cm": dict.fromkeys(said["ratio"]["boxing"], 1.0),
    }
    assert said["rank_correlation"]["frame_1"] == pytest.approx(0.866, abs=1e-3)
    text = calibration_table(one, "m")
    assert "m: measured mean error over the expected one" in text
    assert [row.split() for row in text.splitlines() if row.startswith("  boxing")] == [["boxing", *["2.00"] * 6]]
    assert calibration_of(Honest(model.expected, knows=False), found, "m", {}) is None
    assert calibration_of(object(), found, "m", {}) is None
