"""A motion made to pass through given places, facings and poses: motion warping (Witkin and Popović 1995).

The difference from a key is added to the motion around it, so that the motion keeps its detail. After the last key the
path keeps its offset, and poses return to those of the motion.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.motion.rotations import (
    UP,
    Array,
    axis_to_rotmat,
    product,
    rotated,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
    twist,
    wrapped,
)

ALIKE = 0.01
"""Metres and radians by which two keys of one frame may differ."""


@dataclass(frozen=True, eq=False)
class Key:
    """The pose, place and facing of a figure at one frame, as far as they are fixed."""

    turns: Mapping[int, Array] = field(default_factory=dict)
    """Joint -> its rotation (3, 3) in its parent's frame."""

    place: Array = field(default_factory=lambda: np.full(3, np.nan))
    """x, y and z of the root; NaN where free."""

    facing: float = np.nan
    """Radians about the vertical axis, 0 along z and positive towards x; NaN where free."""

    def joined(self, other: "Key") -> "Key":
        """Both keys of one frame; MotionError where they contradict each other."""
        shared = self.turns.keys() & other.turns.keys()
        off = [np.linalg.norm(rotmat_to_rotvec(self.turns[joint].T @ other.turns[joint])) for joint in shared]
        off += [*np.abs(self.place - other.place), np.abs(wrapped(np.array(self.facing - other.facing)))]
        if any(distance > ALIKE for distance in off):  # NaN where one of them is free
            raise MotionError("two constraints ask for different poses or places at the same time")
        place = np.where(np.isnan(self.place), other.place, self.place)
        facing = other.facing if np.isnan(self.facing) else self.facing
        return Key({**other.turns, **self.turns}, place, facing)


@dataclass(frozen=True, eq=False)
class Moves:
    """A figure's motion as arrays: rotations (T, J, 3, 3) in the parents' frames, the root's places (T, 3) in metres,
    and where the figure faces (T,), in radians, unwrapped."""

    turns: Array
    root: Array
    facing: Array

    def through(self, keys: Mapping[int, Key], reach: int) -> "Moves":
        """The motion that passes through keys, by frame; every key is met exactly.

        reach: frames before and after a key from which the pose leaves, and to which it returns to, the motion's own.
        """
        moves = self._led({frame: keys[frame] for frame in sorted(keys)})
        turns = moves.turns.copy()
        root = moves.root.copy()

        # The height of the root.
        rises = {}
        for frame, key in keys.items():
            if np.isfinite(key.place[1]):
                rises[frame] = key.place[1:2] - root[frame, 1:2]
        root[:, 1:2] += _swell(rises, len(root), reach)

        # The rotation of each joint.
        for joint in set[int]().union(*(key.turns for key in keys.values())):
            rotations = {frame: key.turns[joint] for frame, key in keys.items() if joint in key.turns}
            turns[:, joint] = _turned(turns[:, joint], rotations, reach)
        return Moves(turns, root, moves.facing)

    def _led(self, keys: Mapping[int, Key]) -> "Moves":
        """The path turned and moved over the ground, as a whole before the first key and after the last, and evenly in
        between."""
        count = len(self.root)

        # Turned, every step of the path about the vertical axis.
        turn = {frame: self._off(frame, key) for frame, key in keys.items()}
        angle = _evenly(turn, count)
        about = axis_to_rotmat("y", angle)
        turns = self.turns.copy()
        turns[:, 0] = product(about, turns[:, 0])
        steps = np.diff(self.root, axis=0, prepend=self.root[:1])
        root = self.root[:1] + np.cumsum(rotated(about, steps), axis=0)

        # Then moved along x and z.
        for axis in (0, 2):
            shift = {frame: float(key.place[axis] - root[frame, axis]) for frame, key in keys.items()}
            root[:, axis] += _evenly(shift, count, wraps=False)
        return Moves(turns, root, self.facing + angle)

    def _off(self, frame: int, key: Key) -> float:
        """The angle from the motion's facing to a key's, in radians; NaN where that is free."""
        if 0 in key.turns and np.isnan(key.facing):
            return float(rotmat_to_rotvec(twist((key.turns[0] @ self.turns[frame, 0].T)[None], UP))[0, 1])
        return float(wrapped(np.array(key.facing - self.facing[frame])))


def _turned(rotations: Array, keys: Mapping[int, Array], reach: int) -> Array:
    """Rotations (T, 3, 3) of a joint that pass through those of keys, each (3, 3), by frame."""
    differences = {frame: rotmat_to_rotvec(key @ rotations[frame].T) for frame, key in keys.items()}
    return product(rotvec_to_rotmat(_swell(differences, len(rotations), reach)), rotations)


def _evenly(values: Mapping[int, float], count: int, wraps: bool = True) -> Array:
    """Values (count,) that go evenly from one value to the next, NaN ones left out; 0 where there are none.
    wraps: whether they are angles."""
    finite = {frame: value for frame, value in values.items() if np.isfinite(value)}
    if not finite:
        return np.zeros(count)
    heights = list(finite.values())
    return np.interp(np.arange(count), list(finite), np.unwrap(heights) if wraps else heights)


def _swell(values: Mapping[int, Array], count: int, reach: int) -> Array:
    """Values (count, ...) that equal some values at their frames, and rise and fall smoothly within ``reach`` frames;
    between keys that are nearer to each other they go from one to the next."""
    if not values:
        return np.zeros((count, 1))
    knots = _knots(values, reach)
    knot_frames = np.array(sorted(knots))
    heights = np.array([knots[frame] for frame in knot_frames.tolist()])

    # Between two knots, a cubic that is flat at both.
    frames = np.arange(count).clip(knot_frames[0], knot_frames[-1])
    left = np.searchsorted(knot_frames, frames, side="right").clip(1, len(knots) - 1) - 1
    right = left + 1
    share = ((frames - knot_frames[left]) / (knot_frames[right] - knot_frames[left]))[:, None]
    swell: Array = heights[left] + share**2 * (3 - 2 * share) * (heights[right] - heights[left])
    return swell


def _knots(values: Mapping[int, Array], reach: int) -> dict[int, Array]:
    """The values by frame, and zeros ``reach`` frames before and after those that have no neighbour there."""
    frames = sorted(values)
    zero = 0 * values[frames[0]]
    knots = {frames[0] - reach: zero, frames[-1] + reach: zero}
    for before, after in pairwise(frames):
        if after - before > 2 * reach:
            knots[before + reach] = zero
            knots[after - reach] = zero
    return knots | dict(values)
