"""Motions to frames and back, in every representation; contracts that are read from JSON."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from figures import walker

from motet.bundle.fields import Fields
from motet.bundle.manifest import read_contract
from motet.errors import BundleError, MotionError
from motet.formats import read_motion, write_motion
from motet.motion import Joint, Motion, Skeleton, heading, mirror, positions
from motet.motion.kinematics import euler_of, local_rotations
from motet.representation.contract import LIVING_STD, REPRESENTATIONS, Z_LIMIT, MotionContract, living, named, sequences

NAMES = tuple(REPRESENTATIONS)


def contract_of(name: str, motion: Motion) -> MotionContract:
    """A contract at 10 fps whose channels are those of a motion's features."""
    first = next(sequences(name, motion, 10.0))
    mean, std = first.values.mean(axis=0), living(first.values.std(axis=0), first.units)
    return MotionContract(name, first.channels, first.units, 10.0, mean, std, first.skeleton)


def turned_axes(motion: Motion, **change: Any) -> Motion:
    """The same poses of the same bones, with every joint in another order or about other axes."""
    skeleton = motion.skeleton
    assert skeleton is not None
    joints = tuple(replace(joint, **change) for joint in skeleton.joints)
    values = np.array(motion.values)
    rotations = local_rotations(motion)
    for name, columns in motion.rotation_columns().items():
        place = skeleton.index(name)
        values[:, columns] = np.degrees(euler_of(rotations[:, place], joints[place]))
    return replace(motion, values=values, skeleton=replace(skeleton, joints=joints))


@pytest.mark.parametrize("name", NAMES)
def test_training_and_inference_see_the_same_frames(name: str, clips: Path) -> None:
    motion = read_motion(clips / "39_14.amc")
    contract = contract_of(name, motion)
    phases = list(sequences(name, motion, 10.0))
    assert len(phases) == 12
    for offset in (0, 5, 11):
        found = contract.frames(motion[offset:])
        np.testing.assert_allclose(found, phases[offset].values, atol=1e-9)
    np.testing.assert_allclose(contract.frames(contract.features(phases[0].values)), phases[0].values, atol=1e-12)


@pytest.mark.parametrize("name", ["root_angles", "root_vectors"])
def test_frames_come_back_as_a_motion_from_the_origin_or_after_another(name: str, tmp_path: Path) -> None:
    whole = walker(200, fps=40.0).resample(10.0)
    contract = contract_of(name, whole)
    frames = contract.frames(whole)
    found = contract.motion(frames, plant=False)
    np.testing.assert_allclose(positions(found)[0, 0, [0, 2]], 0, atol=1e-12)
    assert heading(found)[0] == pytest.approx(0, abs=1e-9)
    # the same figure, on another place and facing another way
    gap = positions(whole) - positions(whole)[:, :1]
    back = positions(found) - positions(found)[:, :1]
    np.testing.assert_allclose(np.linalg.norm(back, axis=-1), np.linalg.norm(gap, axis=-1), atol=1e-9)
    following = contract.motion(frames[20:], after=whole[:20], plant=False)
    np.testing.assert_allclose(positions(following), positions(whole[20:]), atol=1e-9)
    for number, motion in enumerate((found, following)):
        write_motion(tmp_path / f"{number}.bvh", motion)
        np.testing.assert_allclose(positions(read_motion(tmp_path / f"{number}.bvh")), positions(motion), atol=1e-6)


def test_vectors_of_joints_are_not_planted() -> None:
    motion = walker(80)
    contract = contract_of("root_vectors", motion)
    frames = contract.frames(motion)
    np.testing.assert_array_equal(contract.motion(frames).values, contract.motion(frames, plant=False).values)


