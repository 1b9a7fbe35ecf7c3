"""Seeds: one for each row of a batch, so that each result is the same as alone."""

import operator
from collections.abc import Iterable, Sequence
from typing import SupportsIndex

from motet.errors import MotetError

Seed = SupportsIndex | Sequence[SupportsIndex]
"""The first row's seed, counted up for the others; or one for each row. Integers of Python or numpy."""


def seeds_of(seed: Seed, count: int, error: type[MotetError]) -> list[int]:
    """A seed for each of ``count`` rows; ``error`` for a negative one, another number of them, or another type."""
    try:
        if isinstance(seed, Iterable):  # asked first: arrays look like integers, too
            found = [operator.index(one) for one in seed]
        else:
            found = [operator.index(seed) + i for i in range(count)]
    except TypeError:
        found = []
    if len(found) != count or any(one < 0 for one in found):
        raise error(f"expected a seed of 0 or more, or one for each of {count}, not {seed}")
    return found
