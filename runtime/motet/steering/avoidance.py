"""Steered figures that keep apart: each turns aside from those that it would come too near to.

For each pair the moment is found within the next seconds when they are nearest, if both go on as they do. Where that is
nearer than the room that they keep, each changes its velocity away from where the other will be then, more the nearer
and the sooner that is; two that meet head on both turn to their right.
"""

import numpy as np

from motet.motion.rotations import Array

SOON, SIGHT = 2.0, 5.0
"""Seconds within which figures look ahead, and metres beyond which they see nobody."""

STRENGTH = 6.0
"""m/s of the change for figures that are in one place."""


def kept_apart(places: Array, velocities: Array, room: float) -> Array:
    """Changes (B, 2) of velocities (B, 2) in m/s of figures at places (B, 2) that keep ``room`` metres."""
    x, z = places.T
    sees = (np.abs(x[:, None] - x) < SIGHT) & (np.abs(z[:, None] - z) < SIGHT)
    np.fill_diagonal(sees, val=False)
    who, other = np.nonzero(sees)
    gap, speed = places[who] - places[other], velocities[who] - velocities[other]
    soon = (-(gap * speed).sum(axis=1) / np.maximum((speed * speed).sum(axis=1), 1e-6)).clip(0, SOON)
    nearest = gap + soon[:, None] * speed
    by = STRENGTH * (1 - np.hypot(*nearest.T) / room).clip(0, 1) * (1 - soon / SOON)
    # head on there is no way away from the other: to the right of the way there
    right = np.stack([gap[:, 1], -gap[:, 0]], axis=1)
    away = _unit(nearest + 0.1 * room * _unit(right))
    found = np.zeros_like(places)
    np.add.at(found, who, away * by[:, None])
    return found


def _unit(vectors: Array) -> Array:
    found: Array = vectors / np.maximum(np.hypot(*vectors.T), 1e-6)[:, None]
    return found
