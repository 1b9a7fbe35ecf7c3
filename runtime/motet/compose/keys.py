"""A motion made to pass through given places, facings and poses: motion warping (Witkin and Popović 1995).

What lacks at a key is added to the motion around it, so all the motion's own detail stays. The path keeps what was
added from the last key on; poses return to the motion's own.
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
"""Metres and radians: what is asked for twice may differ by this."""


@dataclass(frozen=True, eq=False)
class Key:
    """What a figure is to be at one frame.

    turns: joint -> its rotation (3, 3) in its parent's frame. place: x, y and z of the root. facing: radians about the
    vertical axis, 0 along z and positive towards x. Of place and facing what is free is NaN.
    """

    turns: Mapping[int, Array] = field(default_factory=dict)
    place: Array = field(default_factory=lambda: np.full(3, np.nan))
    facing: float = np.nan

    def joined(self, other: "Key") -> "Key":
        """Both keys of one frame; MotionError where they contradict each other."""
        shared = self.turns.keys() & other.turns.keys()
        off = [np.linalg.norm(rotmat_to_rotvec(self.turns[joint].T @ other.turns[joint])) for joint in shared]
        off += [*np.abs(self.place - other.place), np.abs(wrapped(np.array(self.facing - other.facing)))]
        if any(one > ALIKE for one in off):  # what is free is NaN
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
        led = self._led({frame: keys[frame] for frame in sorted(keys)})
        turns, root = led.turns.copy(), led.root.copy()
        rises = {frame: key.place[1:2] - root[frame, 1:2] for frame, key in keys.items() if np.isfinite(key.place[1])}
        root[:, 1:2] += _swell(rises, len(root), reach)
        for joint in set().union(*(key.turns for key in keys.values())):
            own = turns[:, joint]
            off = {f: rotmat_to_rotvec(key.turns[joint] @ own[f].T) for f, key in keys.items() if joint in key.turns}
            turns[:, joint] = product(rotvec_to_rotmat(_swell(off, len(root), reach)), own)
        return Moves(turns, root, led.facing)

    def _led(self, keys: Mapping[int, Key]) -> "Moves":
        """The path turned and moved over the ground, as a whole before the first key and after the last, and evenly in
        between."""
        frames = np.arange(len(self.root))
        off = {frame: turn for frame, key in keys.items() if np.isfinite(turn := self._off(frame, key))}
        angle = np.interp(frames, list(off), np.unwrap(list(off.values()))) if off else np.zeros(len(frames))
        about = axis_to_rotmat("y", angle)
        turns = np.concatenate([product(about, self.turns[:, 0])[:, None], self.turns[:, 1:]], axis=1)
        steps = np.diff(self.root, axis=0, prepend=self.root[:1])
        root = self.root[:1] + np.cumsum(rotated(about, steps), axis=0)
        for axis in (0, 2):
            pins = {frame: key.place[axis] - root[frame, axis] for frame, key in keys.items()}
            pins = {frame: pin for frame, pin in pins.items() if np.isfinite(pin)}
            root[:, axis] += np.interp(frames, list(pins), list(pins.values())) if pins else 0.0
        return Moves(turns, root, self.facing + angle)

    def _off(self, frame: int, key: Key) -> float:
        """By how much a key faces elsewhere, in radians; NaN where it does not say."""
        if 0 in key.turns and np.isnan(key.facing):
            return float(rotmat_to_rotvec(twist((key.turns[0] @ self.turns[frame, 0].T)[None], UP))[0, 1])
        return float(wrapped(np.array(key.facing - self.facing[frame])))


def _swell(values: Mapping[int, Array], count: int, reach: int) -> Array:
    """Values (count, ...) that are those given at frames, and rise from and fall to zero within ``reach`` frames,
    smoothly; keys nearer to each other than that are led from one to the next."""
    if not values:
        return np.zeros((count, 1))
    frames = sorted(values)
    knots = {frames[0] - reach: 0 * values[frames[0]], frames[-1] + reach: 0 * values[frames[0]]}
    for one, two in pairwise(frames):
        if two - one > 2 * reach:
            knots |= {one + reach: 0 * values[one], two - reach: 0 * values[one]}
    knots |= values
    at = np.array(sorted(knots))
    height = np.array([knots[frame] for frame in at.tolist()])
    now = np.arange(count).clip(at[0], at[-1])
    before = np.searchsorted(at, now, side="right").clip(1, len(at) - 1) - 1
    part = ((now - at[before]) / (at[before + 1] - at[before]))[:, None]
    found: Array = height[before] + part**2 * (3 - 2 * part) * (height[before + 1] - height[before])
    return found
