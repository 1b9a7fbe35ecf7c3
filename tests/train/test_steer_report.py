"""The report of figures that are steered, of a model trained in seconds on two recordings; its command, its speed."""

import json
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from codes_data import PREPARATION
from stores import prepare
from trainings import done, refused, trained

from motet import to_humanoid
from motet.bench.cases import cases
from motet.bench.measure import compared
from motet.figures.humanoid.bones import HUMANOID, sole_points
from motet.formats import read_motion
from motet.models.load import build
from motet.motion.kinematics import global_transforms
from motet.representation.contract import named
from motet.steering.model import SteerModel
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.errors import DataError
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.evaluate.steer import commands, crowds, edges, following, ground, limbs, paths, players
from motet_train.evaluate.steer.report import Recorded, seldom, steer_report, steer_text
from motet_train.evaluate.tables import report_table
from motet_train.runs import Run

SETTINGS = """
[training]
steps = 2
every = 2
batch = 8
[model]
even = 6
odd = 6
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """A walk, and a run: the same, twice as fast."""
    walk = read_motion(CMU_FOLDER / "39_14.amc")
    motions = {"walk": walk, "run": replace(walk, fps=240.0)}
    found = [Record(name, "16", to_humanoid(motion).motion, (), (), gaits=(name,)) for name, motion in motions.items()]
    return prepare(iter(found), tmp_path_factory.mktemp("steer") / "store", PREPARATION)


@pytest.fixture(scope="module")
def folder(store: Store, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the store is; and, trained from it, a run."""
    place = tmp_path_factory.getbasetemp() / "steer0"
    trained("matching", SETTINGS, place / "store", place / "run")
    return place


@pytest.fixture(scope="module")
def model(folder: Path) -> SteerModel:
    found = Run.load(folder / "run").bundle_model()
    assert isinstance(found, SteerModel)
    return found


@pytest.fixture(scope="module")
def report(model: SteerModel, store: Store) -> Any:
    with pytest.MonkeyPatch.context() as patch, warnings.catch_warnings():
        warnings.simplefilter("error")
        patch.setattr(following, "PHASES", 1)
        patch.setattr(following, "SETTLE", 0.2)
        patch.setattr(following, "STRAIGHT_SECONDS", 2.0)
        patch.setattr(commands, "MEASURED_ACTS", ("wave",))
        patch.setattr(commands, "POINT_SECONDS", 1.0)
        patch.setattr(limbs, "STARTING_DISTANCE", 0.2)
        patch.setattr(limbs, "REACHED_POINTS", 3)
        patch.setattr(players, "STEERED_SECONDS", 1.0)
        patch.setattr(edges, "SETTLE", 0.5)
        patch.setattr(edges, "SLOW_SECONDS", 1.0)
        patch.setattr(edges, "WILD_SECONDS", 1.0)
        patch.setattr(edges, "WATCHED_SECONDS", 1.0)
        patch.setattr(paths, "PATH_SECONDS", 1.0)
        patch.setattr(paths, "BATCH", 2)
        patch.setattr(ground, "SETTLE", 0.2)
        patch.setattr(ground, "GROUND_SECONDS", 0.5)
        patch.setattr(crowds, "CROWD_SEEDS", (1,))
        patch.setattr(crowds, "CROWD_SECONDS", 0.2)
        return steer_report(model, Recorded.of(store), minutes=0.02, characters=3)


def test_all_is_measured_beside_recordings_and_the_rival(report: Any) -> None:
    groups = ["walk", "run", "speed", "turn_walk", "turn_run", "aside", "creep", "ways_walk", "ways_run"]
    groups += ["reversals", "stick", "random", "slow_side", "spot_turn", "wild_stick", "stops", "standing"]
    groups += ["act_standing", "act_walk", "act_run"]
    groups += ["cut_standing", "cut_walk", "cut_run", "reach"]
    for gait in ("walk", "run"):
        groups += [f"going_{gait}", f"paths_{gait}", *(f"ground_{kind}_{gait}" for kind in ground.GROUNDS)]
    groups += ["slow_points", "chase", "crowd_crossing", "crowd_streams"]
    kinds = [f"{gait}_{kind}" for gait in ("walk", "run") for kind in ("recorded", "held")]
    assert list(report) == [*groups, *(f"{group}_seldom" for group in groups), *kinds, "random_held"]
    for group in groups:
        assert list(report[group]) == list(report[f"{group}_seldom"])
    assert all(np.isfinite(value) for value in report["walk"].values())
    # held feet slide less than those that were recorded
    assert report["walk_held"]["slide_cm"] < report["walk_recorded"]["slide_cm"] < 5
    assert report["walk"]["slide_cm"] < report["walk"]["free_slide_cm"]


