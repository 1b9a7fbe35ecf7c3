"""A figure as a camera would see it: the positions of its joints, and measures of them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motet.figures.humanoid import HUMANOID, on_humanoid, sided
from motet.motion.kinematics import positions
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array, Indices
from motet_train.data.errors import DataError
from motet_train.evaluate.positions import Flags, length, running_mean, spells

RATE = 30.0
"""Frames per second of tracks, whatever the rate of the motion."""


@dataclass(frozen=True, eq=False)
class Track:
    """Joints of the humanoid. points: positions (T, J, 3) in metres, y up, :data:`RATE` frames a second."""

    points: Array

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if shape[1:] != (len(HUMANOID.names), 3) or not shape[0]:
            raise DataError(f"a track is (T, {len(HUMANOID.names)}, 3) positions of the humanoid's joints, not {shape}")

    def __len__(self) -> int:
        return len(self.points)

    @property
    def seconds(self) -> float:
        """Its duration."""
        return len(self) / RATE

    def frames(self, which: slice | Indices) -> "Track":
        """Some of the frames, above the same ground."""
        part = Track(self.points[which])
        part.__dict__["ground"] = self.ground
        return part

    def part(self, start: float, stop: float) -> "Track":
        """The part between two shares of its duration, at least one frame."""
        first = min(int(start * len(self)), len(self) - 1)
        last = max(first + 1, round(stop * len(self)))
        return self.frames(slice(first, last))

    @cached_property
    def ground(self) -> float:
        """The 5th percentile of the height of the lowest joint, robust against single bad frames."""
        return float(np.percentile(self.points[..., 1].min(axis=1), 5))

    def joint(self, name: str) -> Array:
        """Positions (T, 3) of one joint."""
        return self.points[:, HUMANOID.index(name)]

    def height(self, name: str) -> Array:
        """Height (T,) of a joint above the ground."""
        return self.joint(name)[:, 1] - self.ground

    def joints(self, part: str) -> Array:
        """Positions (2, T, 3) of the left and the right joint of a part."""
        return np.stack([self.joint(name) for name in pair(part)])

    def heights(self, part: str) -> Array:
        """Heights (2, T) of the left and the right joint of a part above the ground."""
        return self.joints(part)[..., 1] - self.ground

    @cached_property
    def soles(self) -> Array:
        """Height (T, 2) of the lowest joint of the left and of the right foot above the ground."""
        # the lowest of ankle, ball and tip
        heights = [self.heights(part) for part in ("Foot", "Toes", "Toes_end")]
        lowest: Array = np.min(heights, axis=0).T
        return lowest

    @property
    def hands_up(self) -> Flags:
        """When (T,) both hands are above the shoulders."""
        return np.asarray((self.heights("Hand") > self.heights("UpperArm")).all(axis=0))

    @cached_property
    def path(self) -> Array:
        """The place (T, 2) of the hips over the ground."""
        return self.joint("hips")[:, [0, 2]]

    @cached_property
    def facing(self) -> Array:
        """The angle (T,) about y that hips and shoulders face, in degrees, unwrapped; 0 is along z, 90 along x."""
        # hips and shoulders count the same
        hips = direction(self._across("UpperLeg"))
        shoulders = direction(self._across("UpperArm"))
        return _unwrapped_angles(np.sum([hips, shoulders], axis=0))

    @cached_property
    def heading(self) -> Array:
        """The angle (T,) about y that the hips alone face, in degrees, unwrapped; 0 is along z, 90 along x."""
        return _unwrapped_angles(self._across("UpperLeg"))

    def _across(self, part: str) -> Array:
        """The line (T, 2) over the ground from the right to the left joint of a part."""
        left, right = self.joints(part)[..., [0, 2]]
        return np.asarray(left - right)

    @property
    def turn(self) -> float:
        """Degrees that the figure turns from its first to its last 0.3 s, positive to the left; whole turns add up."""
        count = max(1, min(round(0.3 * RATE), len(self) // 2))
        return float(self.facing[-count:].mean() - self.facing[:count].mean())

    @cached_property
    def velocity(self) -> Array:
        """Velocity (T, 2) of the hips over the ground, m/s: forward and to the left of the figure's facing.

        Averaged over 0.3 s, which removes the sway within a step.
        """
        steps = np.diff(self.path, axis=0) * RATE
        if not len(steps):
            return np.zeros((1, 2))
        x, z = calm(steps, 0.3).T
        # turned into the figure's own directions
        angle = np.radians(self.facing[1:])
        sin = np.sin(angle)
        cos = np.cos(angle)
        velocity = np.stack([x * sin + z * cos, x * cos - z * sin], axis=1)
        return np.concatenate([velocity[:1], velocity])

    @cached_property
    def pace(self) -> Array:
        """Speed (T,) over the ground, m/s."""
        return length(self.velocity)

    def body(self, name: str) -> Array:
        """A joint (T, 3) in the figure's space: to the left of the hips, above the ground, and in front of the hips."""
        # relative to the hips, turned by the facing
        x, _, z = (self.joint(name) - self.joint("hips")).T
        angle = np.radians(self.facing)
        sin = np.sin(angle)
        cos = np.cos(angle)
        left = x * cos - z * sin
        front = x * sin + z * cos
        return np.stack([left, self.height(name), front], axis=1)

    def bodies(self, part: str) -> Array:
        """The left and the right joint (2, T, 3) of a part as :meth:`body` gives them."""
        return np.stack([self.body(name) for name in pair(part)])

    def motion_of(self, name: str, beside: str = "hips") -> Array:
        """Speed (T,) of a joint relative to another one, m/s, averaged over a tenth of a second."""
        offsets = self.joint(name) - self.joint(beside)
        speeds = length(np.diff(offsets, axis=0)) * RATE
        return np.concatenate([[0.0], calm(speeds, 0.1)])


def track_of(motion: Motion) -> Track:
    """The track of a motion of any human figure; MotionError for another figure, or without frames."""
    humanoid = on_humanoid(motion)
    return Track(resampled(positions(humanoid), humanoid.fps / RATE))


def pair(part: str) -> tuple[str, str]:
    """The names of the left and the right joint of a part."""
    return sided("left", part), sided("right", part)


def direction(vectors: Array) -> Array:
    """Vectors (..., N), normalised."""
    return vectors / np.maximum(length(vectors), 1e-9)[..., None]


def _unwrapped_angles(across: Array) -> Array:
    """The facing (T,) in degrees, unwrapped, perpendicular to lines (T, 2) from right to left."""
    angles: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 1], across[:, 0])))
    return angles


def calm(values: Array, seconds: float) -> Array:
    """Values (T, ...) averaged over a window in seconds, or over its part in range at both ends."""
    return running_mean(values, 2 * (round(seconds * RATE) // 2) + 1)


def longest(flags: Flags) -> float:
    """Seconds of the longest run of true flags (T,)."""
    return max((stop - start for start, stop in spells(flags)), default=0) / RATE


def swings(values: Array, least: float) -> int:
    """How many times values (T,) rise or fall by at least ``least``; smaller reversals do not count."""
    count = 0
    rising = None
    low = np.inf
    high = -np.inf
    for value in values.tolist():
        low = min(low, value)
        high = max(high, value)
        # a turn back by ``least`` begins the next swing
        rises = value - low >= least and rising is not True
        falls = high - value >= least and rising is not False
        if rises or falls:
            count += 1
            rising = rises
            low = value
            high = value
    return count
