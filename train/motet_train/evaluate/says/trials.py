"""Recorded trials: what the rules are checked on, and what a look-up plays."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from motet.motion.motion import Motion
from motet.representation import named
from motet_train.data.corpus import read_corpus
from motet_train.data.records import Record
from motet_train.data.store import INDEX, Store
from motet_train.evaluate.says.prompts import actions
from motet_train.evaluate.says.track import Track, track_of


@dataclass(frozen=True, eq=False)
class Trial:
    """A motion of any human figure, its name, and what was said about it."""

    name: str
    sentences: tuple[str, ...]
    motion: Motion

    @property
    def action(self) -> str | None:
        """What it shows, None for a trial that the table of trials does not have."""
        return actions().get(self.name)

    @cached_property
    def track(self) -> Track:
        """The track of its motion."""
        return track_of(self.motion)


def read_trials(path: Path) -> Iterator[Trial]:
    """The trials in a store, or in a corpus of motion files with a table of sentences; DataError where it is neither.

    What a corpus skips is left out, and so is what of a store was cut: parts of a trial do not show all that it does.
    """
    if (path / INDEX).is_file():
        yield from of_store(Store.open(path))
    else:
        yield from (
            Trial(record.name, record.sentences, record.motion)
            for record in read_corpus(path)
            if isinstance(record, Record)
        )


def of_store(store: Store) -> Iterator[Trial]:
    """The records of a store as trials, at its frame rate, the figure moving over the ground as its root block says."""
    for index, record in enumerate(store.records):
        features = store.motion(index)
        yield Trial(record.name, record.sentences, named(store.representation).motion(features, None))
