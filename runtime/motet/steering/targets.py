"""What callers say of characters: which, and numbers for all of them or for each."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import ControlError
from motet.motion.rotations import Array
from motet.steering.matching import Rows

LARGEST_COMMAND = 1e6  # number of a command: metres, m/s, degrees

CharacterIds = int | Sequence[int] | None
"""Characters by their numbers from 0, or all."""

LONGEST_PATH = 10_000
"""Points of a path."""


def chosen_ids(ids: CharacterIds, characters: int) -> Rows:
    """The numbers of characters (n,), of a session with so many; ControlError for unknown ones."""
    if ids is None:
        return np.arange(characters)
    numbers = np.atleast_1d(np.array(ids))
    are_whole = numbers.ndim == 1 and numbers.dtype.kind in "iu" and len(numbers) > 0
    exist = are_whole and (numbers >= 0).all() and (numbers < characters).all()
    if not exist or len(set(numbers)) < len(numbers):
        raise ControlError(f"ids must be numbers of characters from 0 to {characters - 1}, none twice, not {ids!r}")
    return numbers.astype(np.int64)


def numbers_of(needed: str, values: Any, count: int, *columns: int) -> Array:
    """Numbers for all of ``count`` characters or for each, as a new (count, *columns); ControlError, which says what is
    ``needed``, for anything else."""
    try:
        numbers = np.array(values, dtype=np.float64)
        if numbers.shape not in (columns, (1, *columns), (count, *columns)):
            raise ValueError(numbers.shape)
    except (TypeError, ValueError) as error:
        alternatives = ", for all or" if columns else " or one"
        raise ControlError(f"{needed}{alternatives} for each of {count} characters") from error
    if not (np.abs(numbers) <= LARGEST_COMMAND).all():
        quantity, _, _ = needed.partition(" need")
        raise ControlError(f"{quantity} must be finite numbers, no larger than {LARGEST_COMMAND:g}")
    return np.array(np.broadcast_to(numbers, (count, *columns)))


def checked_path(points: ArrayLike, count: int) -> Array:
    """The points of paths (count, P, 2), of one (P, 2) for all or of one for each; ControlError for anything else."""
    try:
        paths = np.array(points, dtype=np.float64)
        paths = np.broadcast_to(paths, (count, *paths.shape[-2:])) if paths.ndim in (2, 3) else paths[None]
    except (TypeError, ValueError) as error:
        raise ControlError(f"a path needs points of x and z, for all or for each of {count}") from error
    if paths.ndim != 3 or paths.shape[2] != 2 or not 1 <= paths.shape[1] <= LONGEST_PATH:
        raise ControlError(f"a path needs 1 to {LONGEST_PATH} points of x and z, not an array {np.shape(points)}")
    if not (np.abs(paths) <= LARGEST_COMMAND).all():
        raise ControlError(f"points of a path must be finite numbers, no larger than {LARGEST_COMMAND:g}")
    return paths
