"""The playback state of steered figures: all that changes from tick to tick."""

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array

Rows = NDArray[np.int64]


@dataclass(eq=False)
class Playback:
    """Of B figures; K are the codes of a pose. Whole numbers are int64, others float64.

    row, part: (B,) the row that is played, and the part of the way to the next one. mirror: (B,) 1 for the mirror image
    of the row, else 0. rate: (B,) rows that are played in the next tick. ticks_to_search: (B,).
    root: (B, 3) x, z in metres and facing in radians. spring, spring_rate: (B, 3) the springs that approach the target:
    velocity along x and z in m/s and facing in radians, and how fast they change. offset, offset_rate: (B, K) the
    inertialization offset of the codes, and how fast it changes.
    """

    row: Rows
    part: Array
    mirror: Rows
    rate: Array
    ticks_to_search: Rows
    root: Array
    spring: Array
    spring_rate: Array
    offset: Array
    offset_rate: Array

    @staticmethod
    def at(row: int, figures: int, codes: int) -> "Playback":
        """Figures at the origin that play a row, and search in the next tick."""
        # all search in the same tick: each moves as it would alone
        whole, ground, pose = (np.zeros(shape) for shape in (figures, (figures, 3), (figures, codes)))
        rows, count = np.full(figures, row, dtype=np.int64), np.zeros(figures, dtype=np.int64)
        found = Playback(rows, whole, count, whole + 1, count, ground, ground, ground, pose, pose)
        return found.copy()

    def copy(self) -> "Playback":
        """One that shares no array."""
        return Playback(*(getattr(self, field.name).copy() for field in fields(self)))
