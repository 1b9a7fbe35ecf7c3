"""Poses on the ground: where a figure is and how it faces, and moves from one pose to the next.

A pose is (..., 3): x and z in metres, and the facing in radians about the vertical axis, 0 along z. A move is (..., 3):
forward and to the left in metres, and a turn to the left in radians, seen from the pose that it starts from.
"""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array

REACH = 0.5
"""Metres that count as much as a radian where moves are compared."""


def moved(pose: Array, move: Array) -> Array:
    """The poses (..., 3) that moves (..., 3) lead to."""
    sin, cos = np.sin(pose[..., 2]), np.cos(pose[..., 2])
    x = pose[..., 0] + move[..., 0] * sin + move[..., 1] * cos
    z = pose[..., 1] + move[..., 0] * cos - move[..., 1] * sin
    found: Array = np.stack([x, z, pose[..., 2] + move[..., 2]], axis=-1)
    return found


def seen_from(pose: Array, other: Array) -> Array:
    """The moves (..., 3) that lead from poses (..., 3) to others: :func:`moved` undone. Turns are not wrapped."""
    sin, cos = np.sin(pose[..., 2]), np.cos(pose[..., 2])
    x, z = other[..., 0] - pose[..., 0], other[..., 1] - pose[..., 1]
    found: Array = np.stack([x * sin + z * cos, x * cos - z * sin, other[..., 2] - pose[..., 2]], axis=-1)
    return found


def way_of(start: Array, moves: Array) -> Array:
    """The poses (..., N + 1, 3) on the way from ``start`` (..., 3) by moves (..., N, 3), both ends included."""
    poses = [start]
    for place in range(moves.shape[-2]):
        poses.append(moved(poses[-1], moves[..., place, :]))
    return np.stack(poses, axis=-2)


def nearest_moves(poses: Array, book: Array) -> tuple[NDArray[np.int64], Array]:
    """Entries (..., N) int64 of a book (K, 3), and the way (..., N + 1, 3) they lead, along poses (..., N + 1, 3).

    The way starts at the first pose; each entry is the one that leads nearest to the next pose from where the way is.
    """
    scale, way, found = np.array([1.0, 1.0, REACH]), [poses[..., 0, :]], []
    for place in range(1, poses.shape[-2]):
        wanted = seen_from(way[-1], poses[..., place, :])
        off = ((wanted[..., None, :] - book) * scale) ** 2
        found.append(off.sum(axis=-1).argmin(axis=-1))
        way.append(moved(way[-1], book[found[-1]]))
    return np.stack(found, axis=-1), np.stack(way, axis=-2)
