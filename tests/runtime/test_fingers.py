"""Relaxed hands: which way fingers bend on hands of any axes, and which hands stay as they are."""

import numpy as np
import pytest
from test_retarget import angles_between, dancing

from motet.figures.humanoid.bones import LEFT_RIGHT
from motet.motion import HUMANOID, Joint, Motion, Skeleton, from_humanoid, local_rotations, positions
from motet.motion.kinematics import motion_of
from motet.motion.rotations import Array, rotvec_to_rotmat

FINGERS = {"Thumb": 0.05, "Index": 0.03, "Middle": 0.01, "Ring": -0.01, "Little": -0.03}
"""Finger -> how far before the middle of the hand it begins, in metres."""


def with_fingers(names: tuple[str, ...] = tuple(FINGERS), bend: float = 0.0) -> Skeleton:
    """The humanoid with three joints and a tip for each finger, each bent by some degrees against the one before."""
    joints = list(HUMANOID.joints)
    for side, sign in zip(LEFT_RIGHT, (1, -1), strict=True):
        for finger in names:
            parent, angle = HUMANOID.index(f"{side}Hand"), 0.0
            for number in (1, 2, 3, 4):
                x, y = (0.03, 0.0) if number > 1 else (0.09, 0.0)
                x, y = x * np.cos(angle), -x * np.sin(angle)
                joints.append(Joint(f"{side}{finger}{number}", parent, (sign * x, y, FINGERS[finger] * (number == 1))))
                parent, angle = len(joints) - 1, angle + np.radians(bend)
    return Skeleton(tuple(joints), 1.0)


def still() -> Motion:
    """The humanoid in its T-pose."""
    turns = np.broadcast_to(np.eye(3), (1, len(HUMANOID.names), 3, 3))
    return motion_of(HUMANOID, turns, {0: np.array([[0.0, 0.98, 0.0]])}, 30.0)


def bends(motion: Motion, finger: str) -> Array:
    """Degrees by which the three joints of a finger of the left bend towards the ground, palms down."""
    places, names = positions(motion)[0], motion.skeleton.names
    chain = ["leftHand", *(f"left{finger}{number}" for number in (1, 2, 3, 4))]
    bones = np.diff([places[names.index(name)] for name in chain], axis=0)
    bones[0] = [1, 0, 0]
    return np.degrees(np.diff([np.arctan2(-y, x) for x, y, _ in bones]))


def test_fingers_bend_towards_the_palm_the_little_finger_most() -> None:
    found = from_humanoid(still(), with_fingers())
    for finger, share in {"Index": 0.8, "Middle": 1.0, "Ring": 1.15, "Little": 1.3}.items():
        np.testing.assert_allclose(bends(found, finger), share * np.array([15, 25, 15]), atol=1e-6)
    places = dict(zip(found.skeleton.names, positions(found)[0], strict=True))
    for finger in FINGERS:
        np.testing.assert_allclose(places[f"right{finger}4"] * [-1, 1, 1], places[f"left{finger}4"], atol=1e-12)
    assert places["leftThumb4"][1] < places["leftThumb1"][1]
    assert places["leftThumb4"][2] < places["leftThumb1"][2]


def test_hands_stay_relaxed_in_motion_and_the_body_moves_as_it_would() -> None:
    motion, skeleton = dancing(), with_fingers()
    found, plain = from_humanoid(motion, skeleton), from_humanoid(motion, HUMANOID)
    bones = len(HUMANOID.names)
    np.testing.assert_allclose(positions(found)[:, :bones], positions(plain), atol=1e-9)
    turns = local_rotations(found)[:, bones:]
    assert angles_between(turns, turns[:1]).max() < 1e-9


@pytest.mark.parametrize("seed", [0, 1])
def test_the_axes_of_the_joints_do_not_matter(seed: int) -> None:
    skeleton, random = with_fingers(), np.random.default_rng(seed)
    axes = rotvec_to_rotmat(random.normal(size=(len(skeleton.names), 3)))
    parents = np.maximum(skeleton.parents, 0)
    offsets = np.einsum("jik,ji->jk", axes[parents], skeleton.offsets)
    offsets[0] = skeleton.offsets[0]
    joints = [Joint(j.name, j.parent, tuple(o)) for j, o in zip(skeleton.joints, offsets.tolist(), strict=True)]
    turned = Skeleton(tuple(joints), 1.0)
    like = motion_of(turned, axes[None], {0: np.array([[0.0, 0.98, 0.0]])}, 30.0)
    expected = positions(from_humanoid(dancing(), skeleton))
    np.testing.assert_allclose(positions(from_humanoid(dancing(), like)), expected, atol=1e-6)


def test_what_is_bent_at_rest_is_bent_no_more() -> None:
    np.testing.assert_allclose(bends(from_humanoid(still(), with_fingers(bend=10)), "Middle"), [15, 25, 15], atol=1e-6)
    fist = from_humanoid(still(), with_fingers(bend=60))
    for name in ("Index2", "Middle2", "Little3"):
        turn = local_rotations(fist)[0, fist.skeleton.index(f"left{name}")]
        np.testing.assert_allclose(turn, np.eye(3), atol=1e-9)


@pytest.mark.parametrize("names", [("Middle",), ("Thumb", "Middle"), ("Thumb", "Index"), ("Ring", "Little")])
def test_a_hand_whose_palm_cannot_be_told_stays(names: tuple[str, ...]) -> None:
    found = from_humanoid(still(), with_fingers(names))
    turns = local_rotations(found)[0, len(HUMANOID.names) :]
    np.testing.assert_allclose(turns, np.broadcast_to(np.eye(3), turns.shape), atol=1e-9)
