"""Figures on ground that is not flat: feet on it, legs that bend as legs do, hips that follow."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import motet
from motet.errors import ControlError
from motet.figures.humanoid import BONES, HUMANOID, LEG, SOLE, limb_of
from motet.motion.rotations import Array, quat_rotated
from motet.steering.model import SteerModel
from motet.steering.pose import Pose

Ground = Callable[[Array, Array], Array]

SLOPE = float(np.tan(np.radians(20)))


def flat(x: Array, z: Array) -> Array:
    return 0 * x


def uphill(x: Array, z: Array) -> Array:
    return SLOPE * np.clip(z - 1, 0, 5)


def downhill(x: Array, z: Array) -> Array:
    return -uphill(x, z)


def stairs(x: Array, z: Array) -> Array:
    """Twelve steps of 17 cm, 29 cm deep."""
    return 0.17 * np.clip(np.floor((z - 1) / 0.29) + 1, 0, 12)


def stairs_down(x: Array, z: Array) -> Array:
    return -stairs(x, z)


@pytest.fixture(scope="module")
def model() -> SteerModel:
    return motet.load("control")


def walked(model: SteerModel, ground: Ground | None, seconds: float = 6.0, speed: float = 1.2) -> list[Pose]:
    """Four figures side by side that walk along z, each elsewhere in its step where the ground changes."""
    session = model.start(characters=4)
    session.put([(x, 0.2 * x, 0) for x in range(4)])
    session.set_ground(ground)
    session.control(gait="walk", speed=speed, direction=0)
    return [session.tick() for _ in range(round(seconds * model.fps))]


def soles(pose: Pose) -> Array:
    """Points of the soles (B, 2, 3, 3): of the left and the right foot heel, ball and tip."""
    rotations, places = pose.global_transforms()
    feet = list[Array]()
    for side in ("left", "right"):
        points = list[Array]()
        for bone in limb_of(side, LEG[2:]):
            joint = HUMANOID.index(bone)
            for point in SOLE[bone.removeprefix(side)]:
                points.append(places[:, joint] + quat_rotated(rotations[:, joint].astype(np.float64), np.array(point)))
        feet.append(np.stack(points, axis=1))
    return np.stack(feet, axis=1)


def test_flat_ground_changes_nothing(model: SteerModel) -> None:
    for plane, pose in zip(walked(model, None, 2.0), walked(model, flat, 2.0), strict=True):
        np.testing.assert_allclose(pose.positions(), plane.positions(), atol=1e-5)
        assert np.array_equal(pose.ground, plane.ground)


@pytest.mark.parametrize("ground", [uphill, downhill, stairs, stairs_down])
def test_feet_stand_on_the_ground_and_no_joint_leaps(model: SteerModel, ground: Ground) -> None:
    poses = walked(model, ground)
    points = np.stack([soles(pose) for pose in poses])
    above = points[..., 1] - ground(points[..., 0], points[..., 2])
    lowest = above.min(axis=-1)
    stands = np.stack([pose.contacts for pose in poses]) > 0.5
    assert abs(ground(np.zeros(1), np.array([poses[-1].ground[0, 1]]))).item() > 0.8
    # centimetres, as on the plane, where feet that begin to leave count, too
    assert 100 * lowest[stands].mean() == pytest.approx(0.7, abs=0.5)
    # in the ground only where a foot stands beyond the edge of a step, to rounding
    assert (lowest < -0.02).mean() < 0.01
    rotations = np.stack([pose.rotations for pose in poses]).astype(np.float64)
    cosines = np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1)).clip(max=1)
    assert np.degrees(2 * np.arccos(cosines)).max() < 35
    # hips follow without a jolt, metres a second squared
    height = np.stack([pose.height for pose in poses]).astype(np.float64)
    assert np.abs(np.diff(height, 2, axis=0)).max() * model.fps**2 < 45


def test_a_foot_that_stands_lies_on_its_slope(model: SteerModel) -> None:
    session = model.start(characters=2)
    session.put([(0.0, 3.0, 0), (1.0, 3.0, 90)])
    session.set_ground(uphill)
    for _ in range(30):
        pose = session.tick()
    heel, ball, _ = soles(pose).transpose(2, 0, 1, 3)
    along = ball - heel
    # up the slope, and across it
    rise = along[..., 1] / np.hypot(along[..., 0], along[..., 2])
    np.testing.assert_allclose(rise[0], SLOPE, atol=0.05)
    np.testing.assert_allclose(rise[1], 0, atol=0.08)


def test_uphill_is_slower(model: SteerModel) -> None:
    fast = walked(model, uphill)[90:150]
    moved = fast[-1].ground[:, 1] - fast[0].ground[:, 1]
    assert moved / (59 / model.fps) == pytest.approx(1.2 / (1 + 0.7 * SLOPE), rel=0.06)
    down = walked(model, downhill)[90:150]
    assert (down[-1].ground[:, 1] - down[0].ground[:, 1]) / (59 / model.fps) == pytest.approx(1.2, rel=0.06)


def test_legs_keep_their_lengths_and_heads_are_over_the_ground(model: SteerModel) -> None:
    for pose in walked(model, stairs)[::10]:
        places = pose.positions()
        for side in ("left", "right"):
            upper, lower, foot, _ = (places[:, HUMANOID.index(bone)] for bone in limb_of(side, LEG))
            for first, second, bone in ((upper, lower, "LowerLeg"), (lower, foot, "Foot")):
                length = np.linalg.norm(HUMANOID.offsets[HUMANOID.index(side + bone)])
                np.testing.assert_allclose(np.linalg.norm(second - first, axis=1), length, rtol=1e-5)
        head = places[:, HUMANOID.index("head")]
        assert (head[:, 1] - stairs(head[:, 0], head[:, 2]) > 0.9).all()


def test_the_ground_can_be_taken_away_again(model: SteerModel) -> None:
    session = model.start()
    session.put((0, 4, 0))
    session.set_ground(uphill)
    raised = session.tick()
    assert raised.height[0] > 1.5
    session.set_ground(None)
    assert session.tick().height[0] < 1.1


def test_who_joins_stands_on_the_ground_at_once(model: SteerModel) -> None:
    session = model.start()
    session.set_ground(uphill)
    session.advance(0.1)
    session.add((0.0, 4.0, 0.0))
    assert session.advance(0.0).height[1] == pytest.approx(0.97 + 3 * SLOPE, abs=0.1)


def test_acts_looks_and_hands_go_on_over_stairs(model: SteerModel) -> None:
    session = model.start()
    session.put((0, 2.2, 0))
    session.set_ground(stairs)
    point = np.array([0.25, 1.9, 2.6])
    session.reach("left", point)
    session.look_at(point)
    for _ in range(60):
        pose = session.tick()
    hand = pose.positions()[0, HUMANOID.index("leftHand")]
    assert np.linalg.norm(hand - point) < 0.15
    session.act("wave")
    assert max(session.tick().positions()[0, HUMANOID.index("rightHand"), 1] for _ in range(60)) > 2.0


def raising(x: Array, z: Array) -> Array:
    raise RuntimeError("no map here")


@pytest.mark.parametrize(
    ("ground", "message"),
    [
        (raising, "failed: RuntimeError: no map here"),
        (lambda x, z: np.full(x.shape, np.nan), "gave nan at x .*, z .*: a height is a number"),
        (lambda x, z: x + np.inf, "gave inf at x"),
        (lambda x, z: 0 * x + 2e4, "within 10000 m"),
        (lambda x, z: 0.0, r"shape \(\) for places of"),
        (lambda x, z: x[:1], "shape"),
        (lambda x, z: ["low"] * len(x), "failed: ValueError"),
    ],
)
def test_ground_that_is_none_is_refused_by_the_tick(model: SteerModel, ground: Any, message: str) -> None:
    session = model.start(characters=2)
    session.set_ground(ground)
    with pytest.raises(ControlError, match=message):
        session.tick()


@pytest.mark.parametrize("ground", ["hills", 3.0, np.zeros((4, 4))])
def test_what_is_no_function_is_refused(model: SteerModel, ground: Any) -> None:
    session = model.start()
    with pytest.raises(ControlError, match="ground must be a function of x and z"):
        session.set_ground(ground)
    session.tick()


def test_a_cliff_is_fallen_from_within_the_limits_of_joints(model: SteerModel) -> None:
    poses = walked(model, lambda x, z: np.where(z < 2, 0.0, -3.0), 4.0)
    assert all(np.isfinite(pose.positions()).all() for pose in poses)
    rotations = np.stack([pose.rotations for pose in poses]).astype(np.float64)
    cosines = np.abs((rotations[1:] * rotations[:-1]).sum(axis=-1)).clip(max=1)
    assert np.degrees(2 * np.arccos(cosines))[..., [BONES.index("leftLowerLeg")]].max() < 35
    assert (poses[-1].height < -1.9).all()
