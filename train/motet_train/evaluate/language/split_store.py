"""A prepared corpus, divided as it was when a model was trained on it."""

import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motet.bundle.manifest import Manifest
from motet.errors import TextWarning
from motet.models.language import RULES
from motet.motion.motion import Motion
from motet.representation.contract import MotionContract
from motet_train.data.errors import DataError
from motet_train.data.sentences import usable
from motet_train.data.store import Split, Store
from motet_train.evaluate.tables import Report


@dataclass(frozen=True, eq=False)
class SplitStore:
    """A store and the parts that a model was trained, validated and is tested on."""

    store: Store
    parts: Split

    @cached_property
    def contract(self) -> MotionContract:
        """Mean and standard deviation of the training motions."""
        return self.store.contract(self.parts.train)

    def motion(self, record: int) -> Motion:
        """One record at its first down-sampling offset."""
        return self.store.motion(record)

    def motions(self, records: Iterable[int]) -> list[Motion]:
        """Several records as :meth:`motion` gives them."""
        return [self.motion(record) for record in records]

    def sentences(self, record: int) -> tuple[str, ...]:
        """What was said about a record, normalised: words with one space between them; nothing that has no words."""
        return _plain(self.store.records[record].sentences)

    def kept(self, record: int) -> tuple[str, ...]:
        """The sentences about a record that are kept for measuring, normalised."""
        return _plain(self.store.records[record].unseen)

    def references(self, records: Iterable[int]) -> list[tuple[str, ...]]:
        """The sentences of several records."""
        return [self.sentences(record) for record in records]

    def described(self, records: Iterable[int], most: int | None = None) -> tuple[int, ...]:
        """The records that have sentences, or ``most`` of them, the same ones every time; DataError if none has."""
        found = np.array([record for record in records if self.sentences(record)], dtype=np.intp)
        if not len(found):
            raise DataError("no motion in this part of the data has a sentence")
        if most is not None and len(found) > most:
            found = np.sort(np.random.default_rng(0).choice(found, most, replace=False))
        return tuple(found.tolist())

    def unseen(self, records: Iterable[int]) -> list[tuple[str, ...]]:
        """The sentences of several records that no training saw: those kept for it and the new ones."""
        known = {sentence for said in self.references(self.parts.train) for sentence in said}
        said = ((*self.kept(record), *self.sentences(record)) for record in records)
        return [tuple(sentence for sentence in found if sentence not in known) for found in said]

    def words(self, records: Iterable[int]) -> set[str]:
        """The words said about some records."""
        return {word for said in self.references(records) for sentence in said for word in sentence.split()}

    def origin(self, manifest: Manifest) -> Report:
        """How a model was trained, and how many motions and people are in each part of the data."""
        training, parts = manifest.training, self.parts
        told = ("seconds", "epochs", "kept_epoch", "loss", "validation", "steps_per_second")
        people = [{self.store.records[i].subject for i in part} for part in (parts.train, parts.test)]
        counts = {
            "train": len(parts.train),
            "validation": len(parts.validation),
            "test": len(parts.test),
            "test_unknown_words": len(self.words(parts.test) - self.words(parts.train)),
            "test_people": len(people[1]),
            "test_people_unseen": len(people[1] - people[0]),
        }
        return {
            "train": {key: float(training[key]) for key in told if key in training},
            "data": {key: float(count) for key, count in counts.items()},
        }


def split_as(manifest: Manifest, store: Store) -> SplitStore:
    """The store divided as the manifest of a run or bundle says; DataError where it is not what it was trained on."""
    try:
        told = manifest.training["split"]
        validation, test, count = set(told["validation"]), set(told["test"]), int(told["train"])
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{manifest.name} does not say which motions it was trained on") from error
    names = [entry.name for entry in store.records]
    train = tuple(i for i, name in enumerate(names) if name not in validation | test)
    if (validation | test) - set(names) or len(train) != count or len(names) != count + len(validation) + len(test):
        raise DataError(
            f"{manifest.name} was not trained on this data: its {count} training, {len(validation)} validation "
            f"and {len(test)} test motions are not the {len(names)} that are here"
        )
    parts = (tuple(i for i, name in enumerate(names) if name in part) for part in (validation, test))
    return SplitStore(store, Split(train, *parts))


def plain(sentence: str) -> str:
    """A sentence as BLEU sees it: normalised, every digit a word."""
    return " ".join(RULES.words(sentence))


def _plain(sentences: Iterable[str]) -> tuple[str, ...]:
    return tuple(plain(sentence) for sentence in sentences if usable(sentence))


@contextmanager
def unknown_words_allowed() -> Iterator[None]:
    """Without a warning for each sentence of the corpus with unknown words; the report counts them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        yield
