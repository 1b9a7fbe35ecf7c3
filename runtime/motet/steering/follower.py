"""Values that follow others: small steps at once, and leaps smoothly, by a spring."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from motet.motion.rotations import Array
from motet.motion.springs import damped, damping_of


@dataclass(frozen=True, eq=False)
class Follower:
    """Of B figures; arrays (B, k) that are replaced, never written into. wanted: what is followed. off, rate: how far
    from it each is shown, and how fast that changes, a second."""

    wanted: Array
    off: Array
    rate: Array

    @classmethod
    def at(cls, values: Array) -> Self:
        """Followers that are where they should be."""
        return cls(values, np.zeros_like(values), np.zeros_like(values))

    @property
    def shown(self) -> Array:
        """Where they are (B, k)."""
        return self.wanted + self.off

    def after(self, wanted: Array, leap: float, half_life: float, seconds: float) -> Self:
        """A tick later, where (B, k) is wanted: what moves farther than ``leap`` in a tick is caught up with."""
        moved = wanted - self.wanted
        leaps = np.sqrt((moved * moved).sum(axis=1, keepdims=True)) > leap
        off, rate = damped(np.where(leaps, self.off - moved, self.off), self.rate, damping_of(half_life), seconds)
        return type(self)(wanted, off, rate)
