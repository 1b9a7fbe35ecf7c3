"""Noise for step graphs: reproducible per row, independent of the batch around it, recorded and played again."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.errors import BundleError

BLOCK = 16
"""Ticks drawn at once."""


class Noise(Protocol):
    """Where the random numbers of a row come from: a :class:`numpy.random.Generator`, or numbers that are given."""

    def standard_normal(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Normal numbers."""

    def random(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Uniform numbers in [0, 1)."""


def apart(noise: Noise, count: int) -> list[Noise]:
    """Noise for each of several draws, whose first draws what it would draw alone; what is recorded is one for all."""
    return [noise, *noise.spawn(count - 1)] if isinstance(noise, np.random.Generator) else [noise] * count


class RowNoise:
    """Uniform numbers in [0, 1) for each row and tick; row i depends on ``seeds[i]`` and the tick alone.

    There is no state to save: the numbers of a tick are the same whenever they are asked for.
    """

    def __init__(self, seeds: Sequence[int], width: int) -> None:
        self.seeds, self.width = tuple(seeds), width
        self._index = -1
        self._block = np.empty((0, 0, 0), dtype=np.float32)

    def at(self, tick: int) -> Floats:
        """The noise (rows, width) float32 of one tick."""
        index, place = divmod(tick, BLOCK)
        if index != self._index:
            self._block = np.stack([self._draw(seed, index) for seed in self.seeds], axis=1)
            self._index = index
        noise: Floats = self._block[place]
        return noise

    def _draw(self, seed: int, index: int) -> Floats:
        generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, index])))
        return generator.random((BLOCK, self.width), dtype=np.float32)


class RowsOfNoise:
    """Uniform numbers (ticks, width) that are given, for one row; BundleError for a tick beyond them."""

    def __init__(self, rows: NDArray[Any]) -> None:
        self._rows = rows.astype(np.float32)

    def at(self, tick: int) -> Floats:
        """See :meth:`RowNoise.at`."""
        if tick >= len(self._rows):
            raise BundleError(f"the golden vectors have noise for {len(self._rows)} ticks only")
        row: Floats = self._rows[tick : tick + 1]
        return row


class Recording:
    """A generator whose numbers are kept: ``drawn`` has them by kind ("normal", "uniform"), call by call."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator
        self.drawn: dict[str, list[Floats]] = {"normal": [], "uniform": []}

    def standard_normal(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Normal numbers."""
        self.drawn["normal"].append(self._generator.standard_normal(size, dtype))
        return self.drawn["normal"][-1]

    def random(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Uniform numbers in [0, 1)."""
        self.drawn["uniform"].append(self._generator.random(size, dtype))
        return self.drawn["uniform"][-1]


class Recorded:
    """The numbers of a recording, (calls, ...) of each kind, given again; BundleError where they do not fit."""

    def __init__(self, drawn: Mapping[str, NDArray[Any]]) -> None:
        self._left = {kind: iter(drawn.get(kind, ())) for kind in ("normal", "uniform")}

    def standard_normal(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Normal numbers."""
        return self._next("normal", size, dtype)

    def random(self, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        """Uniform numbers in [0, 1)."""
        return self._next("uniform", size, dtype)

    def _next(self, kind: str, size: tuple[int, ...], dtype: type[np.float32]) -> Floats:
        found = next(self._left[kind], None)
        if found is None or found.shape != size:
            raise BundleError(f"the golden vectors lack {kind} numbers of shape {size}")
        numbers: Floats = found.astype(dtype)
        return numbers
