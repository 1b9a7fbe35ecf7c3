"""Text files of exponential maps, the protocol that is measured on them, and windows of training data."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from stores import prepare

from motet.errors import FormatError
from motet.figures.humanoid.bones import HUMANOID
from motet.formats import read_motion
from motet.motion.kinematics import heading, positions
from motet.motion.mirroring import mirror
from motet.motion.motion import Motion
from motet.motion.rotations import (
    continuous_rotvec,
    euler_to_rotmat,
    rotmat_to_euler,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
)
from motet.representation.contract import MotionContract, named
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material, Windows, store_material
from motet_train.data.preparation import FULL, VECTORS, Preparation
from motet_train.data.store import Store, split
from motet_train.models.kinematics import VectorPoints, vector_figure_of
from motet_train.papers.li2018.expmap import (
    CMU_LAYOUT,
    H36M_LAYOUT,
    Scaling,
    _mirrored_columns,
    expmap_material,
    is_expmap,
    parse,
    read_expmap,
    scaling_of,
)
from motet_train.papers.li2018.protocol import (
    REPORTED,
    errors,
    euler_frames,
    predictions,
    rotation_errors,
    rotmat_to_protocol_euler,
    true_times,
    window_errors,
    window_starts,
    windows,
    zero_velocity,
)


def write_files(folder: Path, frames: int = 200, actions: tuple[str, ...] = ("walking", "running")) -> Path:
    """A corpus of two training files and a test file for each action; three joints do not move."""
    rng = np.random.default_rng(0)
    for action in actions:
        for name in (f"train/{action}/{action}_1", f"train/{action}/{action}_2", f"test/{action}/{action}_1"):
            phase = rng.uniform(0, 6, 117)
            values = 0.3 * np.sin(np.arange(frames)[:, None] * np.linspace(0.02, 0.05, 117) + phase)
            values[:, -9:] = 0.25
            path = folder / f"{name}.txt"
            path.parent.mkdir(parents=True, exist_ok=True)
            np.savetxt(path, values, delimiter=",", fmt="%.7f")
    return folder


def test_rotations_are_scipys() -> None:
    vectors = np.random.default_rng(0).normal(size=(500, 3))
    vectors[0] = 0
    matrices = rotvec_to_rotmat(vectors)
    np.testing.assert_allclose(matrices, Rotation.from_rotvec(vectors).as_matrix(), atol=1e-12)
    expected = Rotation.from_matrix(matrices).as_rotvec()
    np.testing.assert_allclose(rotmat_to_rotvec(matrices), expected, atol=1e-9)
    # the protocol's formula: the angles of Rz Ry Rx = the transposed matrix, the one about x first
    angles = rotmat_to_protocol_euler(matrices)
    np.testing.assert_allclose(angles, Rotation.from_matrix(matrices).inv().as_euler("xyz"), atol=1e-9)
    np.testing.assert_allclose(angles, -rotmat_to_euler(matrices, "xyz"), atol=1e-9)


@pytest.mark.parametrize(("sign", "first"), [(1.0, 0.0), (-1.0, np.pi)])
def test_gimbal_lock_is_as_in_the_code_of_the_papers(sign: float, first: float) -> None:
    matrix = np.array([[0.0, 0.0, sign], [0.6, 0.8, 0.0], [-sign * 0.8, sign * 0.6, 0.0]])
    np.testing.assert_allclose(rotmat_to_protocol_euler(matrix), [first, -sign * np.pi / 2, 0.0], atol=1e-12)


@pytest.mark.parametrize(
    ("length", "starts"),
    [
        (180, [2, 102, 47, 12, 51, 33, 43, 60]),
        (82, [2, 6, 4, 3, 1, 3, 1, 4]),
        (299, [130, 102, 47, 140, 51, 33, 171, 105]),
        (1043, [386, 358, 47, 140, 819, 289, 939, 105]),
        (1377, [1071, 1164, 939, 1129, 316, 644, 288, 185]),
    ],
)
def test_windows_begin_where_the_protocol_says(length: int, starts: list[int]) -> None:
    assert [start for _, start in window_starts([length])] == starts


def test_windows_of_two_motions_are_drawn_in_turn_from_one_generator() -> None:
    """As ``find_indices_srnn`` of the papers' code does for the two trials of an action of Human3.6M."""
    lengths, generator = (1800, 2222), np.random.RandomState(1234567890)
    expected = []
    for _ in range(4):
        expected.append((0, generator.randint(16, lengths[0] - 50 - 100)))
        expected.append((1, generator.randint(16, lengths[1] - 50 - 100)))
    starts = window_starts(lengths, 8, H36M_LAYOUT.first, H36M_LAYOUT.room)
    assert starts == expected
    motions = [motion + np.arange(2 * length)[:, None] for motion, length in zip((0, 10_000), lengths, strict=True)]
    drawn = windows(motions, 8, H36M_LAYOUT)
    assert drawn.shape == (8, 75, 1)
    assert [int(window[0, 0]) for window in drawn] == [10_000 * motion + 2 * start for motion, start in expected]
    with pytest.raises(DataError, match="of 166 frames is too short: windows need more than 166"):
        window_starts((166, 900), 8, 16, 150)


