"""The arms of a drawn act: hands at places on the body, elbows to their sides, palms and fingers as they face.

Letters in shapes: T frames. The arm's bones lie along x: to +x on the left side, palms down.
"""

from typing import NamedTuple

import numpy as np

from motet.errors import MotionError
from motet.figures.feet.contacts import rise
from motet.figures.humanoid import ARM, BONES, HUMANOID, LEFT_RIGHT, LEG, NECK, SPINE, limb_of, sided
from motet.keyed.draw import Drawn, HandPose, HandTrack
from motet.keyed.parts import FLOOR, OTHER_HAND, PLACES, SIDE_OF_HAND, TOUCHES, Place
from motet.keyed.trunk import Figure
from motet.motion.rotations import (
    Array,
    axis_to_rotmat,
    continuous_rotvec,
    inverse,
    product,
    rotated,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    twist,
    unit,
)

TRUNK_CHAIN = ("hips", *SPINE)

UPPER_ARM = float(np.linalg.norm(HUMANOID.offsets[HUMANOID.index("leftLowerArm")]))
FOREARM = float(np.linalg.norm(HUMANOID.offsets[HUMANOID.index("leftHand")]))

STRAIGHT_SHARE = 0.999
"""Share of its length to which an arm stretches."""

BEYOND = 0.08
"""Metres by which a place may be out of reach: the arm is stretched towards it then."""

SHOULDER_RISES = 18.0
"""Degrees by which a shoulder rises for a hand that is raised as high as it goes."""

FOREARM_TWISTS = 0.6
"""The share of a hand's twist that the forearm takes."""

WRIST_BENDS = np.radians(80)
"""The largest bend of a wrist."""


class Arm(NamedTuple):
    """The rotations of an arm in the world (T, 3, 3), of the forearm without its twist."""

    upper: Array
    lower: Array
    hand: Array


def with_hands(figure: Figure, act: Drawn, name: str) -> Figure:
    """The figure with its hands where keys want them, or as near as they can.

    name: of the act, for the MotionError for a place that no hand reaches; "" for none.
    """
    # a hand that goes to the other one comes after it
    order = sorted(act.hands, key=lambda hand: any(pose.place == OTHER_HAND for pose in act.hands[hand].poses))
    for hand in order:
        side = hand.removesuffix("_hand")
        sign = SIDE_OF_HAND[hand]
        figure = _with_shoulder(figure, act.hands[hand], side, sign)
        figure = _with_hand(figure, act.hands[hand], side, sign, f"{name}, {hand}" if name else "")
    return figure


def _with_shoulder(figure: Figure, track: HandTrack, side: str, sign: float) -> Figure:
    """The figure with a shoulder that rises for a hand above it."""
    bone = sided(side, ARM[0])
    _, places = figure.chain((*TRUNK_CHAIN, *limb_of(side, ARM[:2])))
    shoulder = places[:, 5]
    heights = np.stack([(_place(figure, pose, side, sign) - shoulder)[:, 1] for pose in track.poses])
    height = track.mixed(heights)
    raised = track.weight * rise(height, 0, UPPER_ARM + FOREARM)
    turn = axis_to_rotmat("z", sign * np.radians(SHOULDER_RISES) * raised)
    return figure.with_local({bone: product(turn, figure.local[:, BONES.index(bone)])})


def _with_hand(figure: Figure, track: HandTrack, side: str, sign: float, name: str) -> Figure:
    bones = (*TRUNK_CHAIN, *limb_of(side, ARM))
    rotations, places = figure.chain(bones)
    chest, parent, *arm = (rotations[:, joint] for joint in range(3, len(bones)))
    shoulder = places[:, 5]

    wrists = np.stack([_wrist(figure, pose, side, sign, shoulder, chest) for pose in track.poses])
    if name:
        _check_reach(wrists, shoulder, track, name)
    elbows = np.array([np.full(len(chest), pose.elbow) for pose in track.poses])
    upper, lower = _arm_to(track.mixed(wrists), shoulder, track.mixed(elbows), chest, sign)

    # the hand turns the shortest way from pose to pose
    turned = np.stack([_hand(pose, lower, chest, sign, Arm(*arm)) for pose in track.poses])
    frames = np.arange(len(chest))
    hand = _between(turned[track.before, frames], turned[track.after, frames], track.share)
    return _mixed(figure, bones[4:], parent, Arm(upper, *_within_wrist(lower, hand)), track.weight)


def _mixed(figure: Figure, bones: tuple[str, ...], parent: Array, arm: Arm, weight: Array) -> Figure:
    """The figure with an arm, its shoulder turned as parent (T, 3, 3), mixed with its own by weights (T,)."""
    rotations = {}
    for bone, turned in zip(bones[1:], arm, strict=True):
        local = product(inverse(parent), turned)
        rotations[bone] = _between(figure.local[:, BONES.index(bone)], local, weight)
        parent = turned
    return figure.with_local(rotations)


def _place(figure: Figure, pose: HandPose, side: str, sign: float) -> Array:
    """The place (T, 3) in the world that a pose names, with its offset."""
    if pose.place == OTHER_HAND:
        other = LEFT_RIGHT[1] if side == LEFT_RIGHT[0] else LEFT_RIGHT[0]
        return _palm(figure, other, -sign, pose.offset)
    if pose.place == FLOOR:
        return figure.floor + rotated(figure.facing, np.broadcast_to(pose.offset, figure.floor.shape))
    place = PLACES[pose.place]
    rotations, places = figure.chain(_way_to(place, side))
    point = np.array([sign * place.x, place.y, place.z]) + pose.offset
    return places[:, -1] + rotations[:, -1] @ point


