"""The thesis' family as a figure that is steered: control values, training from a store, the measures of steering."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from codes_data import PREPARATION
from stores import prepare
from trainings import done, trained

from motet import to_humanoid
from motet.figures.humanoid.bones import HUMANOID
from motet.formats import read_motion
from motet.motion.kinematics import positions
from motet.papers.tdbn_control import TdbnModel
from motet.representation.contract import named
from motet.representation.root_block import way
from motet.representation.root_sixd import ROOT_SIXD
from motet_train.cli.suites import as_steered
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.errors import DataError
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.store import Store
from motet_train.evaluate.steer import following
from motet_train.evaluate.steer.report import Recorded, steer_report
from motet_train.papers.tdbn.clips import TRUNK_PART, body_parts
from motet_train.papers.tdbn.steered import (
    FULL_CONTROL,
    LABELS,
    RECIPES,
    Driven,
    DrivenSession,
    controls_of,
    course,
    mirrored_too,
    moved,
    train_steered,
)
from motet_train.recipes.recipe import Job
from motet_train.runs import About, Run

SETTINGS = """
[model]
hidden_per_part = 8
unrolled = 3
rbm = {epochs = 2, rate = 0.01}
crbm = {epochs = 2, rate = 0.01}
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Store:
    """Two seconds of a walk, and a run: the same, twice as fast."""
    walk = to_humanoid(read_motion(CMU_FOLDER / "39_14.amc")[:480]).motion
    motions = {"walk": walk[:240], "run": replace(walk, fps=2 * walk.fps)}
    found = [Record(name, "16", motion, (), (), gaits=(name,)) for name, motion in motions.items()]
    return prepare(iter(found), tmp_path_factory.mktemp("steered") / "store", PREPARATION)


