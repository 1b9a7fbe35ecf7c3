"""A figure as a camera would see it: the positions of its joints, and what follows from them."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, on_humanoid, sided
from motet.motion.kinematics import positions
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array
from motet_train.data.errors import DataError
from motet_train.evaluate.positions import Flags, length, running_mean, spells

RATE = 30.0
"""Frames per second at which rules look at a motion, whatever its own rate is."""


@dataclass(frozen=True, eq=False)
class Track:
    """points: positions (T, J, 3) of the humanoid's joints in metres, y up, :data:`RATE` frames a second."""

    points: Array

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if shape[1:] != (len(HUMANOID.names), 3) or not shape[0]:
            raise DataError(f"a track is (T, {len(HUMANOID.names)}, 3) positions of the humanoid's joints, not {shape}")

    def __len__(self) -> int:
        return len(self.points)

    @property
    def seconds(self) -> float:
        """How long it takes."""
        return len(self) / RATE

    def frames(self, which: slice | NDArray[np.intp]) -> "Track":
        """Some of the frames, above the same ground."""
        found = Track(self.points[which])
        found.__dict__["ground"] = self.ground
        return found

    def part(self, start: float, stop: float) -> "Track":
        """The part between two times, each a share of the whole; one frame at least."""
        first = min(int(start * len(self)), len(self) - 1)
        return self.frames(slice(first, max(first + 1, round(stop * len(self)))))

    @cached_property
    def ground(self) -> float:
        """The height under which the lowest joint is in one frame of twenty: single bad frames do not matter."""
        return float(np.percentile(self.points[..., 1].min(axis=1), 5))

    def joint(self, name: str) -> Array:
        """Positions (T, 3) of one joint."""
        return self.points[:, HUMANOID.index(name)]

    def height(self, name: str) -> Array:
        """Height (T,) of a joint above the ground."""
        return self.joint(name)[:, 1] - self.ground

    def heights(self, part: str) -> tuple[Array, Array]:
        """Heights (T,) of the left and the right joint of a part above the ground."""
        left, right = map(self.height, pair(part))
        return left, right

    @cached_property
    def soles(self) -> Array:
        """Height (T, 2) of the lowest joint of the left and of the right foot above the ground."""
        found: Array = np.min([self.heights(part) for part in ("Foot", "Toes", "Toes_end")], axis=0).T
        return found

    @cached_property
    def path(self) -> Array:
        """Where the hips are over the ground (T, 2)."""
        return self.joint("hips")[:, [0, 2]]

    @cached_property
    def facing(self) -> Array:
        """The angle (T,) about y that hips and shoulders face, in degrees, unwrapped; 0 is along z, 90 along x."""
        pairs = [[self.joint(name)[:, [0, 2]] for name in pair(part)] for part in ("UpperLeg", "UpperArm")]
        across = np.sum([direction(left - right) for left, right in pairs], axis=0)
        found: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 1], across[:, 0])))
        return found

    @cached_property
    def heading(self) -> Array:
        """The angle (T,) about y that the hips alone face, in degrees, unwrapped; 0 is along z, 90 along x."""
        left, right = map(self.joint, pair("UpperLeg"))
        across = left - right
        found: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 2], across[:, 0])))
        return found

    @property
    def turn(self) -> float:
        """Degrees that the figure turns to the left, negative to the right, from its first to its last 0.3 s; more than
        a whole turn where it continues."""
        count = max(1, min(round(0.3 * RATE), len(self) // 2))
        return float(self.facing[-count:].mean() - self.facing[:count].mean())

    @cached_property
    def velocity(self) -> Array:
        """How the hips move over the ground (T, 2), m/s: forward and to the left of where the figure faces.

        Means over 0.3 s, in which the sway within a step falls away.
        """
        steps = np.diff(self.path, axis=0) * RATE
        if not len(steps):
            return np.zeros((1, 2))
        (east, north), angle = calm(steps, 0.3).T, np.radians(self.facing[1:])
        sin, cos = np.sin(angle), np.cos(angle)
        moved = np.stack([east * sin + north * cos, east * cos - north * sin], axis=1)
        return np.concatenate([moved[:1], moved])

    @cached_property
    def pace(self) -> Array:
        """Speed (T,) over the ground, m/s."""
        return length(self.velocity)

    def body(self, name: str) -> Array:
        """A joint (T, 3) as the figure sees it: to its left and in front of its hips, and above the ground (y)."""
        (x, _, z), angle = (self.joint(name) - self.joint("hips")).T, np.radians(self.facing)
        left, front = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
        return np.stack([left, self.height(name), front], axis=1)

    def bodies(self, part: str) -> tuple[Array, Array]:
        """The left and the right joint of a part as :meth:`body` gives them."""
        left, right = map(self.body, pair(part))
        return left, right

    def motion_of(self, name: str, beside: str = "hips") -> Array:
        """Speed (T,) of a joint relative to another one, m/s, over a tenth of a second."""
        steps = length(np.diff(self.joint(name) - self.joint(beside), axis=0)) * RATE
        return np.concatenate([[0.0], calm(steps, 0.1)])


def track_of(motion: Motion) -> Track:
    """The track of a motion of any human figure; MotionError for a figure that is none, or no frames."""
    own = on_humanoid(motion)
    return Track(resampled(positions(own), own.fps / RATE))


def pair(part: str) -> tuple[str, str]:
    """The names of the left and the right joint of a part."""
    left, right = (sided(side, part) for side in LEFT_RIGHT)
    return left, right


def direction(vectors: Array) -> Array:
    """Vectors (T, N) at length 1."""
    return vectors / np.maximum(length(vectors), 1e-9)[:, None]


def calm(values: Array, seconds: float) -> Array:
    """Values (T, ...) averaged over a window of so many seconds; at the ends over the part of it that there is."""
    return running_mean(values, 2 * (round(seconds * RATE) // 2) + 1)


def longest(flags: Flags) -> float:
    """Seconds of the longest stretch over which flags (T,) are true."""
    return max((stop - start for start, stop in spells(flags)), default=0) / RATE


def swings(values: Array, least: float) -> int:
    """How many times values (T,) rise or fall by at least ``least``; what goes back by less is part of the same."""
    count, rising, low, high = 0, None, np.inf, -np.inf
    for value in values.tolist():
        low, high = min(low, value), max(high, value)
        up, down = value - low >= least and rising is not True, high - value >= least and rising is not False
        if up or down:
            count, rising, low, high = count + 1, up, value, value
    return count
