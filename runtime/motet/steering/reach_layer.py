"""Hands that reach for points: two-bone inverse kinematics of an arm, within what a shoulder can do.

The arm is always brought to a point from the same pose, forward and half bent with the elbow down, by the shortest
turn; so the elbow goes where people hold it, whatever the arm does in the recording. Between the recorded arm and this
one the joints are mixed. A point that cannot be held, behind the back or at the shoulder, is let go as smoothly as one
that is taken back: the arm stays where it was and fades, rather than to follow the point through the body.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

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
    joined,
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
    lets_go: Radians = float(np.radians(25))
    """How much farther aside a point may be before the hand lets it go."""
    nearest: Share = 0.25
    """Share of the arm's length: a point that is nearer to the shoulder is let go."""
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


ARM_BONES = ("Shoulder", "UpperArm", "LowerArm", "Hand")

PALM = 0.09
"""Metres from the wrist to the middle of the hand, which is brought to the point."""

WRAP_COSINE = -0.7
"""The cosine of half the turn, 270 degrees, beyond which an arm goes back the other way."""

LEAST_WEIGHT = 1e-3
"""The weight below which an arm is as it is played."""


@dataclass(frozen=True, eq=False)
class ReachLayer:
    """The left or the right hands of B figures."""

    side: int
    """0 for the left hand, 1 for the right."""
    points: Array
    """(B, 3) in the world, NaN for none."""
    aim: Follower
    """(B, 3) where the hand goes for them, from the shoulder in the frame of the upper chest."""
    weight: Follower
    """(B, 1) from 0, the arm as it is played, to 1."""
    signs: Array
    """(B, 2) of the quaternions between which upper arms and forearms are mixed: 1 or -1, 0 where an arm rests."""
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
            signs=np.zeros((figures, 2)),
            beyond=np.zeros(figures, dtype=bool),
        )

    @cached_property
    def _rests(self) -> bool:
        """Whether no hand reaches for anything, or is still on its way back."""
        return bool(np.isnan(self.points[:, 0]).all() and (self.weight.shown < LEAST_WEIGHT).all())

    def update(self, pose: Pose, settings: ReachSettings, seconds: float) -> tuple["ReachLayer", Pose]:
        """A tick later, and the pose of that tick with the hands at their points."""
        if self._rests:
            return self, pose
        has_point = ~np.isnan(self.points[:, 0])
        rests = self.weight.shown < LEAST_WEIGHT
        # where the hand can be for its point, and whether that can be held
        arm = _Arm.of(pose, self.side)
        reachable, holds, beyond = arm.within_reach(self.points, settings)
        # the aim goes there, or stays while the hand lets go; the weight goes to 1, or back to 0
        aim = self._aimed(reachable, holds, rests, settings, seconds)
        weight = self.weight.after(holds[:, None].astype(np.float64), 0.5, settings.half_life, seconds)
        # the arm
        signs, turned = arm.mixed(aim.shown, weight.shown, np.where(rests, 0.0, self.signs))
        rotations = self._with_arms(pose.rotations, turned, has_point | ~rests[:, 0])
        layer = replace(self, aim=aim, weight=weight, signs=signs, beyond=has_point & beyond)
        return layer, replace(pose, rotations=rotations)

    def _with_arms(self, rotations: Floats, arms: tuple[Quaternion, Quaternion], moves: Flags) -> Floats:
        """Local quaternions (B, J, 4) with upper arms and forearms of the figures that move theirs (B,)."""
        rotations = rotations.copy()
        for part, quats in zip(ARM_BONES[1:3], arms, strict=True):
            bone = BONES.index(sided(LEFT_RIGHT[self.side], part))
            rotations[moves, bone] = np.transpose(quats).reshape(-1, 4)[moves]
        return rotations

    def _aimed(self, reachable: Array, goes: Flags, rests: Flags, settings: ReachSettings, seconds: float) -> Follower:
        """The aim a tick later: it follows the places (B, 3) of hands that go (B,); that of an arm at rest (B, 1) is
        there at once, as its weight takes the arm there."""
        wanted = np.where(goes[:, None], reachable, self.aim.wanted)
        aim = Follower(
            np.where(rests, wanted, self.aim.wanted),
            np.where(rests, 0 * wanted, self.aim.offset),
            np.where(rests, 0 * wanted, self.aim.offset_rate),
        )
        return aim.after(wanted, settings.leap, settings.half_life, seconds)


