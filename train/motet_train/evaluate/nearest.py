"""The nearest of some points."""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array

PART = 4096
"""Frames that are compared with all points at once."""


def nearest(frames: Array, points: Array) -> tuple[NDArray[np.intp], Array]:
    """For each of frames (M, D) the index (M,) of the nearest of points (N, D), and its distance (M,)."""
    squares = (points**2).sum(axis=1)
    found = np.empty(len(frames), dtype=np.intp)
    for start in range(0, len(frames), PART):
        part = slice(start, start + PART)
        found[part] = (squares - 2 * frames[part] @ points.T).argmin(axis=1)
    distance: Array = np.linalg.norm(frames - points[found], axis=1)
    return found, distance
