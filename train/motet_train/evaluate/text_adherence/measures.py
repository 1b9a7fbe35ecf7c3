"""How good the motions of a prompt are, whatever they show: sliding feet, jerk, sinking in, variety, duration."""

from collections.abc import Sequence

import numpy as np

from motet.motion.feet.contacts import ContactSettings, feet_of, ground_of, ground_speeds, standing
from motet.motion.humanoid import HUMANOID
from motet.motion.rotations import Array
from motet_train.evaluate.text_adherence.track import RATE, Track, pair

BALLS_STAND = ContactSettings(heights=(0.04, 0.04))
"""The ball of a foot that is no higher than 2 cm above where it is in standing is on the ground."""

BALLS = [HUMANOID.index(name) for name in pair("Toes")]
"""The joints in the balls of the feet, which stay in place from the heel's landing to the toes' leaving."""


def slide(track: Track) -> float:
    """How fast feet on the ground slide, m/s: the mean speed over the ground of the balls of the feet from one frame to
    the next, in both of which they stand. NaN where none ever does."""
    balls = track.points[:, BALLS]
    low = standing(balls[..., 1] - ground_of(track.points[:, feet_of(HUMANOID), 1]), None, BALLS_STAND)
    stands = low[1:] & low[:-1]
    return float(ground_speeds(balls, RATE)[stands].mean()) if stands.any() else np.nan


def jerk(track: Track) -> float:
    """The mean length of the third difference of joint positions, m/s^3; NaN for less than four frames."""
    third = np.diff(track.points, n=3, axis=0) * RATE**3
    return float(np.linalg.norm(third, axis=-1).mean()) if len(third) else np.nan


def depth(track: Track) -> float:
    """How deep the lowest joint is under y = 0, metres: the mean over all frames, 0 where it is above."""
    return float(np.maximum(-track.points[..., 1].min(axis=1), 0).mean())


def poses(track: Track, count: int = 32) -> Array:
    """Poses (count, J, 3), evenly spaced in time: what is in front, to the left and how high, each seen from the hips,
    so that neither the place nor the heading nor how long it takes makes a difference."""
    frames = np.round(np.linspace(0, len(track) - 1, count)).astype(int)
    part = track.on_ground(track.points[frames])
    return np.stack([part.body(name) for name in HUMANOID.names], axis=1)


def distance(one: Array, other: Array) -> float:
    """The mean distance of joints, metres, between the :func:`poses` of two motions."""
    return float(np.linalg.norm(one - other, axis=-1).mean())


def spread(tracks: Sequence[Track]) -> float:
    """The mean :func:`distance` between two of several motions; NaN for less than two."""
    seen = [poses(track) for track in tracks]
    pairs = [distance(one, other) for i, one in enumerate(seen) for other in seen[:i]]
    return float(np.mean(pairs)) if pairs else np.nan
