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
        """Those of the next tick, of contacts (B, 2) and gaits (B,) that are asked for; shows: (B,) whether these are
        played. before: None in the first tick."""
        down = contacts > DOWN
        if before is None:
            return Happenings(down, np.where(down[:, 0] | down[:, 1], 0, FLIES), gait, arrived)
        down |= before.down & (contacts >= UP)
        air = np.where(down[:, 0] | down[:, 1], 0, before.air + 1)
        return Happenings(down, air, np.where(shows, gait, before.gait), arrived)

    def events(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """What has happened since the tick before; ``gaits`` are the names of all."""
        flies, flew = self.air >= FLIES, before.air >= FLIES
        flags = {
            "left foot": self.down[:, 0] > before.down[:, 0],
            "right foot": self.down[:, 1] > before.down[:, 1],
            "take-off": flies > flew,
            "landing": (self.air == 0) & flew,
            "gait": self.gait != before.gait,
            "arrived": self.arrived > before.arrived,
        }
        kinds = get_args(Happening)
        numbers, characters = np.array([flags[kind] for kind in kinds]).nonzero()
        for number, character in zip(numbers.tolist(), characters.tolist(), strict=True):
            kind = kinds[number]
            yield Event(kind, character, gaits[self.gait[character]] if kind == "gait" else "")