def test_the_table_has_a_column_of_each(report: Any) -> None:
    lines = steer_text({"runs/mine": report}).splitlines()
    for head in ("mine", "as recorded", "feet held", "seldom searched"):
        assert head in lines[0]
    rows = {line.split()[0]: line.split() for line in lines[1:]}
    assert rows["walk.slide_cm"][1:5] == [
        f"{report[f'walk{kind}']['slide_cm']:.4g}" for kind in ("", "_recorded", "_held", "_seldom")
    ]
    assert rows["walk.toe_speed"][-2:] == ["<=", "0.15"]
    assert not any("_held" in name or "_seldom" in name for name in rows)


def test_columns_beside_need_not_reach_goals() -> None:
    goals = {"a.x": (None, 1.0)}
    text = report_table({"m": {"a": {"x": 0.5}}}, goals, {"other": {"a": {"x": 2.0}}})
    assert text.splitlines()[1].split() == ["a.x", "0.5", "2", "<=", "1"]
    assert "NOT REACHED" in report_table({"m": {"a": {"x": 2.0}}}, goals, {"other": {"a": {"x": 0.5}}})


def test_the_rival_searches_seldom(model: SteerModel) -> None:
    rival = seldom(model)
    assert (model.matcher.settings.search_every, rival.matcher.settings.search_every) == (6, 30)
    assert rival.matcher.reserve > 30
    session = rival.start("walk")
    session.control(speed=1.3)
    rows = [session.tick() and int(session._state.playback.row[0]) for _ in range(90)]
    assert np.count_nonzero(np.abs(np.diff(rows)) > 2) <= 3


def test_recordings_come_with_their_feet_held_and_as_they_are(store: Store) -> None:
    held, plain = (recordings(store, gaits_of(store), held) for held in (True, False))
    np.testing.assert_array_equal(plain[0].features.values, store.motion(0).values[1:-1])
    assert 0 < np.abs(held[0].features.values - plain[0].features.values).max() < 0.5


def test_what_does_not_fit_is_refused(model: SteerModel, store: Store, folder: Path) -> None:
    with pytest.raises(DataError, match=r"root_sixd \(motet prepare --for codes\), not angles"):
        Recorded.of(replace(store, representation="angles"))
    recorded = Recorded.of(store)
    other = build(replace(model.manifest, config={**model.manifest.config, "gaits": ["walk", "hop"]}), {}, model.tables)
    with pytest.raises(DataError, match="has no 'run'"):
        steer_report(other, recorded)
    refused("--plots is not available", "evaluate", folder / "run", "--plots", folder / "p")


def test_the_command_prints_and_saves(folder: Path, monkeypatch: pytest.MonkeyPatch, report: Any) -> None:
    monkeypatch.setattr("motet_train.cli.suites.steer_report", lambda model, recorded: report)
    result = done("evaluate", folder / "run", "--data", folder / "store", "--json", "--save")
    found = json.loads(result.stdout)
    assert found["random"]["broken"] == report["random"]["broken"]
    assert Run.load(folder / "run").manifest["quality"] == found
    result = done("evaluate", folder / "run")  # the store that it was trained on is found
    assert "seldom searched" in result.stdout
    assert "walk.slide_cm" in result.stdout


def test_bench_measures_a_tick_and_a_crowd(model: SteerModel) -> None:
    found = compared({"motet": cases(model)}, 0.001)
    names = ("tick", "tick_locked", "crowd", "crowd_locked", "crowd_positions")
    assert [row.name for row in found] == [f"control.{name}" for name in names]
    assert 0 < found[0].value < 1e3 * found[3].value


def test_soles_of_quaternions_are_those_of_matrices(store: Store) -> None:
    recording, track = Recorded.of(store).held[0]
    motion = named("root_sixd").motion(recording.features)
    expected = sole_points(*global_transforms(motion))
    np.testing.assert_allclose(track.soles[:, 0], expected, atol=1e-4)
    assert motion.skeleton == HUMANOID