def _palm(figure: Figure, side: str, sign: float, offset: Array) -> Array:
    """The middle of a palm (T, 3), and from there an offset seen from the upper chest."""
    rotations, places = figure.chain((*TRUNK_CHAIN, *limb_of(side, ARM)))
    from_wrist = np.array([sign * TOUCHES["palm"], -0.02, 0.0])
    return places[:, -1] + rotated(rotations[:, -1], from_wrist) + rotated(rotations[:, 3], offset)


def _way_to(place: Place, side: str) -> tuple[str, ...]:
    """The bones from the hips to that of a place."""
    if place.sided:
        leg = limb_of(side, LEG)
        return ("hips", *leg[: leg.index(sided(side, place.bone)) + 1])
    trunk = (*TRUNK_CHAIN, *NECK)
    return trunk[: trunk.index(place.bone) + 1]


def _wrist(figure: Figure, pose: HandPose, side: str, sign: float, shoulder: Array, chest: Array) -> Array:
    """Where the wrist is (T, 3) when the hand touches the place of a pose."""
    target = _place(figure, pose, side, sign)
    along = chest @ pose.fingers if pose.fingers.any() else unit(target - shoulder)
    return target - pose.touch * along


def _check_reach(wrists: Array, shoulder: Array, track: HandTrack, name: str) -> None:
    """MotionError for a place out of reach while a hand is at it."""
    longest = UPPER_ARM + FOREARM
    for number, pose in enumerate(track.poses):
        is_there = (track.before == number) & (track.share == 0) & (track.weight > 0.99)
        if not is_there.any():
            continue
        distance = float(np.linalg.norm(wrists[number] - shoulder, axis=1)[is_there].min())
        if distance > longest + BEYOND:
            raise MotionError(
                f"{name}: {pose.place!r} is {distance:.2f} m from the shoulder, and the arm {longest:.2f} m long: "
                "bend the trunk, or give a nearer place"
            )


def _arm_to(wrist: Array, shoulder: Array, elbow: Array, chest: Array, sign: float) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) in the world of upper arm and forearm with the wrist at places (T, 3) or as near as possible.

    elbow: degrees (T,) that it is raised to the side.
    """
    away = wrist - shoulder
    longest = STRAIGHT_SHARE * (UPPER_ARM + FOREARM)
    distance = np.linalg.norm(away, axis=1).clip(abs(UPPER_ARM - FOREARM) + 0.05, longest)
    along = unit(away)

    # the elbow lies beside the way to the wrist
    aside = _elbow_side(along, elbow, chest, sign)
    cosine = (UPPER_ARM**2 + distance**2 - FOREARM**2) / (2 * UPPER_ARM * distance)
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    to_elbow = UPPER_ARM * (cosine[:, None] * along + sine[:, None] * aside)
    to_wrist = distance[:, None] * along - to_elbow

    # both bones turn about the normal of their plane, which is the y axis of a T-pose
    normal = sign * unit(np.cross(along, aside))
    return _bone_frame(unit(to_elbow), normal, sign), _bone_frame(unit(to_wrist), normal, sign)


def _elbow_side(along: Array, elbow: Array, chest: Array, sign: float) -> Array:
    """The direction (T, 3) square to the way to the wrist in which the elbow lies: down, and raised to the side."""
    angle = np.radians(elbow)
    pole = np.stack([sign * np.sin(angle), -np.cos(angle), np.full_like(angle, -0.25)], axis=1)
    pole = rotated(chest, pole)
    return unit(pole - (pole * along).sum(axis=1, keepdims=True) * along)


def _bone_frame(along: Array, up: Array, sign: float) -> Array:
    """Rotations (T, 3, 3) of bones that lie along directions (T, 3), with y as near as possible to others (T, 3)."""
    x = sign * along
    z = unit(np.cross(x, up))
    y = np.cross(z, x)
    return np.stack([x, y, z], axis=2)


def _hand(pose: HandPose, lower: Array, chest: Array, sign: float, base: Arm) -> Array:
    """The rotations (T, 3, 3) of a hand in the world: by palm and fingers, or as the base's hand on its forearm."""
    if not pose.palm.any() and not pose.fingers.any():
        return product(lower, product(inverse(base.lower), base.hand))
    along = chest @ pose.fingers if pose.fingers.any() else sign * lower[:, :, 0]
    palm = chest @ pose.palm if pose.palm.any() else -lower[:, :, 1]
    return _bone_frame(unit(along), -palm, sign)


def _within_wrist(lower: Array, hand: Array) -> tuple[Array, Array]:
    """The forearm with its share of the hand's twist, and the hand with its wrist bent no farther than it goes."""
    relative = product(inverse(lower), hand)
    turn = rotmat_to_rotvec(twist(relative, np.array([1.0, 0.0, 0.0])))
    lower = product(lower, rotvec_to_rotmat(FOREARM_TWISTS * turn))
    bend = rotmat_to_rotvec(product(inverse(lower), hand))
    angle = np.linalg.norm(bend, axis=1, keepdims=True)
    limited = bend * np.minimum(1, WRIST_BENDS / np.maximum(angle, 1e-9))
    return lower, product(lower, rotvec_to_rotmat(limited))


def _between(first: Array, second: Array, share: Array) -> Array:
    """Rotations (T, 3, 3) that go from the first to the second the shortest way."""
    turn = rotmat_to_rotvec(product(inverse(first), second))
    # near half a turn the shortest way is now about one side, now about the other
    turn = continuous_rotvec(turn[:, None])[:, 0]
    return product(first, rotvec_to_rotmat(share[:, None] * turn))
