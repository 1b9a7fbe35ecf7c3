"""Measures of joint positions alone, for any figure and any model: how feet stand and slide, how calmly joints move.

A point of the sole **stands** in a frame if it is near the ground and closer to staying than to moving along: it is at
most 3 cm above its own ground, the 10th percentile of its height (the soles of a recorded figure are not equally
thick), and in the direction of the root's travel it moves less than half as fast as the root. Both are decided on
points smoothed over .05 s, so that trembling does not break a stance; the measures use the unsmoothed points. A
**stance** is a run of such frames of at least .1 s.

Letters in shapes: T frames, K points, J joints. Lengths are metres, y is up.
"""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from motet.figures.feet.contacts import ContactSettings, ground_of, ground_speeds, smoothed, standing
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.kinematics import local_rotations
from motet.motion.motion import Motion
from motet.motion.rotations import Array

Flags = NDArray[np.bool_]
"""A boolean for each frame."""

BALLS = [HUMANOID.index(sided(side, "Toes")) for side in LEFT_RIGHT]
"""The humanoid's joints in the balls of the feet, which stay in place from the heel's landing to the toes' leaving."""


def length(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., N)."""
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths


def spells(flags: Flags) -> list[tuple[int, int]]:
    """The frames (start, stop) of each run of true flags (T,)."""
    padded = np.concatenate([[False], flags, [False]])
    edges = np.flatnonzero(np.diff(padded)).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def running_mean(values: Array, window: int) -> Array:
    """Means of values (T, ...) over ``window`` frames, or over the frames in range at both ends."""
    from scipy.ndimage import uniform_filter1d  # imported here, so that training does not load scipy

    total = uniform_filter1d(values, window, axis=0, mode="constant")
    frames_in_range = uniform_filter1d(np.ones_like(values), window, axis=0, mode="constant")
    means: Array = total / frames_in_range
    return means


def arrival(inside: Flags, fps: float) -> Array:
    """Seconds (B,) after which ``inside`` (T, B) holds to the end; infinite where it never does."""
    frames_held = np.cumprod(inside[::-1], axis=0).sum(axis=0)
    frames = len(inside) - frames_held
    return np.where(frames < len(inside), (frames + 1) / fps, np.inf)


def stances(points: Array, root: Array, fps: float) -> list[Array]:
    """The positions (N, 3) of a point in each stance, for all points (T, K, 3) of a figure with its root at (T, 3)."""
    runs = []
    for point, flags in enumerate(standing_points(points, root, fps).T):
        for start, stop in spells(flags):
            if stop - start >= 0.1 * fps:
                runs.append(points[start:stop, point])
    return runs


def standing_points(points: Array, root: Array, fps: float) -> Flags:
    """Whether points (T, K, 3) of a figure with its root at (T, 3) stand (T, K)."""
    smooth_points = smoothed(points, 0.05, fps)
    smooth_root = smoothed(root[:, None], 0.05, fps)

    # heights of points above their own ground
    grounds = [ground_of(smooth_points[:, [k], 1]) for k in range(points.shape[1])]
    heights = smooth_points[..., 1] - np.array(grounds)

    # whether a point moves along with the root at more than half its speed
    root_step = np.gradient(smooth_root, axis=0)
    step_ahead = np.gradient(smooth_points, axis=0) - root_step / 2
    forward = (step_ahead[..., [0, 2]] * root_step[..., [0, 2]]).sum(axis=-1)
    return standing(heights, forward, ContactSettings(heights=(0.03, 0.03), speeds=(0.0, 0.0)))


def slides(stances: Iterable[Array]) -> Array:
    """How far a point slides in each stance (N, 3), metres: the largest distance over the ground between two of its
    places."""
    largest = []
    for places in stances:
        ground_places = places[:, [0, 2]]
        largest.append(length(ground_places[:, None] - ground_places).max())
    return np.array(largest)


def slide(stances: Iterable[Array]) -> float:
    """The mean of :func:`slides`; NaN without a stance."""
    return mean_and_tail(slides(stances))[0]


def mean_and_tail(values: Array) -> tuple[float, float]:
    """The mean and the 95th percentile of values (N,); NaN without a value."""
    if len(values) == 0:
        return np.nan, np.nan
    return values.mean(), np.percentile(values, 95)


def speed(points: Array, root: Array, fps: float) -> float:
    """How fast points (T, K, 3) move over the ground while they stand, m/s: the median over all frames of all stances.
    NaN without a stance."""
    steps = [length(np.diff(places[:, [0, 2]], axis=0)) for places in stances(points, root, fps)]
    return np.median(np.concatenate(steps)) * fps if steps else np.nan


def skate(feet: Array, heights: Array, low: float, fps: float, slowest: bool = False) -> float:
    """How fast feet (T, K, 3) on the ground slide, m/s: the mean speed over the ground between two frames, in both of
    which a foot is at most ``low`` metres high by its heights (T, K). NaN without such frames.

    slowest: count only the slowest of the joints that stand, since the others roll.
    """
    stands = standing(heights, None, ContactSettings(heights=(low, low)))
    speeds = np.where(stands[1:] & stands[:-1], ground_speeds(feet, fps), np.inf)
    if slowest:
        speeds = speeds.min(axis=1)
    stood = speeds[np.isfinite(speeds)]
    return stood.mean() if len(stood) else np.nan


def acceleration(joints: Array, root: Array, fps: float) -> float:
    """How much joints (T, J, 3) tremble, m/s^2: the median magnitude of their acceleration relative to the root (T, 3),
    over all joints and frames."""
    second = np.diff(joints - root[:, None], n=2, axis=0) * fps**2
    return np.median(length(second)) if len(second) else np.nan


def jerk(joints: Array, fps: float) -> float:
    """The mean magnitude of the third difference of joints (..., T, J, 3), m/s^3; NaN below four frames."""
    third = np.diff(joints, n=3, axis=-3) * fps**3
    return length(third).mean() if third.size else np.nan


def leap(motion: Motion) -> float:
    """The largest angle in degrees by which any joint turns, relative to its parent, between two frames."""
    rotations = local_rotations(motion)
    between = np.einsum("tjba,tjbc->tjac", rotations[:-1], rotations[1:])
    cosines = (np.trace(between, axis1=2, axis2=3) - 1) / 2
    angles = np.arccos(np.clip(cosines, -1, 1))
    return float(np.degrees(angles).max(initial=0.0))
