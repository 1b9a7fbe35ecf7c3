"""What happens to live figures from one tick to the next: feet come down, figures leave the ground and land."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Happening = Literal["left foot", "right foot", "take-off", "landing", "gait", "arrived", "act ended", "act begun"]

DOWN, UP = 0.5, 0.2
"""A foot comes down where its contact rises above the first, once it has been below the second."""

FLIES = 2
"""Ticks without a foot on the ground after which a figure has taken off."""


class Event(NamedTuple):
    """What happened to a character (its number) in a tick: a foot came down, both feet left the ground ("take-off",
    also between the steps of a run), one came down again ("landing"), the figure now moves in another gait ("gait",
    whose name is told), it has arrived where it was to go, or an act, whose name is told, was begun or is over: played
    to its end, ended or replaced."""

    kind: Happening
    character: int
    name: str = ""


class Done(NamedTuple):
    """What a figure does: the name of an act, and the ticks since it was begun."""

    name: str
    age: int


@dataclass(frozen=True, eq=False)
class Happenings:
    """Of B figures in a tick; replaced, never written into. down: (B, 2) whether the left and the right foot is down.
    air: (B,) ticks since one was, -1 before the first tick. gait: (B,) numbers. arrived: (B,) whether they are where
    they were to go. done: B acts."""

    down: NDArray[np.bool_]
    air: NDArray[np.int64]
    gait: NDArray[np.int64]
    arrived: NDArray[np.bool_]
    done: tuple[Done | None, ...]

    @staticmethod
    def none(figures: int) -> "Happenings":
        """Before the first tick."""
        none, count = np.zeros(figures, dtype=bool), np.zeros(figures, dtype=np.int64)
        return Happenings(np.zeros((figures, 2), dtype=bool), count - 1, count, none, (None,) * figures)

    def after(
        self,
        contacts: NDArray[np.float32],
        gait: NDArray[np.int64],
        shows: NDArray[np.bool_],
        arrived: NDArray[np.bool_],
        done: tuple[Done | None, ...],
    ) -> "Happenings":
        """Those of the next tick, of contacts (B, 2) and gaits (B,) that are asked for; shows: (B,) whether these are
        played."""
        down = contacts > DOWN
        down |= self.down & (contacts >= UP)
        begins = self.air < 0
        air = np.where(down[:, 0] | down[:, 1], 0, np.where(begins, FLIES, self.air + 1))
        return Happenings(down, air, np.where(shows | begins, gait, self.gait), arrived, done)

    def events(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """What has happened since the tick before; ``gaits`` are the names of all."""
        unseen = before.air < 0
        if unseen.any():
            before = before._as(self, unseen)
        yield from self._moved(before, gaits)
        if before.done.count(None) + self.done.count(None) == 2 * len(self.done):
            return
        for character, (old, new) in enumerate(zip(before.done, self.done, strict=True)):
            begins = new is not None and new.age == 0
            if old and (begins or not new):
                yield Event("act ended", character, old.name)
            if new and begins:
                yield Event("act begun", character, new.name)

    def _as(self, other: "Happenings", which: NDArray[np.bool_]) -> "Happenings":
        """With feet, gaits and ways of others in place of those of some figures (B,)."""
        return Happenings(
            np.where(which[:, None], other.down, self.down),
            np.where(which, other.air, self.air),
            np.where(which, other.gait, self.gait),
            np.where(which, other.arrived, self.arrived),
            self.done,
        )

    def _moved(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """Of steps, flights, gaits and ways."""
        flies, flew = self.air >= FLIES, before.air >= FLIES
        flags: dict[Happening, NDArray[np.bool_]] = {
            "left foot": self.down[:, 0] > before.down[:, 0],
            "right foot": self.down[:, 1] > before.down[:, 1],
            "take-off": flies > flew,
            "landing": (self.air == 0) & flew,
            "gait": self.gait != before.gait,
            "arrived": self.arrived > before.arrived,
        }
        kinds = list(flags)
        numbers, characters = np.array(list(flags.values())).nonzero()
        for number, character in zip(numbers.tolist(), characters.tolist(), strict=True):
            kind = kinds[number]
            yield Event(kind, character, gaits[self.gait[character]] if kind == "gait" else "")
