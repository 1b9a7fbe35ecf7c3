"""The lock of live figures: feet turn on the ball, and are lifted where they cannot stand."""

import numpy as np
import pytest

from motet.figures.humanoid import BONES, sole_points
from motet.motion.rotations import Array, quat_to_rotmat
from motet.steering.foot_lock import FootLock, FootLockSettings
from motet.steering.pose import Pose

DT, HEIGHT = 1 / 30, 0.98


def held(steps: Array, contact: float, characters: int) -> list[Pose]:
    """Figures in the rest pose that go through places (T, 3) over the ground, x, z and facing."""
    rest = np.tile(np.array([0, 0, 0, 1], np.float32), (characters, len(BONES), 1))
    lock, poses = FootLock.none(characters), list[Pose]()
    for step in steps:
        ground, high = np.tile(step, (characters, 1)), np.full(characters, HEIGHT, np.float32)
        played = Pose(ground, rest, high, np.full((characters, 2), contact, np.float32))
        lock, pose = lock.update(played, FootLockSettings(), DT)
        poses.append(pose)
    return poses


def soles_of(steps: Array, contact: float, characters: int) -> Array:
    """Points (T, 6, 3) of the soles of the last of the figures of :func:`held`."""
    points = list[Array]()
    for pose in held(steps, contact, characters):
        turned, places = pose.global_transforms()
        points.append(sole_points(quat_to_rotmat(turned.astype(np.float64)), places)[-1])
    return np.stack(points)


@pytest.mark.parametrize("characters", [1, 3])
def test_a_foot_that_stands_turns_on_its_ball(characters: int) -> None:
    turns = np.linspace([0, 0, 0], [0, 0, 0.5], 8)
    heel, ball = soles_of(turns, 1.0, characters)[:, :2, [0, 2]].swapaxes(0, 1)
    assert np.ptp(ball, axis=0).max() < 1e-3
    assert np.ptp(heel, axis=0).max() > 0.05


@pytest.mark.parametrize("characters", [1, 3])
def test_a_foot_that_swings_although_it_should_stand_is_lifted(characters: int) -> None:
    def lifted(speed: float, contact: float, ticks: int = 20) -> float:
        goes = np.linspace([0, 0, 0], [0, speed * ticks * DT, 0], ticks + 1)
        return float(soles_of(goes, contact, characters)[-1, :, 1].min())

    assert 0.06 < lifted(2.0, 1.0) < 0.08  # legs that are straight bend less than they are asked to
    assert 0.03 < lifted(2.0, 0.5) <= 0.04
    assert 0 < lifted(2.0, 1.0, 1) < 0.03  # not at once: its knee would pop out
    assert 0.055 < lifted(2.0, 1.0, 3) < 0.068  # but before the foot is past
    assert abs(lifted(2.0, 0.0)) < 1e-6  # it may swing
    assert abs(lifted(0.2, 1.0, 5)) < 0.002  # it stands
    assert 0.05 < lifted(0.2, 0.0) < 0.053  # slowly, it would drag
    assert lifted(0.2, 0.2) < 0.01


@pytest.mark.parametrize("characters", [1, 3])
def test_a_foot_that_its_leg_does_not_reach_is_let_go(characters: int) -> None:
    # straight legs of 84 cm reach 12 cm aside with 1 % to spare
    goes = np.linspace([0, 0, 0], [0, 0.16, 0], 17)
    contacts = np.stack([pose.contacts for pose in held(goes, 1.0, characters)])
    assert (contacts[:12] == 1).all()
    assert (contacts[14:] == 0).all()
