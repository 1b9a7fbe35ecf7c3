"""What a caller gives: whole numbers that are checked, and warnings that point at the caller's line."""

import operator
import os
import sys
import warnings
from pathlib import Path
from typing import Any

from motet.errors import MotetError, SettingError

HERE = f"{Path(__file__).parent}{os.sep}"


def checked_int(name: str, value: Any, low: int, high: int, error: type[MotetError] = SettingError) -> int:
    """A whole number of Python's or numpy's from ``low`` to ``high``; ``error`` for anything else, True and 2.0 too."""
    try:
        found = None if isinstance(value, bool) else operator.index(value)
    except TypeError:
        found = None
    if found is None or not low <= found <= high:
        raise error(f"{name} must be a whole number from {low} to {high}, not {value!r}")
    return found


def warn(said: str, category: type[Warning]) -> None:
    """Warn at the nearest line outside of this package: that of the caller, who can do something about it."""
    level, frame = 1, sys._getframe(0)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(HERE):
        level, frame = level + 1, frame.f_back
    warnings.warn(said, category, stacklevel=level)
