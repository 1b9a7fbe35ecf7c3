"""The rows that a steered figure plays and its desired path, for drawings and for finding faults."""

from typing import NamedTuple

import numpy as np

from motet.motion.rotations import Array
from motet.steering.matching import HORIZONS, Flags, Matcher, Playback, Rows


class Matched(NamedTuple):
    """The rows that B figures play."""

    row: Rows
    """(B,) of the bundle's table."""
    mirrored: Flags
    """(B,) whether as its mirror image."""
    cost: Array
    """(B,) of that row for the present target, 0 for a perfect fit: half its squared distance in scaled features, and
    the cost of its lag."""
    path: Array
    """(B, 3, 2) where the figure is to be after a third, two thirds and the whole of the horizon, x and z in metres."""


def matched(matcher: Matcher, playback: Playback, target: Array, gait: Rows) -> Matched:
    """The rows that figures play in gaits (B,) with targets (B, 3): velocity along x and z, and facing."""
    # the cost of the row that is played, with the constant that a search leaves out
    row = playback.row + (playback.part > 0.5)
    mirror = playback.mirror
    trajectory = matcher.desired_trajectory(playback, target, matcher.is_slow_walk(target, gait))
    query = matcher.query(matcher.desired_features(trajectory, row, mirror))
    squares = query.features[:, :-1].astype(np.float64) ** 2
    cost = matcher.cost_at(query, row, mirror) + squares.sum(axis=1) / 2
    return Matched(row, mirror > 0, cost, _path(trajectory, playback.root))


def _path(trajectory: Array, root: Array) -> Array:
    """The desired places (B, 3, 2) in the world of trajectories (B, TRAJECTORY) seen from roots (B, 3)."""
    left, forward = trajectory[:, : 2 * HORIZONS].reshape(-1, HORIZONS, 2).swapaxes(0, 2)
    sin = np.sin(root[:, 2])
    cos = np.cos(root[:, 2])
    x = cos * left + sin * forward
    z = cos * forward - sin * left
    path: Array = root[:, None, :2] + np.stack([x, z], axis=-1).swapaxes(0, 1)
    return path