def test_a_mirrored_pose_of_human36m_has_left_and_right_exchanged() -> None:
    """By the bones of Martinez et al. 2017: the hips lie along x, and the arms' bones along y, on both sides."""
    columns, signs = (np.array(values) for values in _mirrored_columns(H36M_LAYOUT))
    frame = np.random.default_rng(0).normal(size=99)
    mirrored = frame[columns] * signs
    flip = np.diag([-1.0, 1.0, 1.0])

    def turned(vector: np.ndarray) -> np.ndarray:
        return Rotation.from_rotvec(vector).as_matrix()

    for joint, other in ((1, 6), (8, 3), (12, 12), (17, 25), (30, 22)):
        own, across = (3 + 3 * one for one in (joint, other))
        np.testing.assert_allclose(
            turned(mirrored[own : own + 3]), flip @ turned(frame[across : across + 3]) @ flip, atol=1e-12
        )
    np.testing.assert_allclose(mirrored[columns] * signs, frame)


def test_times_are_those_of_the_files() -> None:
    assert [round(time) for time in true_times(CMU_LAYOUT.fps)] == [33, 67, 133, 167, 233, 417]
    assert true_times(H36M_LAYOUT.fps)[-1] == 1000.0


def test_the_error_is_the_literal_one() -> None:
    rng = np.random.default_rng(1)
    truth, predicted = rng.normal(size=(2, 75, 12)), rng.normal(size=(2, 25, 12))
    truth[:, :, 9:] = truth[:, :1, 9:]  # a joint that does not move is not counted
    found = window_errors(predicted, truth)
    for window in range(2):
        for frame in range(25):
            total = 0.0
            for joint in range(1, 3):
                vectors = [predicted[window, frame], truth[window, 50 + frame]]
                one, other = (
                    Rotation.from_rotvec(v[3 + 3 * joint : 6 + 3 * joint]).inv().as_euler("xyz") for v in vectors
                )
                total += float(((one - other) ** 2).sum()) if joint < 2 else 0.0
            assert found[window, frame] == pytest.approx(np.sqrt(total))
    assert not euler_frames(truth)[..., :6].any()


def test_the_rotation_error_is_scipys_angle_and_does_not_leap_at_gimbal_lock() -> None:
    rng = np.random.default_rng(1)
    truth, predicted = rng.normal(size=(2, 75, 15)), rng.normal(size=(2, 25, 15))
    truth[:, :, 12:] = truth[:, :1, 12:]  # a joint that does not move is not counted
    found = rotation_errors(predicted, truth)
    for window, frame in np.ndindex(2, 25):
        vectors = [predicted[window, frame], truth[window, 50 + frame]]
        one, other = (Rotation.from_rotvec(v.reshape(-1, 3)[2:4]) for v in vectors)
        assert found[window, frame] == pytest.approx(np.degrees((one.inv() * other).magnitude()).mean())
    before, after = np.zeros((2, 1, 75, 9))
    for frames, angle in ((before, np.pi / 2 - 0.02), (after, np.pi / 2 + 0.02)):
        turns = Rotation.from_euler("xyz", [[0.01 * n, angle, 0.5] for n in range(75)]).inv()
        frames[0, :, 6:] = turns.as_rotvec()
    np.testing.assert_allclose(rotation_errors(after[:, 50:], before), np.degrees(0.04), rtol=1e-6)
    assert window_errors(after[:, 50:], before).min() > 3


