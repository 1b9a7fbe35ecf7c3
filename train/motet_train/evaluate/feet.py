"""How well feet stand and how calmly joints move, measured from positions alone: of any figure, by any model.

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

from motet.motion.feet.contacts import ContactSettings, ground_of, smoothed
from motet.motion.feet.contacts import standing as feet_standing
from motet.motion.kinematics import local_rotations
from motet.motion.motion import Motion
from motet.motion.rotations import Array

STANCE = ContactSettings(heights=(0.03, 0.03), speeds=(0.0, 0.0), calm=0.05)
"""The speed is that along the root's way, less half of the root's."""


def standing(points: Array, root: Array, fps: float) -> NDArray[np.bool_]:
    """In which frames points (T, K, 3) stand, (T, K), beside the root's positions (T, 3)."""
    calm, way = smoothed(points, STANCE.calm, fps), np.gradient(smoothed(root[:, None], STANCE.calm, fps)[:, 0], axis=0)
    ground = np.array([ground_of(calm[:, [k], 1]) for k in range(points.shape[1])])
    ahead = np.gradient(calm, axis=0) - way[:, None] / 2
    forward = (ahead[..., [0, 2]] * way[:, None, [0, 2]]).sum(axis=-1)
    return feet_standing(calm[..., 1] - ground, forward, STANCE)


def stances(points: Array, root: Array, fps: float) -> list[Array]:
    """The positions (N, 3) of a point in each stance, of all points (T, K, 3)."""
    stands = standing(points, root, fps)
    found = []
    for point, up in zip(np.moveaxis(points, 1, 0), ~stands.T, strict=True):
        edges = np.flatnonzero(np.concatenate([[True], up, [True]]))
        found += [point[a:b] for a, b in zip(edges[:-1], edges[1:] - 1, strict=True) if b - a >= 0.1 * fps]
    return found


def slide(stances: Iterable[Array]) -> float:
    """How far points slide in a stance, metres: the mean over stances (N, 3) of the largest distance over the ground
    between two of a point's places. NaN without a stance."""
    across = [place[:, None, [0, 2]] - place[:, [0, 2]] for place in stances]
    return float(np.mean([np.linalg.norm(apart, axis=-1).max() for apart in across])) if across else np.nan


def speed(points: Array, root: Array, fps: float) -> float:
    """How fast points (T, K, 3) go over the ground while they stand, m/s: the median over all frames of all stances.
    NaN without a stance."""
    steps = [np.linalg.norm(np.diff(place[:, [0, 2]], axis=0), axis=-1) for place in stances(points, root, fps)]
    return float(np.median(np.concatenate(steps))) * fps if steps else np.nan


def acceleration(joints: Array, root: Array, fps: float) -> float:
    """How much joints (T, J, 3) tremble, m/s^2: the median length of their acceleration as seen from the root (T, 3),
    over all joints and frames."""
    second = np.diff(joints - root[:, None], n=2, axis=0) * fps**2
    return float(np.median(np.linalg.norm(second, axis=-1))) if len(second) else np.nan


def leap(motion: Motion) -> float:
    """The largest angle, degrees, that any joint turns by from one frame to the next, seen from its parent."""
    turns = local_rotations(motion)
    between = np.einsum("tjba,tjbc->tjac", turns[:-1], turns[1:])
    cosine = (np.trace(between, axis1=2, axis2=3) - 1) / 2
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).max(initial=0.0))
