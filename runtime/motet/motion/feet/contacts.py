"""Which feet stand: the one definition used for planting and holding feet and for measuring foot sliding.

A point of a foot stands if it is low and slow. Only the bounds depend on the points and the source of the motion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton, partners_of

GROUND_PERCENT = 10
"""Percentage of frames whose lowest point of the feet is below ground."""


@dataclass(frozen=True)
class ContactSettings:
    """Two bounds each: up to the first a point surely stands, from the second it does not at all; equal bounds are a
    threshold.

    heights: metres above the ground. speeds: metres a second over it. calm: seconds, the standard deviation of the
    window that a speed is smoothed by.
    """

    heights: tuple[float, float] = (0.02, 0.05)
    speeds: tuple[float, float] = (0.3, 0.9)
    calm: float = 0.015


SOLES = ContactSettings()
"""For the points of soles."""


def contacts(heights: Array, speeds: Array | None, settings: ContactSettings) -> Array:
    """Ground contact of points, from 0 to 1, from their heights in m and speeds in m/s, both of one shape.

    speeds: None if only the height counts.
    """
    low = 1 - rise(heights, *settings.heights)
    return low if speeds is None else low * (1 - rise(speeds, *settings.speeds))


def standing(heights: Array, speeds: Array | None, settings: ContactSettings) -> NDArray[np.bool_]:
    """Which points surely stand, as in :func:`contacts`."""
    found: NDArray[np.bool_] = contacts(heights, speeds, settings) == 1
    return found


def contacts_of(points: Array, fps: float, settings: ContactSettings = SOLES) -> Array:
    """Contact of points (T, K, 3), over ground at 0, from each frame to the next, (T - 1, K) from 0 to 1."""
    calm = smoothed(points, settings.calm, fps)
    return contacts((points[1:, :, 1] + points[:-1, :, 1]) / 2, ground_speeds(calm, fps), settings)


def ground_speeds(points: Array, fps: float) -> Array:
    """Speeds (..., T - 1, K) over the ground of points (..., T, K, 3), per frame."""
    speeds: Array = np.linalg.norm(np.diff(points[..., [0, 2]], axis=-3), axis=-1) * fps
    return speeds


def rise(values: Array, start: float, end: float) -> Array:
    """Smoothly from 0 at ``start`` to 1 at ``end`` (Perlin's "smootherstep", 2002)."""
    part = np.clip((values - start) / max(end - start, 1e-12), 0, 1)
    found: Array = part**3 * (10 - 15 * part + 6 * part**2)
    return found


def smoothed(points: Array, calm: float, fps: float) -> Array:
    """Points (T, ..., ...) smoothed by a Gaussian window in time, extrapolated at both ends.

    calm: its standard deviation in seconds.
    """
    reach = round(3 * calm * fps)
    if len(points) < 2 or not reach:
        return points
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (calm * fps)) ** 2)
    padded = np.pad(points, ((reach, reach), (0, 0), (0, 0)), mode="reflect", reflect_type="odd")
    found: Array = sum(weight * padded[i : i + len(points)] for i, weight in enumerate(window / window.sum()))
    return found


def feet_of(skeleton: Skeleton) -> list[int]:
    """Indices of the joints of both feet, the low ones at rest; MotionError if no joints are paired."""
    if not has_feet(skeleton):
        raise MotionError("no left-right pairs of joints to find the feet among: name the joints of the feet")
    paired, height = _paired(skeleton), skeleton.rest_positions[:, 1]
    # joints of the feet are within a tenth of the figure's height
    return [i for i in paired if height[i] <= height[paired].min() + 0.1 * skeleton.height]


def has_feet(skeleton: Skeleton) -> bool:
    """Whether there are left-right pairs of joints to find the feet among."""
    return bool(_paired(skeleton))


def _paired(skeleton: Skeleton) -> list[int]:
    return [i for i, partner in enumerate(partners_of(skeleton.names)) if partner != i]


def ground_of(heights: Array) -> float:
    """The height of the ground under feet at ``heights`` (T, K)."""
    return float(np.percentile(heights.min(axis=1), GROUND_PERCENT))
