"""The loop ``nearest``: which of many scores are the greatest."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Floats
from motet.decode.loop import Ids, Loop
from motet.settings import Range, Settings


@dataclass(frozen=True)
class NearestSettings(Settings):
    """count: motions that are found."""

    count: Annotated[int, Range(1, 1000)] = 5


def nearest(scores: Floats, count: int) -> Ids:
    """The columns (..., count) of the greatest of scores (..., N), best first, of equal ones the first."""
    falling = -scores.reshape(-1, scores.shape[-1])
    count = min(count, falling.shape[1])
    nearest_rows = np.zeros((len(falling), count), dtype=np.int64)
    for row, chosen in zip(falling, nearest_rows, strict=True):
        last = np.partition(row, count - 1)[count - 1]
        near = np.flatnonzero(~(row > last))  # all that are as great as the last one wanted, of which the first count
        chosen[:] = near[np.argsort(row[near], kind="stable")][:count]
    return nearest_rows.reshape(*scores.shape[:-1], count)


LOOPS: Mapping[str, Loop] = {"nearest": Loop(nearest, {}, {}, NearestSettings)}
