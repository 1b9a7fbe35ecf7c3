"""A foot lock for live figures: standing feet stay in place, without look-ahead.

Contacts come from the table being played, by :func:`motet.figures.feet.contacts.contacts_of` of the recordings. While a
foot stands, the movement of its lowest point over the ground is removed, tick by tick; when it lifts off, the
correction fades. Hip, knee and ankle follow (:class:`motet.figures.two_bones.TwoBones`). The offline twin, which knows
how long a foot will stand, is :mod:`motet.figures.feet.hold`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from motet.figures.humanoid import LEG, SOLE
from motet.figures.legs import Limb, joints_of, limbs, reached_by, with_legs
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    Vector,
    larger,
    parts,
    plus,
    root,
    rotated,
    smaller,
    where,
    yawed,
)
from motet.motion.springs import Inertializer
from motet.settings import Range, Settings
from motet.steering.matching import Flags
from motet.steering.pose import Pose


@dataclass(frozen=True)
class FootLockSettings(Settings):
    """Settings of the foot lock."""

    FEATURE: ClassVar[str] = "foot_lock"

    fade: Annotated[float, Range(0.001, 10, "s")] = 0.1
    """Half-life in which a released foot returns to where it is played."""
    farthest: Annotated[float, Range(0, 1, "m")] = 0.2
    """Largest correction; beyond it the foot is released."""
    swings: Annotated[float, Range(0.01, 100, "m/s")] = 1.0
    """Above this speed a foot swings, even if a clip that was just jumped to marks a contact."""
    stands: Annotated[float, Range(0, 1)] = 0.5
    """Contact above which a foot stands."""
    bears: Annotated[float, Range(0, 1, "m")] = 0.02
    """How much lower than the ball the heel or the tip must be to bear the foot."""
    steps: Annotated[float, Range(0, 1, "m")] = 0.08
    """How high a foot is lifted that swings while its contact is 1; a slower foot is lifted less."""
    lifts: Annotated[float, Range(0.001, 10, "s")] = 0.035
    """Half-life in which a foot is lifted and let down: at once, the knee of a straight leg would pop forward."""


HEEL, BALL = SOLE[LEG[2]]
(TIP,) = SOLE[LEG[3]]
POINTS = [(2, HEEL), (2, BALL), (3, TIP)]
"""Points of a sole, heel, ball and tip, and which joint of a leg carries each."""

Pair = tuple[Part, Part]


class Foot(NamedTuple):
    """The correction of a foot."""

    shift: Pair = (0.0, 0.0)
    """Offset over the ground along x and z, metres."""
    drift: Pair = (0.0, 0.0)
    """How fast the shift changes, m/s."""
    height: Pair = (0.0, 0.0)
    """How high it steps, and how fast that changes."""
    soles: tuple[Vector, ...] | None = None
    """Where the points of its sole were in the last tick, None before the first."""


@dataclass(eq=False)
class FootLock:
    """The lock of B characters."""

    characters: int
    dt: float
    """Seconds of a tick."""
    settings: FootLockSettings = FootLockSettings()
    feet: tuple[Foot, ...] = (Foot(), Foot())
    """Those of a single character, left and right, in floats; those of several as one, in float64 arrays (2, B).
    Replaced, never written into."""
    new: Flags | None = None
    """(B,) which of several have not been held yet, None for none."""

    def held(self, pose: Pose) -> Pose:
        """The next pose, one tick later, with standing feet held in place and above ground."""
        hips = _hips(pose)
        x, z, _ = parts(pose.ground)
        (height,) = parts(pose.height[:, None])
        feet = list[Foot]()
        turns = list[list[Quaternion]]()
        for foot, limb in zip(self.feet, limbs(pose.rotations, pose.contacts), strict=False):
            foot_after, leg_turns = self._stood(foot, limb, hips, (x, height, z))
            feet.append(foot_after)
            turns.append(leg_turns)
        self.feet = tuple(feet)
        self.new = None
        return Pose(pose.ground, with_legs(pose.rotations, turns), pose.height, pose.contacts)

    def _stood(self, foot: Foot, limb: Limb, hips: Quaternion, place: Vector) -> tuple[Foot, list[Quaternion]]:
        """A foot a tick later, and the rotations of thigh, shin and foot in their parents' frames."""
        turned, places = joints_of(limb, hips, place)
        soles = _soles(turned, places)
        foot_after, lift = self._shifted(foot, soles, limb.contact)
        played = limb.local[:3]
        shift_x, shift_z = foot_after.shift
        moves = (shift_x != 0) | (shift_z != 0) | (lift > 0)
        if moves is False:
            return foot_after, played
        # the leg reaches for the corrected ankle
        x, y, z = places[2]
        reached = reached_by(hips, turned, places, (x + shift_x, y + lift, z + shift_z))
        if moves is True or moves.all():
            return foot_after, reached
        return foot_after, [_chosen(moves, *pair) for pair in zip(reached, played, strict=True)]

    def _shifted(self, foot: Foot, soles: tuple[Vector, ...], contact: Part) -> tuple[Foot, Part]:
        """A foot a tick later, and by how much it is lifted above where it is played."""
        settings = self.settings
        swing_step = settings.swings * self.dt
        move_x, move_z, lowest = self._sole_move(foot, soles)

        # a foot that stands stays where it was: its move since the last tick is taken from its offset
        held_x = foot.shift[0] - move_x
        held_z = foot.shift[1] - move_z
        near = _length(held_x, held_z) < settings.farthest
        slow = _length(move_x, move_z) < swing_step
        stands = (contact > settings.stands) & near & slow

        # one that does not stand returns to where it is played
        fade = Inertializer(settings.fade)
        faded_x, fade_rate_x = fade.update(foot.shift[0], foot.drift[0], self.dt)
        faded_z, fade_rate_z = fade.update(foot.shift[1], foot.drift[1], self.dt)
        shift_x = where(stands, held_x, faded_x)
        shift_z = where(stands, held_z, faded_z)
        drift_x = where(stands, 0.0, fade_rate_x)
        drift_z = where(stands, 0.0, fade_rate_z)

        # a foot that moves over the ground while it is marked as a contact steps
        moved = _length(shift_x - held_x, shift_z - held_z)
        height = self._step_height(foot, moved, contact)
        foot_after = Foot((shift_x, shift_z), (drift_x, drift_z), height, soles)
        # no point of the sole is below the ground
        return foot_after, larger(height[0] - lowest, 0.0)

    def _step_height(self, foot: Foot, moved: Part, contact: Part) -> Pair:
        """How high a foot steps that has moved over the ground, higher the faster, and how fast that changes."""
        settings = self.settings
        goal = contact * smaller(moved * (settings.steps / (settings.swings * self.dt)), settings.steps)
        error, rate = Inertializer(settings.lifts).update(foot.height[0] - goal, foot.height[1], self.dt)
        return goal + error, rate

    def _sole_move(self, foot: Foot, soles: tuple[Vector, ...]) -> tuple[Part, Part, Part]:
        """How far the point that bears a foot has moved over the ground since the last tick, along x and z; and the
        height of the lowest point."""
        heel, ball, tip = soles
        heel_before, ball_before, tip_before = self._soles_before(foot, soles)
        # the ball bears the foot, unless the heel or the tip is clearly lower
        move_x = ball[0] - ball_before[0]
        move_z = ball[2] - ball_before[2]
        lowest = ball[1]
        bearing_height = ball[1] - self.settings.bears
        for point, point_before in ((heel, heel_before), (tip, tip_before)):
            bears = point[1] < bearing_height
            lowest = smaller(lowest, point[1])
            bearing_height = where(bears, point[1], bearing_height)
            move_x = where(bears, point[0] - point_before[0], move_x)
            move_z = where(bears, point[2] - point_before[2], move_z)
        return move_x, move_z, lowest

    def _soles_before(self, foot: Foot, soles: tuple[Vector, ...]) -> tuple[Vector, ...]:
        """Where the points of a sole were; those of new characters where they are now."""
        if foot.soles is None:
            return soles
        if self.new is None:
            return foot.soles
        return tuple(_chosen(self.new, *pair) for pair in zip(soles, foot.soles, strict=True))


def _hips(pose: Pose) -> Quaternion:
    """Rotation of the hips in the world."""
    half_facing = (pose.ground[:, 2] / 2).astype(np.float32)
    sine, cosine = parts(np.array([np.sin(half_facing), np.cos(half_facing)]).T)
    return yawed(parts(pose.rotations[:, 0]), sine, cosine)


def _soles(turned: Sequence[Quaternion], places: Sequence[Vector]) -> tuple[Vector, ...]:
    """Where the points of a sole are, of rotations and places of a leg's joints."""
    return tuple(plus(places[joint], rotated(turned[joint], point)) for joint, point in POINTS)


def _length(x: Part, z: Part) -> Part:
    return root(x * x + z * z)


def _chosen(condition: Part, yes: tuple[Part, ...], no: tuple[Part, ...]) -> tuple[Part, ...]:
    """A vector or quaternion, or another, by a condition."""
    return tuple(where(condition, this, other) for this, other in zip(yes, no, strict=True))
