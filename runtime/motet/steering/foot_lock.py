"""A foot lock for live figures: standing feet stay in place, without look-ahead.

Contacts come from the table being played, by :func:`motet.figures.feet.contacts.contacts_of` of the recordings. While a
foot stands, the movement of its lowest point over the ground is removed, tick by tick; when it lifts off, the
correction fades. Hip, knee and ankle follow (:class:`motet.figures.two_bones.TwoBones`). The offline twin, which knows
how long a foot will stand, is :mod:`motet.figures.feet.hold`.
"""

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

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
from motet.motion.springs import damping_of
from motet.settings import Range, Settings
from motet.steering.pose import Pose


@dataclass(frozen=True)
class FootLockSettings(Settings):
    """fade: half-life in which a released foot comes back to where it is played. farthest: largest correction; beyond
    it the foot is released. swings: above this speed a foot is swinging, even if a clip that was just jumped to marks a
    contact. stands: contact above which a foot stands. bears: how much lower than the ball heel or tip are where they
    bear the foot. steps: how high a foot is lifted that swings while its contact is 1; a slower one less."""

    FEATURE: ClassVar[str] = "foot_lock"

    fade: Annotated[float, Range(0.001, 10, "s")] = 0.1
    farthest: Annotated[float, Range(0, 1, "m")] = 0.2
    swings: Annotated[float, Range(0.01, 100, "m/s")] = 1.0
    stands: Annotated[float, Range(0, 1)] = 0.5
    bears: Annotated[float, Range(0, 1, "m")] = 0.02
    steps: Annotated[float, Range(0, 1, "m")] = 0.08


POINTS = [(LEG.index(part), point) for part, points in SOLE.items() for point in points]
"""Points of a sole, heel, ball and tip, and which joint of a leg carries each."""

LIFTS = 0.035
"""Half-life (s) in which a foot is lifted and let down: at once, the knee of a straight leg would pop forward."""

Pair = tuple[Part, Part]
"""Along x and z."""


class Foot(NamedTuple):
    """By how much a foot is moved and how fast that changes, how high it steps and how fast that changes, and where the
    points of its sole were, None before the first tick."""

    shift: Pair = (0.0, 0.0)
    drift: Pair = (0.0, 0.0)
    height: Pair = (0.0, 0.0)
    soles: tuple[Vector, ...] | None = None


@dataclass(eq=False)
class FootLock:
    """The lock of B characters. dt: seconds of a tick.

    feet: those of one character, left and right, in floats; of more the feet of all as one, in float64 arrays (2, B).
    They are replaced, never written into. new: (B,) which of several have not been held yet, None for none.
    """

    characters: int
    dt: float
    settings: FootLockSettings = FootLockSettings()
    feet: tuple[Foot, ...] = (Foot(), Foot())
    new: NDArray[np.bool_] | None = None

    def held(self, pose: Pose) -> Pose:
        """The next pose, one tick later, with standing feet held in place and above ground."""
        half = (pose.ground[:, 2] / 2).astype(np.float32)
        hips = yawed(parts(pose.rotations[:, 0]), *parts(np.array([np.sin(half), np.cos(half)]).T))
        (x, z, _), (height,) = parts(pose.ground), parts(pose.height[:, None])
        legs = zip(self.feet, limbs(pose.rotations, pose.contacts), strict=False)
        found = [self._stood(foot, limb, hips, (x, height, z)) for foot, limb in legs]
        self.feet = tuple(foot for foot, _ in found)
        self.new = None
        rotations = with_legs(pose.rotations, [turns for _, turns in found])
        return Pose(pose.ground, rotations, pose.height, pose.contacts)

    def _stood(self, foot: Foot, limb: Limb, hips: Quaternion, place: Vector) -> tuple[Foot, list[Quaternion]]:
        """A foot a tick later, and the rotations of thigh, shin and foot in their parents' frames."""
        turned, places = joints_of(limb, hips, place)
        soles = tuple(plus(places[joint], rotated(turned[joint], point)) for joint, point in POINTS)
        after, lift = self._shifted(foot, soles, limb.contact)
        played, (shift_x, shift_z) = limb.local[:3], after.shift
        moves = (shift_x != 0) | (shift_z != 0) | (lift > 0)
        if moves is False:
            return after, played
        x, y, z = places[2]
        reached = reached_by(hips, turned, places, (x + shift_x, y + lift, z + shift_z))
        if moves is True or moves.all():
            return after, reached
        return after, [
            (where(moves, a, e), where(moves, b, f), where(moves, c, g), where(moves, d, h))
            for (a, b, c, d), (e, f, g, h) in zip(reached, played, strict=True)
        ]

    def _shifted(self, foot: Foot, soles: tuple[Vector, ...], contact: Part) -> tuple[Foot, Part]:
        """A foot a tick later, and by how much it is lifted."""
        how, before = self.settings, self._before(foot, soles)
        (x, lowest, z), (from_x, _, from_z) = soles[1], before[1]
        x, z, height = x - from_x, z - from_z, lowest - how.bears
        for (to_x, y, to_z), (from_x, _, from_z) in zip(soles[::2], before[::2], strict=True):
            lower, lowest = y < height, smaller(lowest, y)
            height, x, z = where(lower, y, height), where(lower, to_x - from_x, x), where(lower, to_z - from_z, z)
        held_x, held_z = foot.shift[0] - x, foot.shift[1] - z
        stands = (contact > how.stands) & (root(held_x * held_x + held_z * held_z) < how.farthest)
        stands = stands & (root(x * x + z * z) < how.swings * self.dt)
        (faded_x, slower_x), (faded_z, slower_z) = (
            self._faded(*one, how.fade) for one in zip(foot.shift, foot.drift, strict=True)
        )
        shift_x, shift_z = where(stands, held_x, faded_x), where(stands, held_z, faded_z)
        x, z = shift_x - held_x, shift_z - held_z  # over the ground
        steps = contact * smaller(root(x * x + z * z) * (how.steps / (how.swings * self.dt)), how.steps)
        off, rise = self._faded(foot.height[0] - steps, foot.height[1], LIFTS)
        drift = where(stands, 0.0, slower_x), where(stands, 0.0, slower_z)
        return Foot((shift_x, shift_z), drift, (steps + off, rise), soles), larger(steps + off - lowest, 0.0)

    def _before(self, foot: Foot, soles: tuple[Vector, ...]) -> tuple[Vector, ...]:
        """Where the points of a sole were; of who is new, where they are."""
        if foot.soles is None:
            return soles
        if self.new is None:
            return foot.soles
        pairs = zip(soles, foot.soles, strict=True)
        return tuple(
            (where(self.new, a, d), where(self.new, b, e), where(self.new, c, f)) for (a, b, c), (d, e, f) in pairs
        )

    def _faded(self, off: Part, rate: Part, half_life: float) -> Pair:
        """What a foot is off and its rate, as the spring of a half-life takes it back."""
        damping = damping_of(half_life)
        rise, left = (rate + damping * off) * self.dt, math.exp(-damping * self.dt)
        return (off + rise) * left, (rate - damping * rise) * left
