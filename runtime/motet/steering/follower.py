"""Values that follow others: small steps at once, and leaps smoothly, by inertialization."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from motet.motion.rotations import Array
from motet.motion.springs import Inertializer


@dataclass(frozen=True, eq=False)
class Follower:
    """Values (B, k) of B figures; arrays are replaced, never written into."""

    wanted: Array
    """(B, k) the values that are followed."""
    offset: Array
    """(B, k) how far from them each is shown."""
    offset_rate: Array
    """(B, k) how fast the offset changes, a second."""

    @classmethod
    def at(cls, values: Array) -> Self:
        """Followers without an offset."""
        return cls(values, np.zeros_like(values), np.zeros_like(values))

    @property
    def shown(self) -> Array:
        """The values (B, k) that are shown."""
        return self.wanted + self.offset

    def after(self, wanted: Array, leap: float, half_life: float, seconds: float) -> Self:
        """A tick later, with new values (B, k): those that move farther than ``leap`` in a tick are caught up with."""
        inertializer = Inertializer(half_life)
        moved = wanted - self.wanted
        leaps = np.sqrt((moved * moved).sum(axis=1, keepdims=True)) > leap
        offset_before_leap = np.where(leaps, self.offset - moved, self.offset)
        offset, offset_rate = inertializer.update(offset_before_leap, self.offset_rate, seconds)
        return type(self)(wanted, offset, offset_rate)
