"""The loop of models that search: which of many unit vectors are the nearest to some."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.loop import Loop
from motet.decode.rollout import Ids
from motet.settings import Range, Settings


@dataclass(frozen=True)
class NearestSettings(Settings):
    """count: motions that are found."""

    count: Annotated[int, Range(1, 1000)] = 5


def nearest(scores: Floats, count: int) -> Ids:
    """The columns (..., count) of the greatest of scores (..., N), best first, of equal ones the first."""
    order: NDArray[np.int64] = np.argsort(-scores, axis=-1, kind="stable")[..., :count]
    return order


LOOP = Loop(nearest, {}, {}, NearestSettings)
