"""Steered figures that look at points and reach for them, checked by the joints' places in the world."""

from typing import Any

import numpy as np
import pytest

from motet import ControlError, SteerModel, SteerSession
from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array, conjugate, quat_rotated
from motet.steering import look_layer as looking
from motet.steering import reach_layer as reaching
from motet.steering.pose import Pose
from motet.steering.scripts import parse_orders

AROUND = [(0, 1.6, 3), (2, 1.6, 2), (-2.5, 1.2, 1.2), (1, 0, 3), (-1, 2.5, 2.5)]


def ticks(session: SteerSession, count: int) -> list[Pose]:
    return [session.tick() for _ in range(count)]


def joint(pose: Pose, name: str) -> tuple[Array, Array]:
    """Rotations (B, 4) and places (B, 3) of a joint in the world."""
    turned, places = pose.global_transforms()
    return turned[:, HUMANOID.index(name)].astype(np.float64), places[:, HUMANOID.index(name)]


def eyes(pose: Pose) -> tuple[Array, Array]:
    """Where they are and where they look, in the world."""
    turned, places = joint(pose, "head")
    return places + quat_rotated(turned, np.array(looking.EYES_OFFSET)), quat_rotated(turned, np.array([0.0, 0, 1]))


def gaze(pose: Pose) -> Array:
    """Degrees (B, 2) to the left and up, seen from the lower spine."""
    trunk, _ = joint(pose, "spine")
    x, y, z = quat_rotated(conjugate(trunk), eyes(pose)[1]).T
    return np.degrees([np.arctan2(x, z), np.arctan2(y, np.hypot(x, z))]).T


def palm(pose: Pose, hand: str) -> Array:
    wrist, tip = joint(pose, f"{hand}Hand")[1], joint(pose, f"{hand}Hand_end")[1]
    return wrist + (tip - wrist) * reaching.PALM / 0.18


def test_heads_look_at_points_while_figures_walk(steer_model: SteerModel) -> None:
    session = steer_model.start(characters=len(AROUND))
    session.control(speed=[0, 1.3, 0, 1.3, 0.8])
    session.look_at(AROUND)
    for pose in ticks(session, 60)[30:]:
        place, way = eyes(pose)
        wanted = np.array(AROUND) - place
        far = np.linalg.norm(wanted, axis=1)
        # where the head can turn to; its steps are a tick late
        inside = (np.abs(gaze(pose)) < [80, 45]).all(axis=1) & (far > 1.5)
        assert inside.any()
        assert np.degrees(np.arccos(((way * wanted).sum(axis=1) / far).clip(max=1)))[inside].max() < 1.5


def test_no_gaze_goes_farther_or_faster_than_people_turn_their_heads(steer_model: SteerModel) -> None:
    session, seen = steer_model.start(), []
    for angle in np.linspace(0, 6 * np.pi, 270):  # around the head, three times in nine seconds
        session.look_at((0.7 * np.sin(angle), 1.6, 0.7 * np.cos(angle)))
        seen.append(gaze(session.tick())[0])
    for point in [(0, 0, 0.05), (0, 9, 0.1), (0, 1.6, 0.1), (1e6, -1e6, 1e6), (0, 1.6, -1e-9)]:
        session.look_at(point)
        seen += [gaze(pose)[0] for pose in ticks(session, 20)]
    found = np.array(seen)
    assert np.abs(found[:, 0]).max() < np.degrees(looking.LookSettings().aside) + 1
    assert np.abs(found[:, 1]).max() < np.degrees(looking.LookSettings().up) + 1
    assert np.abs(np.diff(found, axis=0)).max() * steer_model.fps < 600
    assert np.ptp(found[:, 0]) > 160  # over both shoulders


def test_a_look_begins_and_ends_smoothly_and_leaves_nothing(steer_model: SteerModel) -> None:
    looks, plain = steer_model.start(), steer_model.start()
    ticks(looks, 10), ticks(plain, 10)
    looks.look_at((3, 1.6, 1))
    turned = [gaze(looks.tick())[0, 0] - gaze(plain.tick())[0, 0] for _ in range(45)]
    looks.look_at(None)
    turned += [gaze(looks.tick())[0, 0] - gaze(plain.tick())[0, 0] for _ in range(60)]
    assert turned[0] < 5
    assert max(turned) > 40
    assert np.abs(np.diff(turned, n=2)).max() < 6  # degrees a tick, each tick
    np.testing.assert_array_equal(looks.tick().rotations, plain.tick().rotations)