def test_angles_get_a_path_and_stay_in_place_when_asked(clips: Path) -> None:
    motion = read_motion(clips / "39_14.amc")
    contract = contract_of("angles", motion)
    assert not any(name.startswith("root.") for name in contract.channels)
    laid = contract.motion(contract.frames(motion))
    assert laid.channels[:3] == ("root.tx", "root.ty", "root.tz")
    travelled = np.linalg.norm(np.diff(positions(laid)[:, 0, [0, 2]], axis=0), axis=1).sum()
    assert travelled > 1  # metres: the contract's skeleton is in the file's unit, which is longer than a centimetre
    np.testing.assert_array_equal(contract.motion(contract.frames(motion), plant=False).values, contract.frames(motion))


@pytest.mark.parametrize("trial", ["02_06", "09_07", "39_14"])
@pytest.mark.parametrize("name", NAMES)
def test_frames_are_mirrored_by_columns_as_motions_are(name: str, trial: str, clips: Path) -> None:
    motion = read_motion(clips / f"{trial}.amc")
    contract = contract_of(name, motion)
    frames, expected = contract.frames(motion), contract.frames(mirror(motion))
    np.testing.assert_allclose(contract.mirror(frames), expected, atol=1e-9)
    np.testing.assert_array_equal(contract.mirror(contract.mirror(frames)), frames)
    assert np.abs(contract.mirror(frames) - frames).max() > 0.1


