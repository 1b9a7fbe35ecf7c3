"""Critically damped springs: the fastest return to rest without overshoot.

The distance from rest after t seconds is (d + (v + d y) t) exp(-y t): d and v are its start and its rate there, y the
damping.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

Values = NDArray[Any]


def damping_of(half_life: float) -> float:
    """The damping, 1/s, of a spring with approximately this half-life in seconds, starting at rate 0."""
    return 2 * math.log(2) / half_life


def damped(off: Values, rate: Values, damping: float | Values, seconds: float) -> tuple[Values, Values]:
    """A distance from rest and its rate, arrays of one shape, ``seconds`` later (exact).

    damping: one for all, or an array that broadcasts.
    """
    rise, left = (rate + damping * off) * seconds, np.exp(-damping * seconds).astype(off.dtype)
    return (off + rise) * left, (rate - damping * rise) * left


def damped_path(off: Values, rate: Values, damping: float, seconds: float) -> Values:
    """The integral of the distance of :func:`damped` over ``seconds`` (exact)."""
    rise, left = rate / damping + off, math.exp(-damping * seconds)
    found: Values = (rise + off - left * (rise + off + rise * damping * seconds)) / damping
    return found
