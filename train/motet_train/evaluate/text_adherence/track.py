"""A figure as a camera would see it: the positions of its joints, and what follows from them."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import find_objects, label, uniform_filter1d

from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, on_humanoid, sided
from motet.motion.kinematics import positions
from motet.motion.motion import Motion, resampled
from motet.motion.rotations import Array
from motet_train.data.errors import DataError

Flags = NDArray[np.bool_]
"""What is so in which frames."""

RATE = 30.0
"""Frames per second at which rules look at a motion, whatever its own rate is."""


def pair(part: str) -> tuple[str, str]:
    """The names of the left and the right joint of a part."""
    left, right = (sided(side, part) for side in LEFT_RIGHT)
    return left, right


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

    def part(self, start: float, stop: float) -> "Track":
        """The part between two times, each a share of the whole; one frame at least. The ground stays the same."""
        first = min(int(start * len(self)), len(self) - 1)
        return self.on_ground(self.points[first : max(first + 1, round(stop * len(self)))])

    def on_ground(self, points: Array) -> "Track":
        """Some frames (T', J, 3) of the same track, above the same ground."""
        found = replace(self, points=points)
        found.__dict__["ground"] = self.ground
        return found

    def joint(self, name: str) -> Array:
        """Positions (T, 3) of one joint."""
        found: Array = self.points[:, HUMANOID.index(name)]
        return found

    @cached_property
    def ground(self) -> float:
        """The height under which the lowest joint is in one frame of twenty: single bad frames do not matter."""
        return float(np.percentile(self.points[..., 1].min(axis=1), 5))

    def height(self, name: str) -> Array:
        """Height (T,) of a joint above the ground."""
        return self.joint(name)[:, 1] - self.ground

    def heights(self, part: str) -> tuple[Array, Array]:
        """Heights (T,) of the left and the right joint of a part above the ground."""
        left, right = pair(part)
        return self.height(left), self.height(right)

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
        pairs = [[self.joint(name) for name in pair(part)] for part in ("UpperLeg", "UpperArm")]
        across = np.sum([_unit((left - right)[:, [0, 2]]) for left, right in pairs], axis=0)
        found: Array = np.degrees(np.unwrap(np.arctan2(-across[:, 1], across[:, 0])))
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
        found: Array = np.linalg.norm(self.velocity, axis=1)
        return found

    def body(self, name: str) -> Array:
        """A joint (T, 3) as the figure sees it: to its left and in front of its hips, and above the ground (y)."""
        (x, _, z), angle = (self.joint(name) - self.joint("hips")).T, np.radians(self.facing)
        left, front = x * np.cos(angle) - z * np.sin(angle), x * np.sin(angle) + z * np.cos(angle)
        return np.stack([left, self.height(name), front], axis=1)

    def bodies(self, part: str) -> tuple[Array, Array]:
        """The left and the right joint of a part as :meth:`body` gives them."""
        left, right = pair(part)
        return self.body(left), self.body(right)

    def motion_of(self, name: str, beside: str = "hips") -> Array:
        """Speed (T,) of a joint relative to another one, m/s, over a tenth of a second."""
        steps = np.linalg.norm(np.diff(self.joint(name) - self.joint(beside), axis=0), axis=1) * RATE
        return np.concatenate([[0.0], calm(steps, 0.1)])

    def angle(self, above: str, joint: str, below: str) -> Array:
        """The angle (T,) between two bones at a joint, degrees: 180 where they are in line."""
        one, other = (_unit(self.joint(end) - self.joint(joint)) for end in (above, below))
        found: Array = np.degrees(np.arccos(np.clip((one * other).sum(axis=-1), -1, 1)))
        return found


def track_of(motion: Motion) -> Track:
    """The track of a motion of any human figure; MotionError for a figure that is none, or no frames."""
    own = on_humanoid(motion)
    return Track(resampled(positions(own), own.fps / RATE))


def calm(values: Array, seconds: float) -> Array:
    """Values (T, ...) averaged over a window of so many seconds; at the ends over the part of it that there is."""
    window = 2 * (round(seconds * RATE) // 2) + 1
    total, frames = (uniform_filter1d(of, window, axis=0, mode="constant") for of in (values, np.ones_like(values)))
    found: Array = total / frames
    return found


def spells(flags: Flags) -> list[tuple[int, int]]:
    """The frames (start, stop) of each stretch over which flags (T,) are true."""
    return [(part.start, part.stop) for (part,) in find_objects(label(flags)[0])]


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


def _unit(vectors: Array) -> Array:
    found: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-9)
    return found
