"""What every corpus gives: motions with their sentences, and the names of what had to be left out."""

from dataclasses import dataclass

from motet.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class Record:
    """One motion and what people said about it.

    subject: who moved, if the corpus tells. unseen: sentences whose wordings are for measuring, never for training.
    take: what it is a part of that must not be divided; "" where it is a take of its own. action: what it shows, named
    alike for all motions that show it; "" where it is not said. gaits: the ways of moving that it shows, where that
    is said.
    """

    name: str
    subject: str
    motion: Motion
    sentences: tuple[str, ...]
    unseen: tuple[str, ...] = ()
    take: str = ""
    action: str = ""
    gaits: tuple[str, ...] = ()


@dataclass(frozen=True)
class Skipped:
    """A motion of the corpus that cannot be used, and why."""

    name: str
    reason: str
