"""Predictions of recorded motions by kinds, and whether a model's errors are what it expects them to be."""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.data.store import Entry
from motet_train.evaluate.predict.floors import FLOORS
from motet_train.evaluate.predict.mocap import (
    ANIMALS,
    BONES,
    EVERYTHING_ELSE,
    MOTION_KINDS,
    PLACE,
    POSE,
    TITLES,
    Measured,
    by_kind,
    calibration,
    calibration_rows,
    distances_of,
    held_out,
    kind_of,
    mocap_report,
    mocap_text,
)
from motet_train.evaluate.tables import json_ready


def entry(name: str, action: str = "", *sentences: str, subject: str = "1") -> Entry:
    return Entry(name, subject, sentences, ((0, 10),), action=action)


@pytest.mark.parametrize(
    ("action", "sentences", "kind"),
    [
        ("walk, veer left", (), "walks and runs"),
        ("Run Jump Over", (), "walks and runs"),
        ("run/jog", (), "walks and runs"),
        ("jumping jacks, side twists, squats, jog", (), EVERYTHING_ELSE),
        ("charleston_side_by_side_female", ("Someone walks.",), "dance"),
        ("playground - climb, hang, swing", (), "climbing"),
        ("body jab right", (), "boxing"),
        ("walk with box", (), "walks and runs"),
        ("elephant (human subject)", ("Someone walks around heavily.",), EVERYTHING_ELSE),
        ("", ("A man walks.", "Someone goes ahead.", "He is walking."), "walks and runs"),
        ("", ("Runs up and kicks a ball.", "A shot.", "Someone kicks."), EVERYTHING_ELSE),
        ("", ("A dancer runs.",), "dance"),
        ("", (), EVERYTHING_ELSE),
    ],
)
def test_kinds_are_said_by_words(action: str, sentences: tuple[str, ...], kind: str) -> None:
    assert kind_of(entry("a", action, *sentences)) == kind


def test_kinds_are_listed_in_their_order() -> None:
    entries = [entry("a", "walk"), entry("b", "wave"), entry("c", "boxing"), entry("d", "run")]
    found = {kind: [one.name for one in members] for kind, members in by_kind(entries).items()}
    assert found == {"boxing": ["c"], "walks and runs": ["a", "d"], EVERYTHING_ELSE: ["b"]}
    assert list(found) == [kind for kind in (*MOTION_KINDS, EVERYTHING_ELSE) if kind in found]


def measured(**systems: float) -> Measured:
    """Windows of four recordings: constant distances, ten times as large in "box", and once more in "one"'s pose."""
    names = ("box", "box", "walk", "run", "wave")
    speeds = np.array([0.1, 0.0, 1.2, 2.5, 0.4])
    factor = np.array([10.0, 10, 1, 1, 2])[:, None] * np.ones(25)
    every = {**dict(zip(FLOORS, (2.0, 3, 1, 3, 1), strict=True)), **systems}
    distances = {}
    for name, v in every.items():
        distances[name] = {PLACE: v * factor, POSE: 0.5 * v * factor, BONES: 0.1 * v * factor}
    return Measured(names, distances, (), speeds)


ENTRIES = [
    entry("box", "boxing"),
    entry("walk", "walk", subject="2"),
    entry("run", "run", subject="2"),
    entry("wave", "wave"),
    entry("short", "dance"),  # has no window
]


class Unsure:
    """A model that does not know its errors."""

    knows_errors = False


def test_distances_are_means_over_the_windows_of_a_kind() -> None:
    models: Any = {"a": Unsure(), "b": Unsure()}
    reports = mocap_report(models, measured(a=1.0, b=2.0), ENTRIES[:4])
    assert list(reports) == ["a", "b"]
    assert list(reports["b"]["kinds"]) == ["boxing", "walks and runs", EVERYTHING_ELSE, "going", "others"]
    boxing, walks = reports["b"]["kinds"]["boxing"], reports["b"]["kinds"]["walks and runs"]
    assert [boxing[count] for count in ("recordings", "people", "windows")] == [1, 1, 2]
    assert [walks[count] for count in ("recordings", "people", "windows")] == [2, 1, 2]
    assert boxing["place_cm"]["frame_24"] == 20.0
    assert boxing["constant_velocity"]["pose_cm"]["frame_1"] == 15.0
    assert walks["zero_velocity"]["pose_cm"]["frame_1"] == 1.0
    assert reports["a"]["place_cm"]["frame_3"] == pytest.approx((10 + 10 + 1 + 1 + 2) / 5)
    assert "calibration" not in reports["a"]


