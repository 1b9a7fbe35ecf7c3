"""Steered figures that keep apart: each turns aside from those that it would come too near to.

For each pair the moment within the next seconds is computed when they are nearest, if both go on as they do. Where
that is nearer than the room that they keep, each changes its velocity away from where the other will be then, more the
nearer and the sooner that is; two that meet head on both turn to their right.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.settings import Settings
from motet.steering.settings import Metres, Seconds, Speed


@dataclass(frozen=True)
class AvoidanceSettings(Settings):
    """Settings of figures that keep apart."""

    FEATURE: ClassVar[str] = "avoidance"

    soon: Seconds = 2.0
    """How far ahead in time figures look."""
    sight: Metres = 5.0
    """Distance along x or z beyond which they see nobody."""
    strength: Speed = 6.0
    """Change of velocity of figures in the same place."""
    waits: Speed = 0.2
    """If the detour is slower than this, wait instead."""


def kept_apart(places: Array, velocities: Array, room: float, settings: AvoidanceSettings) -> Array:
    """Changes (B, 2) of velocities (B, 2) in m/s of figures at places (B, 2) that keep ``room`` metres."""
    figure, other = _pairs(places, settings.sight)
    # when they are nearest, and how near
    gap = places[figure] - places[other]
    closing = velocities[figure] - velocities[other]
    seconds = _seconds_to_nearest(gap, closing).clip(0, settings.soon)
    nearest = gap + seconds[:, None] * closing
    # away from there; head on there is no way away from the other: to the right of the way there
    right = np.stack([gap[:, 1], -gap[:, 0]], axis=1)
    away = _unit(nearest + 0.1 * room * _unit(right))
    nearness = (1 - np.hypot(*nearest.T) / room).clip(0, 1)
    strength = settings.strength * nearness * (1 - seconds / settings.soon)
    changes = np.zeros_like(places)
    np.add.at(changes, figure, away * strength[:, None])
    return changes


def _pairs(places: Array, sight: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """All pairs (n,), (n,) of figures at places (B, 2) that see each other."""
    x, z = places.T
    near_x = np.abs(x[:, None] - x) < sight
    near_z = np.abs(z[:, None] - z) < sight
    sees = near_x & near_z
    np.fill_diagonal(sees, val=False)
    figure, other = np.nonzero(sees)
    return figure, other


def _seconds_to_nearest(gap: Array, closing: Array) -> Array:
    """When pairs (n,) are nearest, with gaps (n, 2) that change by velocities (n, 2)."""
    squared_speed = np.maximum((closing * closing).sum(axis=1), 1e-6)
    seconds: Array = -(gap * closing).sum(axis=1) / squared_speed
    return seconds


def _unit(vectors: Array) -> Array:
    units: Array = vectors / np.maximum(np.hypot(*vectors.T), 1e-6)[:, None]
    return units
