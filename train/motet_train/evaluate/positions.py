"""Measures of joints' positions alone, of any figure, by any model: how feet stand and slide, how calmly joints move.

A point of the sole **stands** in a frame where it is near the ground and nearer to staying than to going along: it is
no higher than 3 cm above its own ground, the height under which it is in a tenth of all frames (a recorded figure's
soles are not equally thick), and it goes forward, the way that the root goes, less than half as fast as the root. Both
are seen from points smoothed over .05 s, so that trembling does not break a stance; what is then measured is not
smoothed. A **stance** is a run of at least .1 s of such frames.

Letters in shapes: T frames, K points, J joints. Lengths are metres, y is up.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from motet.motion.feet.contacts import ContactSettings, ground_of, ground_speeds, smoothed, standing
from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.kinematics import local_rotations
from motet.motion.motion import Motion
from motet.motion.rotations import Array

Flags = NDArray[np.bool_]
"""What is so in which frames."""

BALLS = [HUMANOID.index(sided(side, "Toes")) for side in LEFT_RIGHT]
"""The humanoid's joints in the balls of the feet, which stay in place from the heel's landing to the toes' leaving."""


def length(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., N)."""
    found: Array = np.linalg.norm(vectors, axis=-1)
    return found


def spells(flags: Flags) -> list[tuple[int, int]]:
    """The frames (start, stop) of each stretch over which flags (T,) are true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def running_mean(values: Array, window: int) -> Array:
    """Means of values (T, ...) over so many frames; at the ends over the part of the window that there is."""
    from scipy.ndimage import uniform_filter1d  # for this alone, so that training does not load it

    total, frames = (uniform_filter1d(of, window, axis=0, mode="constant") for of in (values, np.ones_like(values)))
    found: Array = total / frames
    return found


def arrival(inside: Flags, fps: float) -> Array:
    """Seconds (B,) until ``inside`` (T, B) holds until the end; infinite where it does not."""
    frames = len(inside) - np.cumprod(inside[::-1], axis=0).sum(axis=0)
    return np.where(frames < len(inside), (frames + 1) / fps, np.inf)


def stances(points: Array, root: Array, fps: float) -> list[Array]:
    """The positions (N, 3) of a point in each stance, of all points (T, K, 3), beside the root's (T, 3)."""
    calm, way = smoothed(points, 0.05, fps), np.gradient(smoothed(root[:, None], 0.05, fps)[:, 0], axis=0)
    ground = np.array([ground_of(calm[:, [k], 1]) for k in range(points.shape[1])])
    ahead = np.gradient(calm, axis=0) - way[:, None] / 2
    forward = (ahead[..., [0, 2]] * way[:, None, [0, 2]]).sum(axis=-1)
    stands = standing(calm[..., 1] - ground, forward, ContactSettings(heights=(0.03, 0.03), speeds=(0.0, 0.0)))
    runs = ((k, *run) for k, flags in enumerate(stands.T) for run in spells(flags))
    return [points[start:stop, k] for k, start, stop in runs if stop - start >= 0.1 * fps]


def slides(stances: Iterable[Array]) -> Array:
    """How far points slide in stances, metres: of each stance (N, 3) the largest distance over the ground between two
    of a point's places."""
    return np.array([length(place[:, None, [0, 2]] - place[:, [0, 2]]).max() for place in stances])


def slide(stances: Iterable[Array]) -> float:
    """The mean of :func:`slides`; NaN without a stance."""
    return mean_and_tail(slides(stances))[0]


def mean_and_tail(values: Array) -> tuple[float, float]:
    """The mean and the 95th percentile of values (N,); NaN without one."""
    return (float(values.mean()), float(np.percentile(values, 95))) if len(values) else (np.nan, np.nan)


def speed(points: Array, root: Array, fps: float) -> float:
    """How fast points (T, K, 3) go over the ground while they stand, m/s: the median over all frames of all stances.
    NaN without a stance."""
    steps = [length(np.diff(place[:, [0, 2]], axis=0)) for place in stances(points, root, fps)]
    return float(np.median(np.concatenate(steps))) * fps if steps else np.nan


def skate(feet: Array, heights: Array, low: float, fps: float, slowest: bool = False) -> float:
    """How fast feet (T, K, 3) on the ground slide, m/s: the mean speed over the ground from one frame to the next, in
    both of which a foot is no higher than ``low`` metres, by its heights (T, K). NaN where none ever is.

    slowest: of several joints that stand only the slowest counts, since the others roll.
    """
    stands = standing(heights, None, ContactSettings(heights=(low, low)))
    speeds = np.where(stands[1:] & stands[:-1], ground_speeds(feet, fps), np.inf)
    if slowest:
        speeds = speeds.min(axis=1)
    stood = speeds[np.isfinite(speeds)]
    return float(stood.mean()) if len(stood) else np.nan


def acceleration(joints: Array, root: Array, fps: float) -> float:
    """How much joints (T, J, 3) tremble, m/s^2: the median length of their acceleration as seen from the root (T, 3),
    over all joints and frames."""
    second = np.diff(joints - root[:, None], n=2, axis=0) * fps**2
    return float(np.median(length(second))) if len(second) else np.nan


def jerk(joints: Array, fps: float) -> float:
    """The mean length of the third difference of joints (..., T, J, 3), m/s^3; NaN for less than four frames."""
    third = np.diff(joints, n=3, axis=-3) * fps**3
    return float(length(third).mean()) if third.size else np.nan


def leap(motion: Motion) -> float:
    """The largest angle, degrees, that any joint turns by from one frame to the next, seen from its parent."""
    turns = local_rotations(motion)
    between = np.einsum("tjba,tjbc->tjac", turns[:-1], turns[1:])
    cosine = (np.trace(between, axis1=2, axis2=3) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).max(initial=0.0))