def test_a_perfect_prediction_has_no_error_and_zero_velocity_grows() -> None:
    motion = 0.2 * np.sin(np.arange(400)[:, None] * np.linspace(0.01, 0.03, 117))
    scaling = Scaling(motion.mean(0), motion.std(0), tuple(range(117)))
    truth = iter([windows([motion])])
    perfect = errors(predictions(lambda seed: next(truth)[:, 50:], {"x": [motion]}, scaling))["x"]
    assert perfect.max() == pytest.approx(0, abs=1e-12)
    still = errors(predictions(zero_velocity, {"x": [motion]}, scaling))["x"]
    assert (np.diff(still[:10]) > 0).all()


def test_files_are_read_and_missing_ones_named(tmp_path: Path) -> None:
    corpus = read_expmap(write_files(tmp_path / "corpus"))
    assert corpus.layout is CMU_LAYOUT
    assert (list(corpus.train), list(corpus.test)) == (["running", "walking"], ["running", "walking"])
    assert len(corpus.missing) == 48 - 6
    assert "train/walking/walking_3.txt" in corpus.missing
    scaling = scaling_of(corpus.train)
    assert scaling.kept == tuple(range(108))
    frames = np.concatenate([frames for files in corpus.train.values() for frames in files.values()])
    np.testing.assert_allclose(scaling.mean, frames.mean(axis=0))
    np.testing.assert_array_equal(scaling.with_constants(np.zeros((2, 117)))[:, -9:], np.full((2, 9), scaling.mean[-1]))
    np.testing.assert_allclose(scaling.mean[-9:], 0.25)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("1,2,3", "3 numbers instead of 117"),
        (",".join("x" * 117), "'x' is not a finite number"),
        ("nan," * 116 + "1", "finite"),
    ],
)
def test_a_bad_line_is_named(tmp_path: Path, line: str, said: str) -> None:
    path = write_files(tmp_path) / "train" / "walking" / "walking_2.txt"
    lines = path.read_text().splitlines()
    lines[6] = line
    path.write_text("\n".join(lines))
    with pytest.raises(FormatError, match=rf"walking_2.txt, line 7: .*{said}"):
        read_expmap(tmp_path)


def test_what_is_no_corpus_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no exponential-map files"):
        read_expmap(tmp_path)
    assert not is_expmap(tmp_path)
    with pytest.raises(FormatError, match="no frames"):
        parse("\n", "a.txt", 117)
    with pytest.raises(DataError, match="no training files"):
        scaling_of({})
    with pytest.raises(DataError, match="of 60 frames is too short"):
        window_starts([60])


def test_windows_keep_to_the_motions_and_the_recipe(tmp_path: Path) -> None:
    material = expmap_material(read_expmap(write_files(tmp_path)))
    assert (material.stride, material.held, material.contract.fps) == (2, 6, 60.0)
    plain = Windows(material, 35).draw(20, np.random.default_rng(0)).numpy()
    cuts = [s[start : start + 69 : 2] for s in material.sequences for start in range(len(s) - 69)]
    assert all(min(np.abs(window - cut).max() for cut in cuts) == 0 for window in plain)
    changed = Windows(material, 35, warp=0.15, reverse=0.3, mirror=0.5)
    one, other = (changed.draw(20, np.random.default_rng(3)).numpy() for _ in range(2))
    np.testing.assert_array_equal(one, other)
    assert np.isfinite(one).all()
    with pytest.raises(DataError, match="shorter than a window"):
        Windows(material, 200)


def test_the_mirror_of_the_text_files_is_its_own_inverse(tmp_path: Path) -> None:
    material = expmap_material(read_expmap(write_files(tmp_path)))
    columns, signs = np.array(material.mirrored), np.array(material.signs)
    frame = np.arange(117.0)
    np.testing.assert_array_equal((frame[columns] * signs)[columns] * signs, frame)


