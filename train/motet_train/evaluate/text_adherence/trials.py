"""Recorded trials: what the rules are checked on, and the look-up among them, the floor of every generator."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from motet.bundle.manifest import Manifest
from motet.errors import MotionError
from motet.models.language import RULES
from motet.motion.motion import Motion
from motet.representation.contract import named
from motet_train.data.corpus import read_corpus
from motet_train.data.errors import DataError
from motet_train.data.records import Record
from motet_train.data.store import INDEX, Store
from motet_train.evaluate.text_adherence.prompts import Prompt, actions
from motet_train.evaluate.text_adherence.track import Track, track_of


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

    def shows(self, prompt: Prompt) -> bool | None:
        """Whether it shows what a prompt asks; None where it may, and where nothing is known of it."""
        return None if self.action is None else prompt.shows(self.action)

    @cached_property
    def track(self) -> Track:
        """The track of its motion; DataError for a motion that is none of a human figure."""
        try:
            return track_of(self.motion)
        except MotionError as error:
            raise DataError(f"{self.name} cannot be judged: {error}") from error


def read_trials(path: Path, unit: str | float | None = None) -> Iterator[Trial]:
    """The trials in a store, or in a folder or zip of motion files with a table of sentences; DataError where it is
    neither. What cannot be read or has no sentence is left out.

    unit: the length unit of files that do not state theirs, as in :func:`motet.read`.
    """
    if (path / INDEX).is_file():
        yield from of_store(Store.open(path))
    else:
        records = (item for item in read_corpus(path, unit=unit) if isinstance(item, Record))
        yield from (Trial(record.name, record.sentences, record.motion) for record in records)


def of_store(store: Store) -> Iterator[Trial]:
    """The records of a store as trials, at its frame rate, the figure moving over the ground as its root block says."""
    representation = named(store.representation)
    for index, record in enumerate(store.records):
        yield Trial(record.name, record.sentences, representation.motion(store.motion(index)))


class LookUp:
    """Plays the trial whose sentences share most words with what is asked.

    Trials without a sentence are never found; DataError if none has one.
    """

    def __init__(self, trials: Sequence[Trial]) -> None:
        known = [(trial, frozenset(RULES.words(said))) for trial in trials for said in trial.sentences]
        self._known = sorted(((trial, words) for trial, words in known if words), key=lambda pair: pair[0].name)
        if not self._known:
            raise DataError("no trial to look up has a sentence")

    def generate(self, text: str, seed: int) -> Motion:
        """The motion of :meth:`found`, the same for every seed."""
        return self.found(text).motion

    def found(self, text: str) -> Trial:
        """The trial with the sentence that shares most different words with the text; of several such sentences the one
        with the fewest different words, and where they are as many, of the first trial by name."""
        asked = frozenset(RULES.words(text))
        return max(self._known, key=lambda pair: (len(asked & pair[1]), -len(pair[1])))[0]


def trained_on(manifest: Manifest, trials: Sequence[Trial]) -> set[str]:
    """The names of the trials that are neither validation nor test motions of a model; all, where it does not say."""
    split = manifest.training.get("split", {})
    held_out = {name for part in ("validation", "test") for name in split.get(part, ())}
    return {trial.name for trial in trials} - held_out
