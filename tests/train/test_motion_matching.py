"""Training of a figure that is steered: rows of recordings, their mirror images, poses in few codes, the step."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from stores import prepare
from trainings import rebuilt

import motet
from motet import to_humanoid
from motet.figures.humanoid import sole_points
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.formats import read_motion
from motet.motion.kinematics import global_transforms, local_rotations, posed, positions
from motet.motion.mirroring import mirror
from motet.motion.motion import Motion
from motet.motion.rotations import Array, axis_to_rotmat
from motet.representation.contract import MotionContract, named
from motet.steering.from_clips import EVEN_CODES, ODD_CODES
from motet.steering.matching import TRAJECTORY, Matcher, Playback, Table, mirrored_features
from motet.steering.pose import Pose
from motet.steering.recorded import COLLAR_SLOPE, Recording, levelled, with_even_collars
from motet.steering.rows import MatchingRows, _leaps, mirrored_poses, rows_of
from motet.steering.settings import SteeringSettings
from motet.steering.step import PoseCodes, tick
from motet.steering.tables import DTYPE_OF_TABLE, FEATURE_STEPS, speeds_of
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.data.corpus import Record
from motet_train.data.preparation import SIXD
from motet_train.data.recorded import gaits_of, recordings
from motet_train.data.table import Gait, read_gaits
from motet_train.models.kinematics import tree_of
from motet_train.models.matching import Matching, MatchingConfig
from motet_train.recipes.matching import take


@pytest.fixture(scope="module")
def walk() -> Motion:
    return to_humanoid(read_motion(CMU_FOLDER / "39_14.amc")).motion.resample(30.0)


@pytest.fixture(scope="module")
def rows(walk: Motion) -> MatchingRows:
    return rows_of([recording(walk)], ("walk",), SteeringSettings())


def recording(motion: Motion) -> Recording:
    return Recording(named("root_sixd").features(motion), frozenset({"walk"}))


@pytest.fixture(scope="module")
def net(walk: Motion, rows: MatchingRows) -> Matching:
    features = named("root_sixd").features(walk)
    zeros = np.zeros(len(features.channels))
    contract = MotionContract("root_sixd", features.channels, features.units, 30.0, zeros, zeros + 1, HUMANOID)
    config = MatchingConfig(
        len(zeros),
        tree_of(contract),
        len(rows),
        features=rows.features.shape[1],
        gaits=("walk",),
        speeds=((0.0, 1.3, 2.0, 0.0, 0.0),),
    )
    made = Matching(config)
    take(made, rows)
    return made


def test_a_floor_that_rises_and_falls_is_made_level(walk: Motion) -> None:
    features = named("root_sixd").features(walk)
    level, height = levelled(features), features.channels.index("root.height")
    values = features.values.copy()
    values[:, height] += 0.04 * np.sin(np.arange(len(values)) / 40)
    found = levelled(replace(features, values=values))
    assert np.abs(found.values - level.values).max() < 0.004
    soles = sole_points(*global_transforms(named("root_sixd").motion(found)))
    assert np.percentile(np.abs(soles[..., 1].min(axis=1)), 90) < 0.01


@pytest.mark.parametrize("droops", [0.0, 35.0])
def test_collars_slope_alike_whoever_is_recorded_and_arms_stay(walk: Motion, droops: float) -> None:
    collars, arms = ([HUMANOID.index(side + part) for side in ("left", "right")] for part in ("Shoulder", "UpperArm"))
    local = local_rotations(walk)
    ways = axis_to_rotmat("z", np.radians([-droops, droops]))
    turned = {HUMANOID.names[joint]: way @ local[:, joint] for way, joint in zip(ways, collars, strict=True)}
    before = named("root_sixd").features(posed(walk, turned, {}))
    found = named("root_sixd").motion(with_even_collars(before))
    bones = np.einsum("tjab,jb->tja", local_rotations(found, collars), HUMANOID.offsets[arms])
    slopes = np.degrees(np.arctan2(-bones[..., 1], np.abs(bones[..., 0])))
    assert slopes.mean(axis=0) == pytest.approx(COLLAR_SLOPE, abs=0.1)
    turns, as_before = (global_transforms(motion)[0][:, arms] for motion in (found, named("root_sixd").motion(before)))
    np.testing.assert_allclose(turns, as_before, atol=1e-6)


def test_leaps_are_long_flights_and_what_is_around_them() -> None:
    flies = np.zeros(100, dtype=bool)
    flies[10:16] = flies[50:65] = True  # a running step, and half a second
    assert np.flatnonzero(_leaps(flies, 30.0)).tolist() == list(range(41, 74))


def test_rows_of_a_mirrored_recording_are_mirrored_rows(walk: Motion, rows: MatchingRows) -> None:
    other = rows_of([recording(mirror(walk))], ("walk",), SteeringSettings())
    columns, signs = mirrored_features()
    np.testing.assert_allclose(other.features, rows.features[:, columns] * signs, atol=1e-3)
    np.testing.assert_allclose(other.moves, rows.moves * (1, -1, -1), atol=1e-4)
    np.testing.assert_allclose(other.contacts, rows.contacts[:, ::-1], atol=1e-3)
    at, sign = mirrored_poses()
    quats, image = (p[:, :-1].reshape(-1, len(BONES), 4) for p in (other.poses, rows.poses[:, at] * sign))
    np.testing.assert_allclose(np.abs((quats * image).sum(axis=-1)), 1, atol=1e-5)


def test_features_say_where_the_recording_goes(walk: Motion, rows: MatchingRows) -> None:
    hips = positions(walk)[:, 0]
    far = np.linalg.norm(hips[30:, [0, 2]] - hips[:-30, [0, 2]], axis=1)
    np.testing.assert_allclose(np.hypot(*rows.features[:-30, 4:6].T), far, atol=1e-6)
    np.testing.assert_allclose(np.hypot(rows.features[:, 6], rows.features[:, 7]), 1)
    assert rows.features[0, TRAJECTORY + 3 * 0 + 1] == pytest.approx(positions(walk)[0, HUMANOID.index("leftToes"), 1])
    assert (rows.left == np.arange(len(rows))[::-1]).all()
    assert 0.3 < rows.contacts.mean() < 0.9


@torch.no_grad()
def test_more_codes_give_poses_back_more_nearly(net: Matching, rows: MatchingRows) -> None:
    true, off = rows.poses[:, :-1].reshape(len(rows), -1, 4), []
    for even, odd in ((4, 4), (12, 12), (30, 30)):
        made = Matching(replace(net.config, even=even, odd=odd))
        take(made, rows)
        quats, height = made.poses(made.codes)
        off.append(1 - np.abs((quats.numpy() * true).sum(axis=-1)).mean())
        assert np.abs(height[:, 0].numpy() - rows.poses[:, -1]).max() < 0.05
    assert off[0] > 3 * off[1] > 9 * off[2]
    assert off[2] < 1e-4


def test_points_are_those_of_the_recording(net: Matching, walk: Motion, rows: MatchingRows) -> None:
    quats = torch.from_numpy(rows.poses[:, :-1]).float().reshape(len(rows), -1, 4)
    found = net.points(quats, torch.from_numpy(rows.poses[:, -1:]).float()).numpy()
    shape = np.linalg.norm(found[:, :, None] - found[:, None], axis=-1)
    true = positions(walk)
    np.testing.assert_allclose(shape, np.linalg.norm(true[:, :, None] - true[:, None], axis=-1), atol=1e-5)
    np.testing.assert_allclose(found[..., 1], true[..., 1], atol=1e-5)


def test_codes_of_a_mirror_image_differ_by_signs(net: Matching, rows: MatchingRows) -> None:
    with torch.no_grad():
        quats, _ = net.poses(net.codes * torch.tensor([1.0] * net.config.even + [-1.0] * net.config.odd))
    at, sign = mirrored_poses()
    image = (rows.poses[:, at] * sign)[:, :-1].reshape(len(rows), -1, 4)
    assert np.abs((quats.numpy() * image).sum(axis=-1)).min() > 0.99


def test_tables_are_the_rows(net: Matching, rows: MatchingRows) -> None:
    tables = net.tables()
    assert {name: table.dtype for name, table in tables.items()} == DTYPE_OF_TABLE
    np.testing.assert_array_equal(tables["left"], rows.left)
    np.testing.assert_array_equal(tables["shows"], rows.gaits)
    np.testing.assert_allclose(tables["moves"], np.column_stack([rows.moves, rows.speed, rows.contacts]), atol=1e-5)
    features = tables["features"] / FEATURE_STEPS / tables["feature_scale"] + tables["feature_mean"]
    off = np.abs(features - rows.features) * tables["feature_scale"]
    assert off[np.abs(tables["features"]) < 127].max() <= 0.51 / FEATURE_STEPS
    poses = PoseCodes(tables["pose_mean"].astype(np.float64), tables["pose_basis"].astype(np.float64))
    quats, height = poses.decode(tables["codes"].astype(np.float64))
    with torch.no_grad():
        expected, tall = net.poses(net.codes)
    np.testing.assert_allclose(quats, expected.numpy(), atol=2e-3)
    np.testing.assert_allclose(height, tall[:, 0].numpy(), atol=2e-3)
    again, _ = poses.decode(poses.encode(quats, height))
    np.testing.assert_allclose(np.abs((again * quats).sum(axis=-1)), 1, atol=1e-4)


@pytest.fixture(scope="module")
def matcher(net: Matching) -> Matcher:
    tables = net.tables()
    frames = np.concatenate([tables["codes"], tables["moves"]], axis=1, dtype=np.float32)
    features = tables["features"].astype(np.float32) / FEATURE_STEPS
    scaling = {"mean": tables["feature_mean"], "scale": tables["feature_scale"]}
    others = {"shows": tables["shows"] > 0, "left": tables["left"].astype(np.int64), **scaling}
    return Matcher(Table.of(frames, features, net.config.odd, **others), SteeringSettings(), 30.0)


def test_a_tick_plays_the_row_and_follows_the_springs(net: Matching, matcher: Matcher, rows: MatchingRows) -> None:
    at, facing, gait = 40, 0.7, np.zeros(1, np.int64)
    speed = float(rows.speed[at])
    target = np.array([[speed * np.sin(facing), speed * np.cos(facing), facing]])
    poses = PoseCodes(*(net.tables()[f"pose_{name}"].astype(np.float64) for name in ("mean", "basis")))

    def played(wanted: Array) -> tuple[Pose, Playback]:
        playback = Playback.at(at - 1, 1, matcher.table.codes)
        playback.ticks_to_search[:] = 9
        playback.root, playback.spring = np.array([[1.0, 2.0, facing]]), target
        return tick(matcher, poses, playback, wanted, gait), playback

    pose, playback = played(target)
    expected, height = poses.decode(net.tables()["codes"][at : at + 1].astype(np.float64))
    np.testing.assert_allclose(pose.rotations, expected, atol=1e-6)
    np.testing.assert_allclose(pose.height, height, atol=1e-6)
    np.testing.assert_allclose(pose.contacts[0], rows.contacts[at], atol=1e-6)
    assert not playback.offset.any()
    np.testing.assert_allclose(playback.spring, target, atol=1e-12)  # asked for what it has
    forward, left, _ = rows.moves[at] / 30
    moved = np.linalg.norm(pose.ground[0, :2] - [1, 2])
    assert moved == pytest.approx(np.hypot(forward, left), rel=0.05)
    # asked for a stop, the springs slow down like critically damped ones
    damping, dt = 2 * np.log(2) / matcher.settings.velocity, 1 / 30
    _, stopped = played(np.array([[0.0, 0.0, facing]]))
    left_over = np.exp(-damping * dt) * (1 + damping * dt)
    np.testing.assert_allclose(stopped.spring[0, :2], target[0, :2] * left_over)


def test_a_net_is_built_from_its_manifest(net: Matching) -> None:
    assert rebuilt("motion-matching", net).config == net.config


def test_the_table_of_gaits() -> None:
    gaits = {gait.name: gait for gait in read_gaits()}
    assert next(iter(gaits)) == "walk"
    assert gaits["walk"].shown("walk turn left 90 degrees", "ACCAD_Male2")
    assert not gaits["walk"].shown("walk stealthily", "ACCAD_Male2")
    assert gaits["run"].shown("run/jog", "16")
    assert not Gait("a", ("x*",), ("y",)).shown("xa", "z")


def test_a_folder_of_clips_gives_the_rows_that_training_has(tmp_path: Path) -> None:
    """The database of SteerModel.from_clips beside that of the recipe: the same functions, by another way."""
    folder = tmp_path / "clips"
    folder.mkdir()
    records = []
    for name, gaits, fps in (("idle", ("walk", "run"), 30.0), ("run_1", ("run",), 60.0), ("walk_1", ("walk",), 120.0)):
        motion = named("root_sixd").motion(_recorded(name)).resample(fps)
        motet.write(folder / f"{name}.bvh", motion)
        records.append(Record(name, "a", read_motion(folder / f"{name}.bvh"), (), gaits=gaits))
    model = motet.SteerModel.from_clips(folder)

    # the recipe's way: a store, its recordings, their rows, and a net that is filled with them
    store = prepare(records, tmp_path / "store", SIXD)
    gaits = gaits_of(store)
    names = tuple(gait.name for gait in gaits)
    assert model.gaits == names
    stored = rows_of(recordings(store, gaits), names, SteeringSettings())
    contract = store.contract(range(len(records)))
    config = MatchingConfig(len(contract.channels), tree_of(contract), len(stored), EVEN_CODES, ODD_CODES)
    net = Matching(replace(config, features=stored.features.shape[1], gaits=names))
    take(net, stored)
    speeds = speeds_of(stored, SteeringSettings())
    np.testing.assert_allclose(model.abilities.speeds, speeds, atol=0.011)
    expected = net.tables()
    for name in ("shows", "left"):
        np.testing.assert_array_equal(model.tables[name], expected[name])
    for name, off in (("features", 1), ("moves", 1e-3), ("feature_mean", 1e-4), ("pose_mean", 1e-4)):
        np.testing.assert_allclose(model.tables[name].astype(float), expected[name].astype(float), atol=off)
    # codes have any signs, poses have not
    poses = [np.einsum("nk,kp->np", tables["codes"], tables["pose_basis"]) for tables in (model.tables, expected)]
    np.testing.assert_allclose(poses[0], poses[1], atol=0.02)


def _recorded(name: str) -> Motion:
    """Features of the shipped figure on the way."""
    scripts = {"walk_1": "walk 5s speed 1.2, turn left 90, walk 3s", "run_1": "run 5s speed 2.5", "idle": "stop 2s"}
    return named("root_sixd").features(motet.load("control").run(scripts[name]))