def test_hands_are_at_points_and_arms_keep_their_lengths(steer_model: SteerModel) -> None:
    points = np.array([(0.2, 1.3, 0.45), (0.5, 1.5, 0.2), (0.1, 1.7, 0.3), (0.3, 0.95, 0.2), (-0.1, 1.2, 0.35)])
    for hand, sign in (("left", 1), ("right", -1)):
        own = points * [sign, 1, 1]
        session, plain = (steer_model.start(characters=len(points)) for _ in range(2))
        session.reach(hand, own)  # type: ignore[arg-type]
        pose, other = ticks(session, 60)[-1], ticks(plain, 60)[-1]
        np.testing.assert_allclose(palm(pose, hand), own, atol=2e-3)
        assert not session.out_of_reach.any()
        moved = np.abs(pose.rotations - other.rotations).max(axis=(0, 2)) > 1e-6
        assert [BONES[i] for i in np.flatnonzero(moved)] == [f"{hand}UpperArm", f"{hand}LowerArm"]
        for upper, lower in (("UpperArm", "LowerArm"), ("LowerArm", "Hand")):
            bone = joint(pose, hand + upper)[1] - joint(pose, hand + lower)[1]
            assert np.linalg.norm(bone, axis=1) == pytest.approx(0.28 if upper == "UpperArm" else 0.25, abs=1e-6)


def test_a_point_out_of_reach_is_reached_for_and_told(steer_model: SteerModel) -> None:
    points = np.array([(0.3, 1.4, 5.0), (0.2, 1.3, 0.4), (0.1, 1.2, -0.5)])  # too far, near, behind the back
    session = steer_model.start(characters=3)
    session.reach("left", points)
    poses = ticks(session, 60)
    assert session.out_of_reach.tolist() == [[True, False], [False, False], [True, False]]
    shoulder, hand = joint(poses[-1], "leftUpperArm")[1][0], palm(poses[-1], "left")[0]
    along, wanted = hand - shoulder, points[0] - shoulder
    assert np.cross(along, wanted / np.linalg.norm(wanted)) == pytest.approx(0, abs=0.01)
    assert np.linalg.norm(along) > 0.58
    chest, _ = joint(poses[-1], "upperChest")
    side = quat_rotated(conjugate(chest[2:]), (palm(poses[-1], "left") - joint(poses[-1], "leftUpperArm")[1])[2:])[0]
    assert side @ [1, 0, 1] / np.sqrt(2) / np.linalg.norm(side) > np.cos(reaching.ReachSettings().widest) - 0.01
    speeds = np.linalg.norm(np.diff([palm(pose, "left") for pose in poses], axis=0), axis=2) * steer_model.fps
    assert speeds.max() < 5
    session.reach("left", None)
    assert not session.out_of_reach.any() or ticks(session, 1)
    plain = steer_model.start(characters=3)
    np.testing.assert_array_equal(ticks(session, 60)[-1].contacts, ticks(plain, 121)[-1].contacts)
    assert not session.out_of_reach.any()


def test_a_hand_follows_a_point_that_moves_at_once_and_one_that_leaps_smoothly(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.reach("right", (-0.2, 1.2, 0.4))
    ticks(session, 45)
    for t in range(30):
        point = (-0.2 - 0.01 * t, 1.2 + 0.005 * t, 0.4)
        session.reach("right", point)
        np.testing.assert_allclose(palm(session.tick(), "right")[0], point, atol=5e-3)
    session.reach("right", (0.0, 1.5, 0.35))
    hands = np.array([palm(pose, "right")[0] for pose in ticks(session, 40)])
    assert np.linalg.norm(np.diff(hands, axis=0), axis=1).max() < 0.12
    np.testing.assert_allclose(hands[-1], (0.0, 1.5, 0.35), atol=5e-3)


@pytest.mark.parametrize(
    ("points", "ids", "said"),
    [
        ((0, 1), None, "points need x, y and z, for all or for each of 3 characters"),
        ([(0, 1, 2)] * 2, None, "for each of 3 characters"),
        ([(0, 1, 2)] * 3, [0, 1], "for each of 2 characters"),
        ((0, np.nan, 1), None, "points must be finite numbers, no larger than 1e"),
        ((0, np.inf, 1), None, "points must be finite numbers"),
        ("ahead", None, "points need x, y and z"),
        ((0, 1, 2), 3, "ids must be numbers of characters from 0 to 2, none twice, not 3"),
        ((0, 1, 2), [0, 0], "none twice"),
        ((0, 1, 2), [], "ids must be numbers"),
        ((0, 1, 2), [True, False, True], "ids must be numbers"),
        ((0, 1, 2), "first", "ids must be numbers"),
    ],
)
def test_points_that_make_no_sense_are_refused(steer_model: SteerModel, points: Any, ids: Any, said: str) -> None:
    session = steer_model.start(characters=3)
    before = session.snapshot()
    with pytest.raises(ControlError, match=said):
        session.look_at(points, ids=ids)
    with pytest.raises(ControlError, match=said):
        session.reach("left", points, ids=ids)
    assert session.snapshot().look is before.look
    assert session.snapshot().left is before.left
    with pytest.raises(ControlError, match="unknown hand 'both'; expected left or right"):
        session.reach("both", (0, 1, 2))  # type: ignore[arg-type]


def test_a_script_sends_a_figure_to_a_point(steer_model: SteerModel) -> None:
    session = steer_model.start()
    poses = list(session.follow(parse_orders("walk 1s, go to 1 3 facing 90 8s, stop 1s", steer_model.gaits)))
    assert len(poses) == 300
    x, z, facing = poses[-1].ground[0]
    assert np.hypot(x - 1, z - 3) < 0.1
    assert abs(np.degrees(facing) - 90) < 10