class _Arm(NamedTuple):
    """The arms of a side as they are played."""

    side: int
    chest: Quaternion
    """Of the upper chest in the world."""
    start: Vector
    """The shoulder joint in the world."""
    shoulder: Quaternion
    """Of the collar bone, of the upper arm and of the forearm in their parents' frames."""
    upper: Quaternion
    lower: Quaternion
    ready: TwoBones
    """The arm that is forward and half bent, in the frame of the upper chest, from the shoulder joint."""

    @staticmethod
    def of(pose: Pose, side: int) -> "_Arm":
        """Those of a pose."""
        bones = [sided(LEFT_RIGHT[side], part) for part in ARM_BONES]
        offsets = [HUMANOID.joints[HUMANOID.index(bone)].offset for bone in bones]
        shoulder, upper, lower, hand = (parts(pose.rotations[:, BONES.index(bone)]) for bone in bones)
        place, chest = frame_of(pose, SPINE)
        start = plus(place, rotated(chest, plus(offsets[0], rotated(shoulder, offsets[1]))))
        palm = plus(offsets[3], rotated(hand, (_out(side) * PALM, 0.0, 0.0)))
        return _Arm(side, chest, start, shoulder, upper, lower, _ready_arm(side, offsets[2], palm))

    def within_reach(self, points: Array, settings: ReachSettings) -> tuple[Array, Flags, Flags]:
        """The places (B, 3) nearest to points (B, 3) of the world where hands can be, from the shoulder in the frame of
        the upper chest; whether hands can be held there, and whether the points are out of reach (B,): no and yes where
        there is none."""
        to_point = rotated(inverse(self.chest), minus(parts(points), self.start))
        place = _within(to_point, self.side, self.ready.longest, settings)
        # beyond the edge a place would go round the shoulder faster than the point, and near it both do
        distance = length(to_point)
        is_ahead = _along(to_point, self.side) >= np.cos(min(settings.widest + settings.lets_go, np.pi)) * distance
        holds = is_ahead & (distance > settings.nearest * self.ready.longest)
        misses = length(minus(place, to_point)) > settings.reached
        return joined(place), np.reshape(holds, -1), np.reshape(np.logical_not(holds) | misses, -1)

    def mixed(self, places: Array, weight: Array, signs: Array) -> tuple[Array, tuple[Quaternion, Quaternion]]:
        """Rotations of upper arms and forearms in their parents' frames, on the way to having hands at places (B, 3) as
        far as weights (B, 1) say; and the signs (B, 2) of :class:`ReachLayer`, from those of the last tick."""
        world_upper, world_lower = map(product, self.ready.turns(parts(places)), READY[self.side])
        reaching_upper = product(inverse(self.shoulder), world_upper)
        reaching_lower = product(inverse(world_upper), world_lower)
        # an arm that is on its way around one side stays on it
        upper_before, lower_before = parts(signs)
        upper_sign = _sign(self.upper, reaching_upper, upper_before)
        lower_sign = _sign(self.lower, reaching_lower, lower_before)
        (share,) = parts(weight)
        turned = (
            _mixed(self.upper, reaching_upper, share, upper_sign),
            _mixed(self.lower, reaching_lower, share, lower_sign),
        )
        return joined((upper_sign, lower_sign)), turned


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
    axis = _diagonal(side)
    distance = length(to_point)
    along = _along(to_point, side)
    across = minus(to_point, times(axis, along))
    edge_along = times(axis, widest_cosine * distance)
    edge_across = times(unit(across), root(1 - widest_cosine * widest_cosine) * distance)
    edge = plus(edge_along, edge_across)
    inside = along >= widest_cosine * distance
    x, y, z = (where(inside, value, limit) for value, limit in zip(to_point, edge, strict=True))
    return x, y, z


def _diagonal(side: int) -> Vector:
    """The direction diagonally forward, on a side."""
    return unit((_out(side), 0.0, 1.0))


def _along(to_point: Vector, side: int) -> Part:
    """How far a point is in that direction."""
    return dot(to_point, _diagonal(side))


def _sign(first: Quaternion, second: Quaternion, before: Part) -> Part:
    """The sign of the first quaternion beside the second: that of the shorter way from a rest, then as in the last
    tick, unless this way has become too far around."""
    cosine = sum(a * b for a, b in zip(first, second, strict=True))
    nearer = where(cosine < 0, -1.0, 1.0)
    return where((before == 0) | (cosine * before < WRAP_COSINE), nearer, before)


def _mixed(first: Quaternion, second: Quaternion, share: Part, sign: Part) -> Quaternion:
    """A rotation between two, by a share of the way. sign: of the first quaternion."""
    x, y, z, w = ((1 - share) * sign * a + share * b for a, b in zip(first, second, strict=True))
    return normalised((x, y, z, w))
