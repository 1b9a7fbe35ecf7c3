"""Figures that look at points: head, neck and upper spine share the turn, within what people can do.

How far the head is from where it should look is an angle to the left and an angle upwards, in the frame of the lower
spine. Each bone from there to the head takes its share of both, so the head looks at the point, and the back bends
evenly.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import NO_ROTATION, Quaternion, Vector, inverse, minus, parts, plus, product, rotated
from motet.settings import Settings
from motet.steering.follower import Follower
from motet.steering.matching import Flags
from motet.steering.pose import Pose, frame_of
from motet.steering.settings import HalfLife, Metres, Radians


@dataclass(frozen=True)
class LookSettings(Settings):
    """Settings of figures that look at points."""

    FEATURE: ClassVar[str] = "look"

    aside: Radians = float(np.radians(85))
    """Largest angle of the gaze to a side."""
    up: Radians = float(np.radians(50))
    """Largest angle of the gaze up or down."""
    behind: Radians = float(np.radians(150))
    """Beyond this angle a figure goes on looking over the same shoulder."""
    near: Metres = 0.2
    """A point nearer to the eyes than this is not looked at."""
    under: Metres = 0.3
    """A point above or below the eyes is turned to the less, the nearer it is to their vertical than this."""
    leap: Radians = float(np.radians(10))
    """How far the gaze follows in a tick at once."""
    half_life: HalfLife = 0.18
    """Half-life in which the gaze catches up with more: at most 300 degrees a second, in a turn by 100."""


SHARES = {"chest": 0.1, "upperChest": 0.25, "neck": 0.55, "head": 1.0}
"""Bones that turn -> the share of the turn that each and those below it make together."""

JOINT_OFFSETS = {joint.name: joint.offset for joint in HUMANOID.joints}

EYES_OFFSET = (0.0, 0.07, 0.08)
"""The middle of the eyes, from the head's joint, metres."""

LEAST_TURN = 1e-4
"""Radians below which nothing is turned."""


@dataclass(frozen=True, eq=False)
class LookLayer:
    """The gazes of B figures."""

    points: Array
    """(B, 3) in the world, NaN for none."""
    turn: Follower
    """(B, 2) angles by which their heads are turned to the left and up, beyond what is played."""

    @staticmethod
    def none(figures: int) -> "LookLayer":
        """Figures that look at nothing."""
        return LookLayer(np.full((figures, 3), np.nan), Follower.at(np.zeros((figures, 2))))

    @cached_property
    def _turning(self) -> Flags | None:
        """Which heads (B,) are turned, or about to be; None for none."""
        turning = ~np.isnan(self.points[:, 0]) | (np.abs(self.turn.shown) > LEAST_TURN).any(axis=1)
        return turning if turning.any() else None

    def update(self, pose: Pose, settings: LookSettings, seconds: float) -> tuple["LookLayer", Pose]:
        """A tick later, and the pose of that tick with the heads turned."""
        turning = self._turning
        if turning is None:
            return self, pose
        # the gaze as it is played, and as it should be
        bones, points = _in_spine(pose, self.points)
        played_gaze = _angles(rotated(bones[-1], (0.0, 0.0, 1.0)))
        wanted = self._wanted(bones, points, played_gaze, settings)
        # turn towards it
        turn = self.turn.after(wanted, settings.leap, settings.half_life, seconds)
        rotations = pose.rotations.copy()
        above = NO_ROTATION
        for name, bone in zip(SHARES, _turned(bones, played_gaze[:, 0], turn.shown), strict=True):
            local = np.transpose(product(inverse(above), bone)).reshape(-1, 4)
            rotations[turning, BONES.index(name)] = local[turning]
            above = bone
        return replace(self, turn=turn), replace(pose, rotations=rotations)

    def _wanted(self, bones: Sequence[Quaternion], points: Vector, played_gaze: Array, settings: LookSettings) -> Array:
        """The angles (B, 2) by which heads should be turned beyond their gazes (B, 2) as played."""
        # from the eyes, as they were turned a tick ago
        from_eyes = minus(points, _eyes(_turned(bones, played_gaze[:, 0], self.turn.shown)))
        wanted = _angles(from_eyes)
        wanted[:, 0] = self._over_shoulder(wanted[:, 0], played_gaze[:, 0], settings.behind)
        # a point above or below: hardly aside
        x, y, z = np.broadcast_arrays(*from_eyes)
        wanted[:, 0] *= np.minimum(np.hypot(x, z) / settings.under, 1)
        # none, or one that is too near: ahead
        distance = np.sqrt(np.square(x) + np.square(y) + np.square(z))
        far = np.atleast_1d(distance > settings.near)
        largest = np.array([settings.aside, settings.up])
        return np.where(far[:, None], wanted.clip(-largest, largest) - played_gaze, 0.0)

    def _over_shoulder(self, wanted: Array, played: Array, behind: float) -> Array:
        """Angles to the left (B,), those to points behind over the shoulder over which figures look already."""
        gaze_before = played + self.turn.wanted[:, 0]
        return np.where(np.abs(wanted) > behind, np.copysign(wanted, gaze_before), wanted)


def _in_spine(pose: Pose, points: Array) -> tuple[list[Quaternion], Vector]:
    """In the frame of the lower spine: rotations of the bones of :data:`SHARES`, and points (B, 3)."""
    place, above = frame_of(pose, ("spine",))
    turned = NO_ROTATION
    bones = list[Quaternion]()
    for bone in SHARES:
        turned = product(turned, parts(pose.rotations[:, BONES.index(bone)]))
        bones.append(turned)
    return bones, rotated(inverse(above), minus(parts(points), place))


def _eyes(bones: Sequence[Quaternion]) -> Vector:
    """Where the eyes are in the frame of the lower spine, of rotations in it."""
    place: Vector = (0.0, 0.0, 0.0)
    above = NO_ROTATION
    for name, bone in zip(SHARES, bones, strict=True):
        place = plus(place, rotated(above, JOINT_OFFSETS[name]))
        above = bone
    return plus(place, rotated(above, EYES_OFFSET))


def _angles(way: Vector) -> Array:
    """Angles (B, 2) of directions, to the left and up."""
    x, y, z = way
    left = np.arctan2(x, z)
    up = np.arctan2(y, np.hypot(x, z))
    angles: NDArray[np.float64] = np.stack(np.broadcast_arrays(left, up), axis=-1)
    return angles.reshape(-1, 2)


def _turned(bones: Sequence[Quaternion], gaze: Array, turn: Array) -> list[Quaternion]:
    """Rotations of bones in the frame of the lower spine, turned by their shares of angles (B, 2), from gazes at angles
    (B,) to the left."""
    (gaze_left,) = parts(gaze[:, None])
    turned = list[Quaternion]()
    for share, bone in zip(SHARES.values(), bones, strict=True):
        left, up = parts(share * turn)
        # to the left, about the vertical; then up, about the horizontal axis across that direction
        aside = product((0.0, np.sin(left / 2), 0.0, np.cos(left / 2)), bone)
        direction = gaze_left + left
        sine = np.sin(up / 2)
        upwards = (-np.cos(direction) * sine, 0.0, np.sin(direction) * sine, np.cos(up / 2))
        turned.append(product(upwards, aside))
    return turned
