"""Uniform noise for step graphs: reproducible per row, and independent of the batch around it."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

BLOCK = 16
"""Ticks drawn at once."""


class RowNoise:
    """Uniform numbers in [0, 1) for each row and tick; row i depends on ``seeds[i]`` and the tick alone.

    There is no state to save: the numbers of a tick are the same whenever they are asked for.
    """

    def __init__(self, seeds: Sequence[int], width: int) -> None:
        self.seeds, self.width = tuple(seeds), width
        self._index = -1
        self._block = np.empty((0, 0, 0), dtype=np.float32)

    def at(self, tick: int) -> NDArray[np.float32]:
        """The noise (rows, width) float32 of one tick."""
        index, place = divmod(tick, BLOCK)
        if index != self._index:
            self._block = np.stack([self._draw(seed, index) for seed in self.seeds], axis=1)
            self._index = index
        noise: NDArray[np.float32] = self._block[place]
        return noise

    def _draw(self, seed: int, index: int) -> NDArray[np.float32]:
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, index])))
        return generator.random((BLOCK, self.width), dtype=np.float32)
