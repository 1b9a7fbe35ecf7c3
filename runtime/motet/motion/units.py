"""Units of length, by name or in metres."""

import math

from motet.errors import MotionError

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}
"""Name of a unit of length -> its metres."""


def metres(unit: str | float) -> float:
    """Metres of a unit of length: one of :data:`METRES`, or a number of metres; MotionError for anything else."""
    value = METRES.get(unit, math.nan) if isinstance(unit, str) else float(unit)
    if not (math.isfinite(value) and value > 0):
        raise MotionError(f"expected a length unit ({', '.join(METRES)}) or a number of metres, not {unit!r}")
    return value
