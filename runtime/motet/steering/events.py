"""What happens to live figures from one tick to the next: feet come down, figures leave the ground and land."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Happening = Literal["left foot", "right foot", "take-off", "landing", "gait", "arrived", "act ended", "act begun"]

DOWN_CONTACT = 0.5
"""A foot comes down where its contact rises above this, once it has been below UP."""

UP_CONTACT = 0.2
"""A foot is up where its contact is below this."""

FLIES = 2
"""Ticks without a foot on the ground after which a figure has taken off."""


class Event(NamedTuple):
    """What happened to a character (its number) in a tick: a foot came down, both feet left the ground ("take-off",
    also between the steps of a run), a foot came down again ("landing"), the figure now moves in another gait ("gait",
    by name), it has arrived where it was sent, or an act, by name, was begun or is over: played to its end, ended or
    replaced."""

    kind: Happening
    character: int
    name: str = ""


class Done(NamedTuple):
    """The act of a figure: its name, and the ticks since it was begun."""

    name: str
    age: int


@dataclass(frozen=True, eq=False)
class Happenings:
    """The state of B figures in a tick, from which events follow; replaced, never written into."""

    down: NDArray[np.bool_]
    """(B, 2) whether the left and the right foot is down."""
    air: NDArray[np.int64]
    """(B,) ticks since a foot was down, -1 before the first tick."""
    gait: NDArray[np.int64]
    """(B,) numbers."""
    arrived: NDArray[np.bool_]
    """(B,) whether they are where they were sent."""
    done: list[Done | None]
    """B acts."""

    @staticmethod
    def none(figures: int) -> "Happenings":
        """Before the first tick."""
        return Happenings(
            down=np.zeros((figures, 2), dtype=bool),
            air=np.full(figures, -1, dtype=np.int64),
            gait=np.zeros(figures, dtype=np.int64),
            arrived=np.zeros(figures, dtype=bool),
            done=[None] * figures,
        )

    def after(
        self,
        contacts: NDArray[np.float32],
        gait: NDArray[np.int64],
        shows: NDArray[np.bool_],
        arrived: NDArray[np.bool_],
        done: list[Done | None],
    ) -> "Happenings":
        """A tick later, with contacts (B, 2), ordered gaits (B,), and whether these are played (B,)."""
        # a foot that is down stays down until it is clearly up
        down = contacts > DOWN_CONTACT
        down |= self.down & (contacts >= UP_CONTACT)
        # without a foot on the ground in its first tick, a figure flies already
        begins = self.air < 0
        air = np.where(down[:, 0] | down[:, 1], 0, np.where(begins, FLIES, self.air + 1))
        return Happenings(down, air, np.where(shows | begins, gait, self.gait), arrived, done)

    def events(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """The events since the tick before. gaits: the names of all."""
        yield from self._moved(before, gaits)
        if before.done.count(None) + self.done.count(None) == 2 * len(self.done):
            return
        for character, (old, new) in enumerate(zip(before.done, self.done, strict=True)):
            begins = new is not None and new.age == 0
            if old and (begins or not new):
                yield Event("act ended", character, old.name)
            if new and begins:
                yield Event("act begun", character, new.name)

    def _moved(self, before: "Happenings", gaits: Sequence[str]) -> Iterator[Event]:
        """Steps, flights, gaits and ways, of figures that had a tick before."""
        # what has changed for each figure since the tick before
        flies = self.air >= FLIES
        flew = before.air >= FLIES
        flags: dict[Happening, NDArray[np.bool_]] = {
            "left foot": self.down[:, 0] > before.down[:, 0],
            "right foot": self.down[:, 1] > before.down[:, 1],
            "take-off": flies > flew,
            "landing": (self.air == 0) & flew,
            "gait": self.gait != before.gait,
            "arrived": self.arrived > before.arrived,
        }
        # an event for each change, kind by kind
        kinds = list(flags)
        numbers, characters = (np.array(list(flags.values())) & (before.air >= 0)).nonzero()
        for number, character in zip(numbers.tolist(), characters.tolist(), strict=True):
            kind = kinds[number]
            yield Event(kind, character, gaits[self.gait[character]] if kind == "gait" else "")