def of_people(folder: Path, motion: Motion, people: int = 12, preparation: Preparation = VECTORS) -> Store:
    """A store in which each of some people moves in the same way."""
    records = (Record(f"{n:02}_01", f"{n:02}", motion, ()) for n in range(people))
    return prepare(records, folder / "store", preparation)


def test_motions_are_held_out_by_person_or_by_chance(tmp_path: Path) -> None:
    walk = read_motion(CMU_FOLDER / "39_14.amc")[:120]
    store = of_people(tmp_path, walk)
    names = [entry.name for entry in store.records]
    for by in ("subject", "trial"):
        about = store_material(store, "x", by).about
        assert (about["split"], about["files"]) == (by, 10)
        parts = split(store.records, 0, by)
        for part in ("test", "validation"):
            assert about[part] == [names[i] for i in getattr(parts, part)]
    alone = replace(store, records=tuple(replace(entry, subject="one") for entry in store.records))
    with pytest.raises(DataError, match="12 motions of 1 subjects are too few"):
        store_material(alone, "x")


def test_motions_become_sequences_of_the_humanoid_at_30_fps(tmp_path: Path) -> None:
    walk = read_motion(CMU_FOLDER / "39_14.amc")[:120]
    material = store_material(of_people(tmp_path, walk), "x")
    assert (material.contract.fps, material.contract.skeleton) == (30.0, HUMANOID)
    assert [len(sequence) for sequence in material.sequences] == [30] * 4 * 10
    assert [len(sequence) for sequence in material.validation] == [30] * 4
    mirrored = material.contract.mirror
    np.testing.assert_array_equal(mirrored.columns, material.mirrored)
    np.testing.assert_array_equal(mirrored.signs, material.signs)
    other = store_material(of_people(tmp_path / "mirrored", mirror(walk)), "x").sequences[0]
    np.testing.assert_allclose(mirrored(material.sequences[0]), other, atol=0.02)  # CMU's legs are not quite alike
    plain = prepare([Record("a", "a", walk, ())], tmp_path / "plain", FULL)
    with pytest.raises(DataError, match="a store of root_angles: prepare it with --for predict"):
        store_material(plain, "x")


def spun(frames: int = 240) -> Motion:
    """A walk whose left hand turns slowly past half a turn."""
    walk = read_motion(CMU_FOLDER / "39_14.amc")[:frames]
    values = np.array(walk.values)
    values[:, walk.channels.index("lhand.rx")] = 0
    values[:, walk.channels.index("lhand.rz")] = np.linspace(100, 300, frames)
    return replace(walk, values=values)


def test_what_is_trained_does_not_leap_and_is_what_inference_sees(tmp_path: Path) -> None:
    motion = spun()
    material = store_material(of_people(tmp_path, motion, preparation=replace(VECTORS, humanoid=False)), "x")
    hand = material.contract.channels.index("lhand.ez")
    sequence = material.sequences[0]
    assert np.abs(np.diff(sequence[:, hand - 2 : hand + 1], axis=0)).max() < 0.3
    np.testing.assert_array_equal(sequence, material.contract.frames(motion).astype(np.float32))
    windows = Windows(material, 20, mirror=0.0, seed=10).draw(50, np.random.default_rng(0)).numpy()
    for window in windows:
        phase = next(s for s in material.sequences if (s[:, :6] == window[:1, :6]).all(axis=1).any())
        first = int(np.flatnonzero((phase[:, :6] == window[0, :6]).all(axis=1))[0])
        asked = rotmat_to_rotvec(rotvec_to_rotmat(phase[first : first + 10, hand - 2 : hand + 1].astype(np.float64)))
        expected = continuous_rotvec(asked[:, None])[:, 0]
        np.testing.assert_allclose(window[:10, hand - 2 : hand + 1], expected, atol=1e-3)


