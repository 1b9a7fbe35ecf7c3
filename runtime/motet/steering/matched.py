"""What a steered figure plays and what it is looking for, to be drawn or looked at when it does not do as it should."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.steering.matching import HORIZONS, Matcher, Playback, Rows


class Matched(NamedTuple):
    """What B figures play. row: (B,) of the bundle's table. mirrored: (B,) whether as its mirror image. cost: (B,) of
    that row for what is asked now, 0 for one that fits exactly: half its squared distance in scaled features, and what
    it lags behind. path: (B, 3, 2) where the figure is asked to be in a third, two thirds and the whole of the horizon,
    x and z in metres."""

    row: Rows
    mirrored: NDArray[np.bool_]
    cost: Array
    path: Array


def matched(matcher: Matcher, playback: Playback, target: Array, gait: Rows) -> Matched:
    """What figures play whose target is (B, 3) velocity along x and z, and facing, in gaits (B,)."""
    row, mirror = playback.row + (playback.part > 0.5), playback.mirror
    trajectory = matcher.desired_trajectory(playback, target, matcher.is_slow_walk(target, gait))
    asked = matcher.desired_features(trajectory, row, mirror)
    query = matcher.query(asked)
    cost = matcher.cost_at(query, row, mirror) + (query.features[:, :-1].astype(np.float64) ** 2).sum(axis=1) / 2
    left, forward = trajectory[:, : 2 * HORIZONS].reshape(-1, HORIZONS, 2).swapaxes(0, 2)
    sin, cos = np.sin(playback.root[:, 2]), np.cos(playback.root[:, 2])
    own = np.stack([cos * left + sin * forward, cos * forward - sin * left], axis=-1)
    return Matched(row, mirror > 0, cost, playback.root[:, None, :2] + own.swapaxes(0, 1))
