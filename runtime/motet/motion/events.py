"""What happens to live figures from one tick to the next: feet come down, figures leave the ground and land."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

Happening = Literal["left foot", "right foot", "take-off", "landing", "gait", "arrived"]

DOWN, UP = 0.5, 0.2
"""A foot comes down where its contact rises above the first, once it has been below the second."""

FLIES = 2
"""Ticks without a foot on the ground after which a figure has taken off."""


class Event(NamedTuple):
    """What happened to a character (its number) in a tick: a foot came down, both feet left the ground ("take-off",
    also between the steps of a run), one came down again ("landing"), the figure now moves in another gait ("gait",
    whose name is told), or it has arrived where it was to go."""

    kind: Happening
    character: int
    name: str = ""


@dataclass(frozen=True, eq=False)
class Happenings:
    """Of B figures in a tick; replaced, never written into. down: (B, 2) whether the left and the right foot is down.
    air: (B,) ticks since one was. gait: (B,) numbers. arrived: (B,) whether they are where they were to go."""

    down: NDArray[np.bool_]
    air: NDArray[np.int64]
    gait: NDArray[np.int64]
    arrived: NDArray[np.bool_]

    @staticmethod
    def after(
        before: "Happenings | None",
        contacts: NDArray[np.float32],
        gait: NDArray[np.int64],
        shows: NDArray[np.bool_],
        arrived: NDArray[np.bool_],
    ) -> "Happenings":
        """Those of the next tick, of contacts (B, 2) and gaits (B,) that are asked for; shows: (B, G) which gaits are
        played, where a gait begins. before: None in the first tick."""
        if before is None:
            down = contacts > DOWN
            return Happenings(down, np.where(down.any(axis=1), 0, FLIES), gait, arrived)
        down = np.where(before.down, contacts >= UP, contacts > DOWN)
        seen = np.where(shows[np.arange(len(gait)), gait], gait, before.gait)
        return Happenings(down, np.where(down.any(axis=1), 0, before.air + 1), seen, arrived)

    def events(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """What has happened since the tick before; ``gaits`` are the names of all."""
        left, right = (self.down & ~before.down).T
        flags = {
            "take-off": (self.air >= FLIES) & (before.air < FLIES),
            "landing": (self.air == 0) & (before.air >= FLIES),
            "left foot": left,
            "right foot": right,
            "gait": self.gait != before.gait,
            "arrived": self.arrived & ~before.arrived,
        }
        kinds = get_args(Happening)
        for number, character in np.argwhere([flags[kind] for kind in kinds]).tolist():
            kind = kinds[number]
            yield Event(kind, character, gaits[self.gait[character]] if kind == "gait" else "")
