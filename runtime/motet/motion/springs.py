"""Critically damped springs: what comes back to rest as fast as it can without going beyond it."""

import math
from typing import Any

from numpy.typing import NDArray


def damping_of(half_life: float) -> float:
    """The damping, 1/s, of a spring that from rest is half way back after so many seconds, nearly."""
    return 2 * math.log(2) / half_life


def damped(off: NDArray[Any], speed: NDArray[Any], damping: float, seconds: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """A distance from rest and its speed, arrays of one shape, so many seconds later (exact)."""
    rise, left = (speed + damping * off) * seconds, math.exp(-damping * seconds)
    return (off + rise) * left, (speed - damping * rise) * left