@pytest.mark.parametrize("change", [{"order": "yzx"}, {"axis": (10.0, 20.0, -30.0)}])
@pytest.mark.parametrize("name", NAMES)
def test_other_axes_and_orders_give_the_same_frames(name: str, change: dict[str, Any]) -> None:
    motion = walker(80)
    contract = contract_of(name, motion)
    other = turned_axes(motion, **change)
    np.testing.assert_allclose(positions(other), positions(motion), atol=1e-9)
    assert np.abs(other.values - motion.values).max() > 10
    found, expected = contract.frames(other), contract.frames(motion)
    # whole turns of the first frame's angles are a file's own affair
    turn = np.array([{"deg": 360.0, "rad": 2 * np.pi}.get(unit, 1e9) for unit in contract.units])
    off = found - expected
    np.testing.assert_allclose(off - turn * np.round(off[:1] / turn), 0, atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_bones_that_point_elsewhere_at_rest_are_refused(name: str) -> None:
    motion = walker(80)
    contract, skeleton = contract_of(name, motion), motion.skeleton
    assert skeleton is not None

    def with_arm(offset: tuple[float, float, float]) -> Motion:
        joints = [replace(j, offset=offset) if j.name == "left_shin" else j for j in skeleton.joints]
        return replace(motion, skeleton=replace(skeleton, joints=tuple(joints)))

    contract.frames(with_arm((0.1, -0.42, 0.1)))
    with pytest.raises(MotionError, match="the bone to 'left_shin' points 90 degrees away"):
        contract.frames(with_arm((0.42, 0.0, 0.0)))


def test_lengths_below_the_root_become_metres() -> None:
    motion = walker(80, scale=100.0, metres_per_unit=0.01)
    stretched = replace(
        motion,
        values=np.column_stack([motion.values, np.full(80, 30.0)]),
        channels=(*motion.channels, "spine.ty"),
        units=(*motion.units, "length"),
    )
    contract = contract_of("root_angles", stretched)
    assert contract.units[contract.channels.index("spine.ty")] == "m"
    np.testing.assert_allclose(contract.frames(stretched)[:, contract.channels.index("spine.ty")], 0.3)
    assert contract.skeleton is not None
    metric = replace(contract, skeleton=contract.skeleton.scaled(1.0))
    found = metric.motion(metric.frames(stretched), plant=False)
    size, expected = (np.ptp(positions(m)[0, :, 1]) for m in (found, stretched.resample(10)))
    assert size == pytest.approx(expected / 100)


def test_dead_channels_and_values_far_off_do_not_reach_a_net() -> None:
    motion = walker(80)
    contract = contract_of("root_angles", motion)
    std = np.array(contract.std)
    std[7] = 0.0
    contract = replace(contract, std=std)
    frames = contract.frames(motion)
    z = contract.normalised(frames)
    live = std > 0
    np.testing.assert_allclose(z[:, live], ((frames - contract.mean) / np.where(live, std, 1))[:, live])
    frames = np.array(frames)
    frames[:, 7] += 8.0
    frames[0, 8] += 1e6
    again = contract.normalised(frames)
    np.testing.assert_array_equal(again[1:], z[1:])
    assert again[0, 8] == Z_LIMIT
    back = contract.denormalised(z)
    np.testing.assert_array_equal(back[:, 7], contract.mean[7])
    np.testing.assert_allclose(back[:, live], contract.frames(motion)[:, live])


def test_the_floor_depends_on_the_unit() -> None:
    units = tuple(LIVING_STD)
    floors = np.array(list(LIVING_STD.values()))
    np.testing.assert_array_equal(living(floors, units), floors)
    assert not living(floors * 0.99, units).any()


@pytest.mark.parametrize("name", NAMES)
def test_a_contract_comes_back_from_json(name: str) -> None:
    contract = contract_of(name, walker(80))
    again = read_contract(Fields(contract.to_json(), "motion"))
    assert (again.representation, again.channels, again.units, again.fps, again.skeleton) == (
        contract.representation,
        contract.channels,
        contract.units,
        contract.fps,
        contract.skeleton,
    )
    np.testing.assert_allclose(again.std, contract.std, atol=1e-9)
    with pytest.raises(BundleError, match="must be one of angles, root_angles, root_sixd, root_vectors, not 'smpl'"):
        named("smpl")


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("representation", "smpl", "motion.representation: must be one of angles"),
        ("representation", ["angles"], "motion.representation: must be a string"),
        ("channels", ["a", 1], "motion.channels: must be a list of strings"),
        ("channels", "abc", "motion.channels: must be a list"),
        ("channels", ["a", "b"], "motion.channels: root_angles needs root.forward"),
        ("channels", ["a"] * 24, "motion.channels: holds a string twice"),
        ("units", ["deg"], "motion.units: must be one of deg, .* for each of 24 channels"),
        ("units", ["feet"] * 24, "motion.units: must be one of deg"),
        ("units", [["deg"]] * 24, "motion.units: must be one of deg"),
        ("fps", float("nan"), "motion.fps: must be a number between 1 and 1000"),
        ("fps", 1e9, "motion.fps: must be a number between 1 and 1000"),
        ("fps", True, "motion.fps: must be a number"),
        ("fps", "25", "motion.fps: must be a number"),
        ("mean", None, "motion.mean: must be a list"),
        ("mean", [0.0, 1.0], "motion.mean: must hold 24 numbers, not 2"),
        ("mean", [10**400] * 24, "motion.mean: must be numbers between"),
        ("std", [-1.0] * 24, "motion.std: must be numbers between 0"),
        ("skeleton", {"joints": []}, "motion.skeleton.joints: must be a skeleton with the joints of all channels"),
        ("skeleton", [], "motion.skeleton: must be an object"),
    ],
)
def test_a_contract_that_is_none_names_the_key(key: str, value: Any, reason: str) -> None:
    data = contract_of("root_angles", walker(80)).to_json()
    assert len(data["channels"]) == 24
    with pytest.raises(BundleError, match=reason):
        read_contract(Fields({**data, key: value}, "motion"))


@pytest.mark.parametrize(
    "change",
    [{"parent": 1.5}, {"offset": [0, 0, float("nan")]}, {"offset": [0, 0]}, {"order": "xyx"}, {"parent": 99}],
)
def test_a_skeleton_that_is_none_is_refused(change: dict[str, Any]) -> None:
    data = contract_of("angles", walker(80)).to_json()
    data["skeleton"]["joints"][2] |= change
    with pytest.raises(BundleError, match=r"manifest, motion\.skeleton"):
        read_contract(Fields(data, "motion"))
    with pytest.raises(MotionError, match="positive number of metres, not -1"):
        Skeleton((Joint("a", -1, (0, 0, 0)),), -1.0)
