"""Feet that slide."""

import numpy as np

from motet.motion.feet import ground_of
from motet.motion.rotations import Array

LOW = 0.05
"""m: a joint of a foot no higher than this above the ground is on it."""


def sliding(feet: Array, fps: float) -> float:
    """How fast feet on the ground slide, m/s, from positions (T, K, 3) in metres: the mean over all steps from one
    frame to the next.

    A joint counts that is on the ground (LOW) before and after the step; of several the slowest does, since the others
    roll. NaN where none ever is.
    """
    low = feet[..., 1] <= ground_of(feet[..., 1]) + LOW
    slides = np.linalg.norm(np.diff(feet[..., [0, 2]], axis=0), axis=-1) * fps
    slides[~(low[1:] & low[:-1])] = np.inf
    slowest = slides.min(axis=1)
    standing = np.isfinite(slowest)
    return float(slowest[standing].mean()) if standing.any() else np.nan
