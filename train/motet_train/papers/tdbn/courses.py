"""Where recorded figures go, as control values of their frames: six numbers from 0 to 1 (:data:`LABELS`)."""

import numpy as np
from numpy.typing import ArrayLike

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_sixd import ROOT_SIXD

LABELS = ("forward", "backward", "left", "right", "turn_left", "turn_right")

FULL_CONTROL = (4.5, 4.5, 3.0)
"""What a value of 1 stands for, ahead, aside (m/s) and turning (rad/s)."""

COURSE_S = 0.5
"""Seconds to come over which a value is the mean."""


def controls_of(velocities: ArrayLike) -> Array:
    """Velocities (..., 3), forward, to the left (m/s) and turning to the left (rad/s), as control values (..., 6)."""
    shares = np.asarray(velocities, dtype=np.float64) / FULL_CONTROL
    both = np.stack([shares, -shares], axis=-1)
    values: Array = np.clip(both, 0, 1).reshape(*shares.shape[:-1], len(LABELS))
    return values


def course(features: Motion) -> Array:
    """Velocities (T, 3) of frames in ``root_sixd``: each the mean of the next :data:`COURSE_S`, or to the end."""
    values = features.select(ROOT_SIXD[:3]).values
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
    start = np.arange(len(values))
    stop = np.minimum(start + max(1, round(COURSE_S * features.fps)), len(values))
    found: Array = (total[stop] - total[start]) / (stop - start)[:, None]
    return found
