"""Hands that reach for points: two-bone inverse kinematics of an arm, within what a shoulder can do.

The arm is always brought to a point from the same pose, forward and half bent with the elbow down, by the shortest
turn; so the elbow goes where people hold it, whatever the arm does in the recording. Between the recorded arm and this
one the joints are mixed.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT, sided
from motet.figures.two_bones import TwoBones
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    Vector,
    computed,
    dot,
    inverse,
    larger,
    length,
    minus,
    normalised,
    parts,
    plus,
    product,
    root,
    rotated,
    times,
    unit,
    where,
)
from motet.steering.follower import Follower
from motet.steering.pose import Pose

SPINE = ("spine", "chest", "upperChest")
PARTS = ("Shoulder", "UpperArm", "LowerArm", "Hand")

PALM = 0.09
"""Metres from the wrist to the middle of the hand, which is what reaches."""

WIDEST = np.cos(np.radians(105))
"""The cosine of how far an arm turns from diagonally forward, to its own side."""

NEAREST, STRAIGHT, STRETCHED = 0.25, 0.95, 0.04
"""Shares of the arm's length: what is between the first two away from the shoulder is reached exactly; and by how much
more an arm stretches for anything farther."""

LEAST = 1e-3
"""The weight below which an arm is as it is played."""

REACHED = 0.02
"""Metres from a point at which a hand has reached it."""

LEAP, HALF_LIFE = 0.1, 0.12
"""Metres that a point may move in a tick and be followed at once; and the half-life, in seconds, in which a hand gets
to a new point, and back."""


@dataclass(frozen=True, eq=False)
class Reach:
    """What a hand of B figures reaches for. side: 0 for the left hand, 1 for the right. points: (B, 3) in the world,
    NaN for none. aim: (B, 3) where the hand goes for them. weight: (B, 1) from 0, the arm as it is played, to 1.
    beyond: (B,) whether the point was out of reach in the last tick."""

    side: int
    points: Array
    aim: Follower
    weight: Follower
    beyond: NDArray[np.bool_]

    @staticmethod
    def idle(side: int, figures: int) -> "Reach":
        """Of figures whose hands reach for nothing."""
        none, aim, weight = np.full((figures, 3), np.nan), np.zeros((figures, 3)), np.zeros((figures, 1))
        return Reach(side, none, Follower.at(aim), Follower.at(weight), np.zeros(figures, dtype=bool))

    @cached_property
    def _rests(self) -> bool:
        """Whether no hand reaches for anything, or is still on its way back."""
        return bool(np.isnan(self.points[:, 0]).all() and (self.weight.shown < LEAST).all())

    def after(self, pose: Pose, seconds: float) -> tuple["Reach", Pose]:
        """A tick later, and the pose of that tick with the hand there."""
        if self._rests:
            return self, pose
        told, rests = ~np.isnan(self.points[:, 0]), self.weight.shown < LEAST
        reaches = told | ~rests[:, 0]
        wanted = np.where(told[:, None], self.points, self.aim.wanted)
        # an arm that does not reach yet goes to the point by its weight alone
        before, off, rate = np.where(rests, [wanted, 0 * wanted, 0 * wanted], [*vars(self.aim).values()])
        aim = Follower(before, off, rate).after(wanted, LEAP, HALF_LIFE, seconds)
        weight = self.weight.after(told[:, None].astype(np.float64), 0.5, HALF_LIFE, seconds)
        turned, beyond = _reached(pose, self.side, aim.shown, weight.shown[:, 0])
        rotations = pose.rotations.copy()
        for part, quats in zip(PARTS[1:3], turned, strict=True):
            bone = BONES.index(sided(LEFT_RIGHT[self.side], part))
            rotations[reaches, bone] = np.transpose(quats).reshape(-1, 4)[reaches]
        hand = replace(self, aim=aim, weight=weight, beyond=beyond & told)
        return hand, replace(pose, rotations=rotations)


def _reached(
    pose: Pose, side: int, points: Array, weight: Array
) -> tuple[tuple[Quaternion, Quaternion], NDArray[np.bool_]]:
    """Rotations of upper arms and forearms in their parents' frames, with the hands on the way to points (B, 3) as far
    as weights (B,) say; and whether these are out of reach (B,)."""
    bones = [BONES.index(sided(LEFT_RIGHT[side], part)) for part in PARTS]
    shoulder, upper, lower, hand = (parts(pose.rotations[:, bone]) for bone in bones)
    place, above = _chest(pose)
    offsets = [HUMANOID.joints[HUMANOID.index(BONES[bone])].offset for bone in bones]
    start = plus(offsets[0], rotated(shoulder, offsets[1]))
    way = minus(rotated(inverse(above), minus(parts(points), place)), start)
    arm = _ready(side, offsets[2], plus(offsets[3], rotated(hand, (_out(side) * PALM, 0.0, 0.0))))
    near = _within(way, side, arm.longest)
    gap = minus(near, way)
    turn_upper, turn_lower = arm.turns(near)
    up, low = product(turn_upper, READY[side][0]), product(turn_lower, READY[side][1])
    (share,) = parts(weight[:, None])
    turned = _mixed(upper, product(inverse(shoulder), up), share), _mixed(lower, product(inverse(up), low), share)
    return turned, np.array(length(gap) > REACHED).reshape(-1)


def _out(side: int) -> float:
    """1 for the left side, which is at positive x, -1 for the right."""
    return 1.0 - 2.0 * side


def _chest(pose: Pose) -> tuple[Vector, Quaternion]:
    """Where the upper chest is and how it is turned."""
    (x, z, _), (height,) = parts(pose.ground), parts(pose.height[:, None])
    place, above = (x, height, z), product(parts(pose.heading), parts(pose.rotations[:, 0]))
    for bone in SPINE:
        place = plus(place, rotated(above, HUMANOID.joints[HUMANOID.index(bone)].offset))
        above = product(above, parts(pose.rotations[:, BONES.index(bone)]))
    return place, above


def _ready(side: int, along: Vector, down: Vector) -> TwoBones:
    """The arm that is forward and half bent, in the frame of the upper chest, from the shoulder: of an upper arm and a
    forearm with the hand, in their own frames."""
    upper, lower = READY[side]
    elbow = rotated(upper, along)
    hinge = rotated(lower, (0.0, -_out(side), 0.0))
    return TwoBones((0.0, 0.0, 0.0), elbow, plus(elbow, rotated(lower, down)), hinge)


def _turn(axis: Vector, degrees: float) -> Quaternion:
    half = np.radians(degrees) / 2
    x, y, z = times(unit(axis), float(np.sin(half)))
    return x, y, z, float(np.cos(half))


def _readied(side: int) -> tuple[Quaternion, Quaternion]:
    """The upper arm and the forearm of that arm: bent by a right angle, then turned until the elbow is down."""
    out = _out(side)
    upper = _turn((out, 0.0, 1.0), -75.0 * out)
    return upper, product(upper, _turn((0.0, -out, 0.0), 90.0))


READY = _readied(0), _readied(1)


def _within(way: Vector, side: int, longest: Part) -> Vector:
    """The place nearest to one (from the shoulder, in the frame of the upper chest) that an arm of a length reaches,
    turned no farther and stretched no farther than it can be."""
    axis, far = unit((_out(side), 0.0, 1.0)), length(way)
    along = dot(way, axis)
    aside = minus(way, times(axis, along))
    inside = along >= WIDEST * far
    edge = plus(times(axis, WIDEST * far), times(unit(aside), root(1 - WIDEST * WIDEST) * far))
    x, y, z = (where(inside, own, other) for own, other in zip(way, edge, strict=True))
    nearest, straight, more = (share * longest for share in (NEAREST, STRAIGHT, STRETCHED))
    over = larger(far - straight, 0.0)
    eased = straight + more * (1 - computed(np.exp, -over / more))
    by = where(over > 0, eased, larger(far, nearest)) / larger(far, 1e-12)
    return x * by, y * by, z * by


def _mixed(first: Quaternion, second: Quaternion, share: Part) -> Quaternion:
    """A rotation between two, by a share of the way."""
    near = where(sum(a * b for a, b in zip(first, second, strict=True)) < 0, -1.0, 1.0)
    x, y, z, w = ((1 - share) * near * a + share * b for a, b in zip(first, second, strict=True))
    return normalised((x, y, z, w))
