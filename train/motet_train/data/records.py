"""What every corpus gives: motions with their sentences, and the names of what had to be left out."""

from dataclasses import dataclass

from motet.motion.motion import Motion


@dataclass(frozen=True, eq=False)
class Record:
    """One motion and what people said about it; subject is who moved, if the corpus tells."""

    name: str
    subject: str
    motion: Motion
    sentences: tuple[str, ...]


@dataclass(frozen=True)
class Skipped:
    """A motion of the corpus that cannot be used, and why."""

    name: str
    reason: str
