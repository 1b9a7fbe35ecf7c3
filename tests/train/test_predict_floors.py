"""Floors of prediction: zero, constant and damped velocity, of text files and of recorded motions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from stores import prepare
from test_predict_data import write_files

from motet.figures.humanoid.bones import HUMANOID
from motet.formats import read_motion
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.errors import DataError
from motet_train.data.preparation import VECTORS
from motet_train.evaluate.predict import floors as predict_floors
from motet_train.evaluate.predict.floors import (
    CONSTANT,
    DAMPED,
    FLOORS,
    OF_JOINTS,
    ZERO,
    Windows,
    apart,
    best,
    chosen,
    floors,
    gone_on,
    key,
    places,
    reach,
)
from motet_train.papers.li2018.expmap import OUTPUT_FRAMES, ExpmapCorpus, read_expmap
from motet_train.papers.li2018.protocol import (
    chosen_decays,
    text_floors,
    training_windows,
    velocity,
    window_errors,
    zero_velocity,
)


def test_the_last_step_is_gone_as_often_as_its_decay_says() -> None:
    np.testing.assert_allclose(reach(0.5, 3), [0.5, 0.75, 0.875])
    np.testing.assert_allclose(reach(np.array([0.0, 1.0, 0.5]), 3), [0, 2, 0.875])
    found = gone_on(np.array([[[1.0, 2], [3, 5]]]), reach(1.0, 2))
    np.testing.assert_allclose(found, [[[5, 8], [7, 11]]])
    errors = [np.array([abs(decay - 0.3), abs(decay - 1)]) for decay in np.linspace(0, 1, 21)]
    np.testing.assert_allclose(best(errors), [0.3, 1.0])
    assert [key(floor) for floor in FLOORS] == [
        "zero_velocity",
        "constant_velocity",
        "damped_velocity",
        "constant_velocity_of_joints",
        "damped_velocity_of_joints",
    ]


def test_text_floors_turn_on_exactly() -> None:
    rng = np.random.default_rng(0)
    turn, start = Rotation.from_rotvec(0.2 * rng.normal(size=(2, 3))), Rotation.random(2, random_state=0)
    motion = [start]
    for _ in range(30):
        motion.append(turn * motion[-1])
    vectors = np.array([pose.as_rotvec().ravel() for pose in motion])
    frames = np.concatenate([np.arange(31.0)[:, None] * [1, 2, -3], vectors], axis=1)
    found = velocity(1.0)(frames[None, :6])[0]
    np.testing.assert_allclose(found[:, :3], frames[6:, :3])
    said = Rotation.from_rotvec(found[:, 3:].reshape(-1, 3))
    assert (said.inv() * Rotation.from_rotvec(vectors[6:].reshape(-1, 3))).magnitude().max() < 1e-6
    halved = velocity(0.5)(frames[None, :6])[0]
    once = Rotation.from_rotvec(halved[0, 3:6]) * motion[5][0].inv()
    np.testing.assert_allclose(once.as_rotvec(), turn[0].as_rotvec() / 2, atol=1e-9)
    still = velocity(0.0)(frames[None, :6])
    np.testing.assert_allclose(still, zero_velocity(frames[None, :6]), atol=1e-9)


def test_damped_velocity_is_the_best_of_the_three_on_training_files(tmp_path: Path) -> None:
    corpus = read_expmap(write_files(tmp_path))
    decays = chosen_decays(corpus)
    assert (decays.shape, decays.min() >= 0, decays.max() <= 1) == ((OUTPUT_FRAMES,), True, True)
    windows = training_windows(corpus)
    damped, *others = (
        np.mean([window_errors(velocity(decay)(truth[:, :50]), truth).mean(axis=0) for truth in windows], axis=0)
        for decay in (decays, 0.0, 1.0, 0.5)
    )
    for other in others:
        assert (damped <= other + 1e-12).all()
    assert list(text_floors(corpus)) == [ZERO, CONSTANT, DAMPED]


def test_decays_do_not_look_at_test_files(tmp_path: Path) -> None:
    corpus = read_expmap(write_files(tmp_path))
    test = {action: {name: frames[::-1] * 2 for name, frames in files.items()} for action, files in corpus.test.items()}
    other = ExpmapCorpus(corpus.layout, corpus.train, test, corpus.missing)
    np.testing.assert_array_equal(chosen_decays(other), chosen_decays(corpus))
    short = {group: {name: frames[:60] for name, frames in files.items()} for group, files in corpus.train.items()}
    with pytest.raises(DataError, match="no training file has a window of 75 frames"):
        chosen_decays(ExpmapCorpus(corpus.layout, short, corpus.test, ()))


def walk_windows(frames: int = 5) -> Windows:
    walk = read_motion(CMU_FOLDER / "39_14.amc").scaled(0.01)[::4]
    return Windows.of([walk[start : start + frames + 10] for start in (0, 20, 40)], frames)


def test_floors_of_recorded_motions_go_on_as_their_names_say() -> None:
    windows = walk_windows()
    decays = {DAMPED: (np.zeros(5), np.zeros(5)), DAMPED + OF_JOINTS: (np.ones(5), np.zeros(5))}
    found = floors(windows, decays)
    assert list(found) == list(FLOORS)
    last = windows.last_two[:, 1:]
    step = last - windows.last_two[:, :1]
    count = np.arange(1.0, 6)[:, None, None]
    np.testing.assert_allclose(found[ZERO], np.broadcast_to(last, windows.truth.shape), atol=1e-9)
    np.testing.assert_allclose(found[CONSTANT + OF_JOINTS], last + count * step, atol=1e-9)
    np.testing.assert_allclose(found[DAMPED], found[ZERO], atol=1e-6)
    np.testing.assert_allclose(found[DAMPED + OF_JOINTS], last + count * step[:, :, :1], atol=1e-9)
    # bones keep their lengths where rotations turn on, and the root goes on in a line
    joint = windows.skeleton.places["lfemur"]
    parent = windows.skeleton.joints[joint].parent
    lengths = np.linalg.norm(found[CONSTANT][:, :, joint] - found[CONSTANT][:, :, parent], axis=-1)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=1e-9)
    np.testing.assert_allclose(found[CONSTANT][:, :, 0], (last + count * step)[:, :, 0], atol=1e-9)
    first, _ = apart(found[CONSTANT], windows.truth)
    still, _ = apart(found[ZERO], windows.truth)
    assert (first[:, 0] < still[:, 0]).all()  # a walk goes on


def test_distances_are_those_of_the_world_and_of_the_root() -> None:
    truth = np.zeros((2, 3, 3))
    found = truth + np.array([3.0, 4.0, 0.0])
    world, pose = apart(found, truth)
    np.testing.assert_allclose((world, pose), ([5.0, 5.0], [0.0, 0.0]))
    found[:, 1, 2] += 12.0
    np.testing.assert_allclose(apart(found, truth), ([(5 + 13 + 5) / 3] * 2, [4.0, 4.0]))
    with pytest.raises(DataError, match="no motion is long enough"):
        Windows.of([], 5)


def test_decays_of_recorded_motions_are_chosen_on_those_not_held_out(tmp_path: Path) -> None:
    walk = read_motion(CMU_FOLDER / "39_14.amc").scaled(0.01)
    still = replace(walk, values=np.repeat(walk.values[:1], 240, axis=0))
    records = [Record(name, name, motion, ()) for name, motion in (("a_1", walk), ("b_1", walk), ("c_1", still))]
    store = prepare(records, tmp_path / "store", VECTORS)
    names = [entry.name for entry in store.records]
    found = chosen(store, names[1:], 30.0, 10)
    path, rest = found[DAMPED]
    assert set(found) == {DAMPED, DAMPED + OF_JOINTS}
    assert path.min() > 0.8  # the root of a walk goes on
    assert rest.min() < path.min()  # its limbs turn back
    assert not np.any(list(chosen(store, names[:2], 30.0, 10).values()))  # of who stands still nothing goes on
    windows = predict_floors.training_windows(store, names[1:], 30.0, 10)
    assert all(len(window) == 12 for window in windows)
    measured = Windows.of(windows, 10)
    everything = floors(measured, found)
    errors = {name: apart(said, measured.truth)[0].mean(axis=0) for name, said in everything.items()}
    assert (errors[DAMPED] <= errors[ZERO] + 1e-9).all()
    assert np.isfinite(places(windows[0])).all()
    assert store.skeletons[0].names == HUMANOID.names