@pytest.fixture(scope="module")
def folder(store: Store, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the store is; and, trained from it, a run."""
    place = tmp_path_factory.getbasetemp() / "steered0"
    trained("steered-tdbn", SETTINGS, place / "store", place / "run")
    return place


@pytest.fixture(scope="module")
def model(folder: Path) -> TdbnModel:
    found = Run.load(folder / "run").bundle_model()
    assert isinstance(found, TdbnModel)
    return found


def test_control_values_are_shares_of_each_way() -> None:
    velocities = np.random.default_rng(0).uniform(-5, 5, (50, 3))
    ways = (("forward", "backward"), ("left", "right"), ("turn_left", "turn_right"))
    for values, velocity in zip(controls_of(velocities), velocities, strict=True):
        named_values = dict(zip(LABELS, values, strict=True))
        for (plus, minus), speed, most in zip(ways, velocity, FULL_CONTROL, strict=True):
            assert named_values[plus] == pytest.approx(min(max(speed, 0) / most, 1))
            assert named_values[minus] == pytest.approx(min(max(-speed, 0) / most, 1))


def test_a_course_is_the_mean_of_what_comes(store: Store) -> None:
    features = store.motion(0)
    velocities = features.values[:, :3]
    expected = [velocities[t : t + 15].mean(axis=0) for t in range(len(velocities))]  # half a second at 30 fps
    np.testing.assert_allclose(course(features), expected, atol=1e-12)


def test_mirror_images_balance_left_and_right(store: Store) -> None:
    found = recordings(store, gaits_of(store))
    contract, motions = mirrored_too(store, found)
    assert len(motions) == 2 * len(found)
    at = [contract.channels.index(name) for name in ("root.left", "root.turn")]
    np.testing.assert_allclose(contract.mean[at], 0, atol=1e-9)
    half = len(found)
    for one, other in zip(motions[:half], motions[half:], strict=True):
        swapped = controls_of(course(other))[:, [0, 1, 3, 2, 5, 4]]
        np.testing.assert_allclose(swapped, controls_of(course(one)), atol=1e-12)


def test_where_the_root_goes_is_the_trunk_s(store: Store) -> None:
    parts = body_parts(HUMANOID, store.channels)
    by_name = {name: parts.names[part] for name, part in zip(store.channels, parts.of_channel, strict=True)}
    assert {by_name[name] for name in ROOT_SIXD} == {by_name["head.xx"]} == {TRUNK_PART}
    assert len(parts.names) == 5
    assert by_name["leftFoot.xy"] != by_name["rightFoot.xy"]


def test_steps_lead_where_the_representation_says() -> None:
    steps = np.random.default_rng(1).normal(size=(20, 3))
    ground, places = np.zeros((1, 3)), []
    for step in steps:
        ground = moved(ground, step[None])
        places.append(ground[0])
    facing, x, z = way(steps)
    np.testing.assert_allclose(places, np.stack([x, z, facing], axis=1), atol=1e-12)


def test_frames_become_the_poses_of_their_motion(model: TdbnModel, store: Store) -> None:
    values = np.array(store.motion(0).values)
    values[0, :3] = 0  # a motion begins at the origin
    features = replace(store.motion(0), values=values)
    session = DrivenSession(model, 1, hold_feet=False)
    poses = [session.pose(frame[None].astype(np.float32)) for frame in features.values]
    motion = named("root_sixd").motion(features)
    assert motion.skeleton == HUMANOID
    found = np.concatenate([pose.positions() for pose in poses])
    np.testing.assert_allclose(found, positions(motion), atol=1e-4)
    soles = np.array([pose.contacts[0] for pose in poses])
    assert 0.3 < soles.mean() < 1  # a walk's feet stand in turn, and together for a moment
    assert set(soles.sum(axis=1)) >= {1, 2}


def test_a_figure_is_told_what_turns_it_to_where_it_shall_face(model: TdbnModel) -> None:
    session = Driven(model).start(characters=3, hold_feet=False)
    session.control(speed=1.8, direction=[0, 90, 180], facing=[0, 90, 0])
    told: list[Any] = []
    session.session.set_control = told.append  # type: ignore[method-assign, assignment]
    session.tick()
    straight, left, back = (dict(zip(LABELS, row, strict=True)) for row in told[0])
    assert straight == pytest.approx({**dict.fromkeys(LABELS, 0.0), "forward": 0.4}, abs=1e-9)
    assert left == pytest.approx({**dict.fromkeys(LABELS, 0.0), "left": 0.4, "turn_left": 1.0}, abs=1e-9)
    assert back == pytest.approx({**dict.fromkeys(LABELS, 0.0), "backward": 0.4}, abs=1e-9)


def test_it_is_measured_as_a_steered_figure_without_a_rival(model: TdbnModel, store: Store) -> None:
    steered = as_steered(model)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(following, "PHASES", 1)
        patch.setattr(following, "SETTLE", 0.2)
        patch.setattr(following, "STRAIGHT_SECONDS", 2.0)
        report = steer_report(steered, Recorded.of(store), minutes=0.02, characters=3)
    groups = ["walk", "run", "speed", "turn_walk", "turn_run", "aside", "creep", "ways_walk", "ways_run"]
    groups += ["reversals", "stick", "random"]
    beside = [f"{gait}_{kind}" for gait in ("walk", "run") for kind in ("recorded", "held")]
    assert list(report) == [*groups, *beside, "random_held"]


def test_the_contract_makes_its_frames_travel(model: TdbnModel) -> None:
    motion = model.run("forward 1s", in_place=True)
    assert motion.skeleton == HUMANOID
    assert len(motion) == 30
    assert model.labels == LABELS


def test_a_store_of_angles_is_refused(store: Store, tmp_path: Path) -> None:
    job = Job(RECIPES["default"], About("small", "a test"), tmp_path)
    with pytest.raises(DataError, match=r"root_sixd \(motet prepare --for codes\), not angles"):
        train_steered(replace(store, representation="angles"), job)


def test_the_command_finds_the_store_of_the_run(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet_train.cli.suites.steer_report", lambda model, recorded: {"walk": {"slide_cm": 1.5}})
    assert "walk.slide_cm" in done("evaluate", folder / "run").output
