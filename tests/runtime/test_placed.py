"""Placed frames: the same as of motions and of ``root_sixd``, seen from anywhere, mirrored, and plain ways between."""

import numpy as np
import pytest
from fake_fill import CONTRACT, glider

from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.motion.kinematics import positions
from motet.motion.mirroring import mirror as mirrored
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat, rotvec_to_rotmat
from motet.representation.placed import (
    PLACED_CHANNELS,
    ROOT_PLACE,
    bridge,
    mirror,
    placed,
    placed_by_way,
    pose_of,
    put_at,
    seen_from,
    straight,
    unplaced,
)
from motet.representation.root_sixd import rotmat_to_sixd, sixd_to_rotmat


def dancer(frames: int = 40, seed: int = 0) -> Motion:
    """The humanoid with all joints turned by smooth chance, at a random place and heading."""
    rng = np.random.default_rng(seed)
    joints = [f"{bone}.r{axis}" for bone in BONES for axis in "xyz"]
    time = np.linspace(0, 2, frames)[:, None]
    angles = 40 * np.sin(time * rng.uniform(1, 3, len(joints)) + rng.uniform(0, 6, len(joints)))
    root = rng.normal(size=3) + time * rng.normal(size=3)
    names = (*(f"hips.t{axis}" for axis in "xyz"), *joints)
    return Motion(np.column_stack([root, angles]), names, ("m",) * 3 + ("deg",) * len(joints), 30.0, HUMANOID)


def test_a_motion_comes_back_from_its_frames() -> None:
    motion = dancer()
    frames = placed(motion)
    assert frames.shape == (40, PLACED_CHANNELS)
    np.testing.assert_allclose(frames[:, :ROOT_PLACE], motion.values[:, :3], atol=1e-12)
    back = unplaced(frames[10:], motion[:10])
    assert back.channels == motion.channels
    np.testing.assert_allclose(back.values, motion.values[10:], atol=1e-6)


def test_frames_by_the_way_are_those_of_the_motion_that_plays() -> None:
    features = CONTRACT.features(CONTRACT.frames(dancer()))
    expected = placed(CONTRACT.motion(features.values, plant=False))
    batch = np.stack([features.values, CONTRACT.mirror(features.values)])
    np.testing.assert_allclose(placed_by_way(batch, 30.0)[0], expected, atol=1e-6)
    # what is mirrored before or after the way is the same
    np.testing.assert_allclose(placed_by_way(batch, 30.0)[1], mirror()(expected), atol=1e-6)


def test_mirrored_frames_are_those_of_the_mirrored_motion() -> None:
    motion = dancer()
    np.testing.assert_allclose(mirror()(placed(motion)), placed(mirrored(motion)), atol=1e-6)


def test_seen_from_a_pose_it_is_at_the_origin_and_faces_z() -> None:
    motion = dancer()
    frames = placed(motion)
    pose = pose_of(frames[7])
    seen = seen_from(frames, pose)
    np.testing.assert_allclose(pose_of(seen[7]), 0, atol=1e-12)
    np.testing.assert_allclose(put_at(seen, pose), frames, atol=1e-12)
    # all joints have moved as one body about the vertical axis
    turn = axis_to_rotmat("y", -pose[2])
    origin = np.array([pose[0], 0, pose[1]])
    expected = (positions(motion) - origin) @ turn.T
    np.testing.assert_allclose(positions(unplaced(seen, motion)), expected, atol=1e-6)


def test_a_batch_is_seen_as_each_row_alone() -> None:
    rows = np.stack([placed(dancer(seed=seed)) for seed in range(3)])
    poses = pose_of(rows[:, 5])
    for row, pose, seen in zip(rows, poses, seen_from(rows, poses), strict=True):
        np.testing.assert_array_equal(seen, seen_from(row, pose))


def test_the_facing_of_a_tilted_figure_is_the_turn_before_the_tilt() -> None:
    tilt = rotvec_to_rotmat(np.array([0.7, 0.0, 0.4]))  # about a level axis: it has no turn of its own
    frame = np.zeros(PLACED_CHANNELS)
    frame[ROOT_PLACE : ROOT_PLACE + 6] = rotmat_to_sixd(axis_to_rotmat("y", np.array(1.1)) @ tilt)
    np.testing.assert_allclose(pose_of(frame)[2], 1.1, atol=1e-12)


def test_an_even_movement_is_bridged_as_it_was() -> None:
    frames = placed(glider())
    for way in (bridge, straight):
        np.testing.assert_allclose(way(frames[:30], frames[60:], 30), frames[30:60], atol=1e-9)
    assert bridge(frames[:30], frames[30:], 0).shape == (0, PLACED_CHANNELS)


def test_the_root_leaves_and_arrives_as_fast_as_it_is_and_joints_take_the_shortest_way() -> None:
    frames = placed(dancer(60))
    past, after = frames[:20], frames[40:]
    way = np.concatenate([past[-1:], bridge(past, after, 199, pace=0.1), after[:1]])
    speeds = np.diff(way[:, :ROOT_PLACE], axis=0) / 0.1
    np.testing.assert_allclose(speeds[0], (past[-1] - past[-4])[:ROOT_PLACE] / 3, atol=2e-3)
    np.testing.assert_allclose(speeds[-1], (after[3] - after[0])[:ROOT_PLACE] / 3, atol=2e-3)
    for bone in range(len(BONES)):
        turned = sixd_to_rotmat(way[:, ROOT_PLACE + 6 * bone : ROOT_PLACE + 6 * bone + 6])
        steps = np.einsum("tij,tik->tjk", turned[:-1], turned[1:])
        np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=1e-6)


@pytest.mark.parametrize("count", [1, 5])
def test_a_line_is_even_whatever_the_speeds(count: int) -> None:
    frames = placed(dancer())
    way = np.concatenate([frames[9:10], straight(frames[:10], frames[20:], count), frames[20:21]])
    steps = np.diff(way[:, :ROOT_PLACE], axis=0)
    np.testing.assert_allclose(steps, np.broadcast_to(steps[0], steps.shape), atol=1e-9)
