"""Hands that reach for points: two-bone inverse kinematics of an arm, within what a shoulder can do.

The arm is always brought to a point from the same pose, forward and half bent with the elbow down, by the shortest
turn; so the elbow goes where people hold it, whatever the arm does in the recording. Between the recorded arm and this
one the joints are mixed.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT, SPINE, sided
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
from motet.settings import Range, Settings
from motet.steering.follower import Follower
from motet.steering.matching import Flags
from motet.steering.pose import Floats, Pose, frame_of
from motet.steering.settings import HalfLife, Metres, Radians, Share


@dataclass(frozen=True)
class ReachSettings(Settings):
    """Settings of hands that reach for points."""

    FEATURE: ClassVar[str] = "reach"

    widest: Radians = float(np.radians(105))
    """How far an arm turns from diagonally forward, on its side."""
    nearest: Share = 0.25
    """Share of the arm's length: no hand is nearer to the shoulder."""
    straight: Share = 0.95
    """Share of the arm's length up to which points are reached exactly."""
    stretched: Annotated[float, Range(0.001, 1)] = 0.04
    """Share of its length by which an arm stretches at most for points farther away."""
    reached: Metres = 0.02
    """Distance from a point at which a hand has reached it."""
    leap: Metres = 0.1
    """How far a point may move in a tick and be followed at once."""
    half_life: HalfLife = 0.12
    """Half-life in which a hand gets to a new point, and back."""


PARTS = ("Shoulder", "UpperArm", "LowerArm", "Hand")

PALM = 0.09
"""Metres from the wrist to the middle of the hand, which is brought to the point."""

LEAST = 1e-3
"""The weight below which an arm is as it is played."""


@dataclass(frozen=True, eq=False)
class ReachLayer:
    """The left or the right hands of B figures."""

    side: int
    """0 for the left hand, 1 for the right."""
    points: Array
    """(B, 3) in the world, NaN for none."""
    aim: Follower
    """(B, 3) where the hand goes for them."""
    weight: Follower
    """(B, 1) from 0, the arm as it is played, to 1."""
    beyond: Flags
    """(B,) whether the point was out of reach in the last tick."""

    @staticmethod
    def none(side: int, figures: int) -> "ReachLayer":
        """Hands that reach for nothing."""
        return ReachLayer(
            side,
            points=np.full((figures, 3), np.nan),
            aim=Follower.at(np.zeros((figures, 3))),
            weight=Follower.at(np.zeros((figures, 1))),
            beyond=np.zeros(figures, dtype=bool),
        )

    @cached_property
    def _rests(self) -> bool:
        """Whether no hand reaches for anything, or is still on its way back."""
        return bool(np.isnan(self.points[:, 0]).all() and (self.weight.shown < LEAST).all())

    def update(self, pose: Pose, settings: ReachSettings, seconds: float) -> tuple["ReachLayer", Pose]:
        """A tick later, and the pose of that tick with the hands at their points."""
        if self._rests:
            return self, pose
        has_point = ~np.isnan(self.points[:, 0])
        rests = self.weight.shown < LEAST
        aim = self._aimed(has_point, rests, settings, seconds)
        # the weight goes to 1, or back to 0
        weight = self.weight.after(has_point[:, None].astype(np.float64), 0.5, settings.half_life, seconds)
        # the arm
        turned, beyond = _reached(pose, self.side, aim.shown, weight.shown[:, 0], settings)
        rotations = self._with_arms(pose.rotations, turned, has_point | ~rests[:, 0])
        layer = replace(self, aim=aim, weight=weight, beyond=beyond & has_point)
        return layer, replace(pose, rotations=rotations)

    def _with_arms(self, rotations: Floats, arms: tuple[Quaternion, Quaternion], moves: Flags) -> Floats:
        """Local quaternions (B, J, 4) with upper arms and forearms of the figures that move theirs (B,)."""
        rotations = rotations.copy()
        for part, quats in zip(PARTS[1:3], arms, strict=True):
            bone = BONES.index(sided(LEFT_RIGHT[self.side], part))
            rotations[moves, bone] = np.transpose(quats).reshape(-1, 4)[moves]
        return rotations

    def _aimed(self, has_point: Flags, rests: Flags, settings: ReachSettings, seconds: float) -> Follower:
        """The aim a tick later: it follows the point; that of an arm at rest (B, 1) is there at once, as its weight
        takes the arm there."""
        wanted = np.where(has_point[:, None], self.points, self.aim.wanted)
        aim = Follower(
            np.where(rests, wanted, self.aim.wanted),
            np.where(rests, 0 * wanted, self.aim.offset),
            np.where(rests, 0 * wanted, self.aim.offset_rate),
        )
        return aim.after(wanted, settings.leap, settings.half_life, seconds)


