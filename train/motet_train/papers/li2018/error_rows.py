"""Rows of errors at some frames, the spread of seeds in brackets behind their mean."""

from collections.abc import Iterable, Sequence

import numpy as np

from motet.motion.rotations import Array
from motet_train.evaluate.predict.frames import REPORTED
from motet_train.evaluate.tables import aligned

ROOM = 6
"""Of a spread in brackets, with a space before it."""

BRACKETS = "in brackets: the largest seed's minus the smallest's"
"""What the head of a table with spreads says."""


class ErrorRows:
    """A table that grows row by row; each column is that of a frame.

    spreads: whether rows can have them, for which all leave room.
    """

    def __init__(self, spreads: bool = False, frames: Sequence[int] = REPORTED, digits: int = 2) -> None:
        self.frames, self.digits, self._room = tuple(frames), digits, ROOM if spreads else 0
        self._rows: list[tuple[str, ...]] = []
        self.head("output frame", map(str, frames))

    def head(self, name: str, cells: Iterable[str]) -> None:
        """A head of the columns."""
        self._rows.append((name, *(cell + " " * self._room for cell in cells)))

    def title(self, text: str = "") -> None:
        """A line of its own."""
        self._rows.append((text,))

    def add(self, name: str, error: Array, spread: Array | None = None) -> None:
        """The errors (N,) of a system and their spread; an error that is not known, a NaN, is left out."""
        beside = [""] * len(self.frames) if spread is None else [self._bracketed(spread[f]) for f in self.frames]
        cells = (
            f"{error[frame]:.{self.digits}f}{more:>{self._room}}" if np.isfinite(error[frame]) else ""
            for frame, more in zip(self.frames, beside, strict=True)
        )
        self._rows.append((f"  {name}", *cells))

    def _bracketed(self, spread: float) -> str:
        return f"[{spread:.{self.digits}f}]".replace("[0.", "[.")

    def text(self) -> str:
        """The rows, aligned."""
        return aligned(self._rows)
