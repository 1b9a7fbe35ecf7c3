"""The loop of models that search: which of many unit vectors are the nearest to some."""

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.loop import Loop, Setting
from motet.decode.rollout import Ids

MAX_COUNT = 1000


def nearest(scores: Floats, count: int) -> Ids:
    """The columns (..., count) of the greatest of scores (..., N), best first, of equal ones the first."""
    order: NDArray[np.int64] = np.argsort(-scores, axis=-1, kind="stable")[..., :count]
    return order


LOOP = Loop("search", nearest, {}, {}, {"count": Setting(1, MAX_COUNT, whole=True, default=5)})