def test_velocities_are_those_of_the_motion_that_is_played_faster() -> None:
    place = np.cos(0.05 * np.arange(400)) + 0.02 * np.arange(400)
    velocity = 30 * np.diff(place, prepend=place[0])  # since the frame before
    frames = np.column_stack([place, velocity]).astype(np.float32)
    contract = MotionContract("angles", ("a", "b"), ("m", "m/s"), 30.0, np.zeros(2), np.ones(2), None)
    windows = Windows(Material(contract, [frames], np.ones(1), 1, (0, 1), rates=(1,)), 20, warp=0.4)
    drawn = windows.draw(50, np.random.default_rng(0))
    np.testing.assert_allclose(30 * drawn[..., 0].diff(dim=1), drawn[:, 1:, 1], atol=0.04)
    assert drawn[:, 0].unique(dim=0).shape[0] == 50
    assert 30 * drawn[..., 0].diff(dim=1).abs().max() > 2.3  # at its own speed it is 2.1 at most


def test_places_from_the_last_frame_are_those_of_the_runtime_turned_there(tmp_path: Path) -> None:
    store = of_people(tmp_path, read_motion(CMU_FOLDER / "02_06.amc")[:400])
    motion = store.motion(0)[:90]
    world = positions(named(store.representation).motion(motion))
    angle = heading(named(store.representation).motion(motion)[-1])[0]
    turn = euler_to_rotmat(np.array([[-angle, 0, 0]]), "yxz")[0]
    expected = (world - world[-1, 0] * (1, 0, 1)) @ turn.T
    points = VectorPoints(vector_figure_of(store.contract([0])))
    frames = torch.from_numpy(motion.values.astype(np.float32))[None]
    found = points(frames, len(world) - 1)
    np.testing.assert_allclose(found[0, :, : points.joints], expected, atol=2e-5)
    # and back, after the first frame
    back = points.frames(points.from_parents(points(frames, 9)[:, 9:]), frames[:, 9:10])
    np.testing.assert_allclose(back, frames[:, 10:], atol=5e-5)


def test_windows_along_motions_are_all_there_are(tmp_path: Path) -> None:
    material = store_material(of_people(tmp_path, spun(), preparation=replace(VECTORS, humanoid=False)), "x")
    windows = Windows(material, 20, seed=10)
    found = windows.along(material.validation[:1], 7)
    assert len(found) == len(range(0, len(material.validation[0]) - 19, 7))
    for number, window in enumerate(found):
        cut = material.validation[0][7 * number : 7 * number + 20]
        np.testing.assert_array_equal(window[:, :6], cut[:, :6])
        hand = [material.contract.channels.index(f"lhand.{kind}") for kind in ("ex", "ey", "ez")]
        assert window[9, hand].norm() <= np.pi + 1e-5
        one, other = (rotvec_to_rotmat(np.asarray(part[:, hand], np.float64)) for part in (window, cut))
        np.testing.assert_allclose(one, other, atol=1e-5)
    with pytest.raises(DataError, match="held out are all shorter"):
        windows.along([material.validation[0][:19]], 7)


def test_zero_velocity_is_the_published_one(shared: Path) -> None:
    """Reference figures of zero velocity on the protocol's eight windows."""
    corpus = read_expmap(shared / "cmu-expmap.zip")
    assert len(corpus.missing) == 10
    scaling = scaling_of(corpus.train)
    assert len(scaling.kept) == 70
    test = {action: list(files.values()) for action, files in corpus.test.items()}
    found = errors(predictions(zero_velocity, test, scaling))
    expected = {
        "basketball": [0.49, 0.82, 1.40, 1.64, 2.05, 2.83],
        "jumping": [0.36, 0.62, 1.48, 1.68, 1.99, 2.03],
        "running": [0.56, 0.99, 1.38, 1.46, 1.57, 1.54],
        "soccer": [0.27, 0.48, 0.92, 1.10, 1.36, 1.84],
        "walking": [0.41, 0.60, 0.83, 0.95, 1.09, 1.34],
        "washwindow": [0.34, 0.57, 0.90, 1.09, 1.30, 1.47],
    }
    assert {a: [round(float(error[frame]), 2) for frame in REPORTED] for a, error in found.items()} == expected