def test_windows_are_divided_by_whether_they_begin_on_the_way() -> None:
    entries = [*ENTRIES[:3], entry("wave", "wave", subject=ANIMALS)]
    found = measured(a=1.0)
    parts = {name: part.tolist() for name, part in found.by_going(entries).items()}
    assert parts == {"going": [2, 3], "animals": [4], "others": [0, 1]}
    part = found.part("a", entries, np.array([2, 3]))
    assert (part["people"], part["recordings"], part["windows"]) == (1, 2, 2)
    assert part["behind_standing"] == 0.0
    assert measured(a=3.0).part("a", entries, np.array([2, 3]))["behind_standing"] == 1.0


def test_the_table_has_a_row_of_each_system_for_each_kind() -> None:
    models: Any = {"a": Unsure()}
    text = mocap_text(mocap_report(models, measured(a=1.0), ENTRIES[:4]), 30.0)
    rows = [row.split() for row in text.splitlines()]
    assert rows[1] == ["milliseconds", "67", "133", "267", "333", "467", "833"]
    assert text.splitlines()[2] == "all: 2 people, 4 recordings, 5 windows"
    cells = ("4.8", "2.4", "0.5", "10.0", "1.0", "2.0", "1.0", "7.3")
    assert [row[1:] for row in rows if row[0] == "a"] == [[cell] * 6 for cell in cells]
    assert "walks and runs: 1 people, 2 recordings, 2 windows" in text
    assert sum(row[:2] == ["zero", "velocity"] for row in rows) == 8


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

    knows_errors = True

    def __init__(self, expected: Array) -> None:
        self.expected = expected

    def expected_errors(self, motions: Sequence[Motion], /) -> Array:
        assert len(motions) == len(self.expected)
        return self.expected


def test_calibration_is_measured_over_expected() -> None:
    rng = np.random.default_rng(0)
    expected = rng.uniform(1, 5, (40, 25))
    true = 2 * expected
    true[:10] = 3 * expected[:10]
    found = calibration(expected, true, {"first": np.arange(10), "rest": np.arange(10, 40)})
    ratio = found["ratio"]
    assert list(ratio) == ["all", "first", "rest"]
    for kind, times in (("first", 3.0), ("rest", 2.0)):
        assert list(ratio[kind].values()) == pytest.approx([times] * 6)
    assert ratio["all"]["frame_7"] == pytest.approx(true[:, 7].mean() / expected[:, 7].mean())


def test_ranks_are_correlated_whatever_the_scale() -> None:
    expected = np.repeat(np.array([[1.0], [2], [3], [4]]), 25, axis=1)
    expected[:, 3] = 5.0
    true = np.repeat(np.array([[1.0], [10], [1000], [100]]), 25, axis=1)
    found = calibration(expected, true, {})["rank_correlation"]
    assert found["frame_1"] == pytest.approx(1 - 6 * 2 / (4 * 15))  # by Spearman's own formula, two ranks exchanged
    assert np.isnan(found["frame_3"])


def test_a_model_is_asked_for_its_errors_where_it_knows_them() -> None:
    distances = {name: {measure: np.outer([4.0, 1, 3], np.ones(25)) for measure in TITLES} for name in (*FLOORS, "m")}
    found = Measured(("box", "walk", "walk"), distances, tuple[Any]([None] * 3), np.array([0.0, 1, 1]))
    models: Any = {"m": Honest(np.outer([2.0, 1, 1], np.ones(25)))}
    reports = mocap_report(models, found, ENTRIES[:2])
    one = json_ready(reports["m"]["calibration"])
    kinds = ("all", "boxing", "walks and runs", "going", "others")
    assert {kind: ratio["frame_24"] for kind, ratio in one["ratio"].items()} == dict.fromkeys(kinds, 2)
    assert one["rank_correlation"]["frame_1"] == pytest.approx(0.866, abs=1e-3)
    assert ["  boxing", *["2.00"] * 6] in calibration_rows(reports["m"]["calibration"])
    assert "measured mean error over the expected one" in mocap_text(reports, 30.0)


def test_bones_that_change_their_lengths_are_measured() -> None:
    truth = np.zeros((2, 3, 3, 3))
    truth[..., 1, 1] = 30.0
    truth[..., 2, 1] = 50.0
    predicted = truth.copy()
    predicted[1, :, 1, 1] = 26.0
    found = distances_of(predicted, truth, np.array([-1, 0, 1]))
    np.testing.assert_allclose(found[BONES], [[0.0] * 3, [4.0] * 3])  # 4 shorter, 4 longer
    np.testing.assert_allclose(found[PLACE], [[0.0] * 3, [4.0 / 3] * 3])
