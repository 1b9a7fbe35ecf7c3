"""How good the motions of a prompt are, whatever they show: sliding feet, jerk, sinking in, variety, duration."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from motet.motion.feet import feet_of
from motet.motion.humanoid import HUMANOID
from motet.motion.rotations import Array
from motet_train.evaluate.feet import sliding
from motet_train.evaluate.says.track import RATE, Track

POSES = 32
"""Poses, evenly spaced in time, by which two motions of any length are compared."""

FEET = feet_of(HUMANOID)


def slide(track: Track) -> float:
    """How fast feet on the ground slide, m/s (:func:`motet_train.evaluate.feet.sliding`)."""
    return sliding(track.points[:, FEET], RATE)


def jerk(track: Track) -> float:
    """The mean length of the third difference of joint positions, m/s^3; NaN for less than four frames."""
    third = np.diff(track.points, n=3, axis=0) * RATE**3
    return float(np.linalg.norm(third, axis=-1).mean()) if len(third) else np.nan


def depth(track: Track) -> float:
    """How deep the lowest joint is under y = 0, metres: the mean over all frames, 0 where it is above."""
    return float(np.maximum(-track.points[..., 1].min(axis=1), 0).mean())


def distance(one: Array, other: Array) -> float:
    """The mean distance of joints, metres, between the :func:`poses` of two motions."""
    return float(np.linalg.norm(one - other, axis=-1).mean())


def poses(track: Track) -> Array:
    """Poses (POSES, J, 3), evenly spaced in time: what is in front, to the left and how high, each seen from the hips,
    so that neither the place nor the heading nor how long it takes makes a difference."""
    frames = np.round(np.linspace(0, len(track) - 1, POSES)).astype(int)
    part = Track(track.points[frames])
    part.__dict__["ground"] = track.ground
    return np.stack([part.body(name) for name in HUMANOID.names], axis=1)


def spread(tracks: Sequence[Track]) -> float:
    """The mean :func:`distance` between two of several motions; NaN for less than two."""
    seen = [poses(track) for track in tracks]
    pairs = [distance(one, other) for one, other in combinations(seen, 2)]
    return float(np.mean(pairs)) if pairs else np.nan