def _reached(
    pose: Pose, side: int, points: Array, weight: Array, settings: ReachSettings
) -> tuple[tuple[Quaternion, Quaternion], Flags]:
    """Rotations of upper arms and forearms in their parents' frames, with the hands on the way to points (B, 3) as far
    as weights (B,) say; and whether these are out of reach (B,)."""
    bones = [sided(LEFT_RIGHT[side], part) for part in PARTS]
    offsets = [HUMANOID.joints[HUMANOID.index(bone)].offset for bone in bones]
    shoulder, upper, lower, hand = (parts(pose.rotations[:, BONES.index(bone)]) for bone in bones)
    # from the shoulder to the point, in the frame of the upper chest
    to_point = minus(_in_chest(pose, points), plus(offsets[0], rotated(shoulder, offsets[1])))
    # the arm that is forward and half bent, brought as near as it can
    palm = plus(offsets[3], rotated(hand, (_out(side) * PALM, 0.0, 0.0)))
    arm = _ready_arm(side, offsets[2], palm)
    reachable = _within(to_point, side, arm.longest, settings)
    reaching_upper, reaching_lower = map(product, arm.turns(reachable), READY[side])
    # mixed with the recorded arm, in the frames of the parents
    (share,) = parts(weight[:, None])
    mixed_upper = _mixed(upper, product(inverse(shoulder), reaching_upper), share)
    mixed_lower = _mixed(lower, product(inverse(reaching_upper), reaching_lower), share)
    # how far the hand still is from the point
    missing = length(minus(reachable, to_point))
    return (mixed_upper, mixed_lower), np.array(missing > settings.reached).reshape(-1)


def _in_chest(pose: Pose, points: Array) -> Vector:
    """Points (B, 3) of the world in the frame of the upper chest."""
    place, chest = frame_of(pose, SPINE)
    return rotated(inverse(chest), minus(parts(points), place))


def _out(side: int) -> float:
    """1 for the left side, which is at positive x, -1 for the right."""
    return 1.0 - 2.0 * side


def _ready_arm(side: int, upper_arm: Vector, forearm: Vector) -> TwoBones:
    """The arm that is forward and half bent, in the frame of the upper chest, from the shoulder. upper_arm, forearm:
    these bones in their own frames, the forearm with the hand."""
    upper, lower = READY[side]
    elbow = rotated(upper, upper_arm)
    hinge = rotated(lower, (0.0, -_out(side), 0.0))
    return TwoBones((0.0, 0.0, 0.0), elbow, plus(elbow, rotated(lower, forearm)), hinge)


def _turn(axis: Vector, degrees: float) -> Quaternion:
    half = np.radians(degrees) / 2
    x, y, z = times(unit(axis), float(np.sin(half)))
    return x, y, z, float(np.cos(half))


def _ready(side: int) -> tuple[Quaternion, Quaternion]:
    """Rotations of the upper arm and the forearm of that arm: bent by a right angle, then turned until the elbow is
    down."""
    out = _out(side)
    upper = _turn((out, 0.0, 1.0), -75.0 * out)
    return upper, product(upper, _turn((0.0, -out, 0.0), 90.0))


READY = _ready(0), _ready(1)


def _within(to_point: Vector, side: int, longest: Part, settings: ReachSettings) -> Vector:
    """The place nearest to a point (from the shoulder, in the frame of the upper chest) that an arm of a length reaches
    within the limits of turning and stretching."""
    x, y, z = _turnable(to_point, side, settings.widest)
    distance = length(to_point)
    # distances beyond the straight arm are eased towards its full length
    straight = settings.straight * longest
    stretch = settings.stretched * longest
    over = larger(distance - straight, 0.0)
    eased = straight + stretch * (1 - computed(np.exp, -over / stretch))
    reached = where(over > 0, eased, larger(distance, settings.nearest * longest))
    factor = reached / larger(distance, 1e-12)
    return x * factor, y * factor, z * factor


def _turnable(to_point: Vector, side: int, widest: float) -> Vector:
    """The vector to a point, brought to the edge of the cone of directions within ``widest`` radians if beyond it."""
    widest_cosine = np.cos(widest)
    axis = unit((_out(side), 0.0, 1.0))
    distance = length(to_point)
    along = dot(to_point, axis)
    across = minus(to_point, times(axis, along))
    edge_along = times(axis, widest_cosine * distance)
    edge_across = times(unit(across), root(1 - widest_cosine * widest_cosine) * distance)
    edge = plus(edge_along, edge_across)
    inside = along >= widest_cosine * distance
    x, y, z = (where(inside, value, limit) for value, limit in zip(to_point, edge, strict=True))
    return x, y, z


def _mixed(first: Quaternion, second: Quaternion, share: Part) -> Quaternion:
    """A rotation between two, by a share of the way."""
    sign = where(sum(a * b for a, b in zip(first, second, strict=True)) < 0, -1.0, 1.0)
    x, y, z, w = ((1 - share) * sign * a + share * b for a, b in zip(first, second, strict=True))
    return normalised((x, y, z, w))
