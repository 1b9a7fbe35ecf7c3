"""Critically damped springs: the fastest return to rest without overshoot.

The distance from rest after t seconds is (d + (v + d y) t) exp(-y t): d and v are its start and its rate there, y the
damping.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.motion.scalar_or_batch import Part

Values = NDArray[Any]


def damping_of(half_life: float) -> float:
    """The damping, 1/s, of a spring with approximately this half-life in seconds, starting at rate 0."""
    return 2 * math.log(2) / half_life


def damped(off: Part, rate: Part, damping: Part, seconds: float) -> tuple[Part, Part]:
    """A distance from rest and its rate, of one shape or floats, ``seconds`` later (exact); the damping broadcasts."""
    # what is left of it, and how it would rise without damping
    left = _left(damping, seconds) if isinstance(damping, float) else np.exp(-damping * seconds)
    rise = (rate + damping * off) * seconds
    return (off + rise) * left, (rate - damping * rise) * left


@lru_cache
def _left(damping: float, seconds: float) -> float:
    return float(np.exp(-damping * seconds))


def damped_path(off: Values, rate: Values, damping: float, seconds: float) -> Values:
    """The integral of the distance of :func:`damped` over ``seconds`` (exact)."""
    rise = rate / damping + off
    left = math.exp(-damping * seconds)
    return (rise + off - left * (rise + off + rise * damping * seconds)) / damping


class Inertializer:
    """Transitions without a jump (Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War", GDC
    2018): what a pose would jump by is added to what follows, as an offset that a critically damped spring fades.

    half_life: of the offset, in seconds. The offset and its rate belong to the caller: floats or arrays of one shape.
    """

    def __init__(self, half_life: float) -> None:
        self.damping = damping_of(half_life)

    def transition(self, offset: Part, offset_rate: Part, jump: Part, jump_rate: Part) -> tuple[Part, Part]:
        """The offset and its rate after a transition, where values, and their rates, were larger before it by ``jump``
        and ``jump_rate``."""
        return offset + jump, offset_rate + jump_rate

    def update(self, offset: Part, offset_rate: Part, seconds: float, stretch: Part = 1.0) -> tuple[Part, Part]:
        """The offset and its rate ``seconds`` later. stretch: how many times as long the fade takes."""
        return damped(offset, offset_rate, self.damping / stretch, seconds)
