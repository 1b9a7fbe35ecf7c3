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
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.errors import DataError
from motet_train.data.sentences import usable
from motet_train.data.store import Split, Store


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
        return tuple(plain(sentence) for sentence in self.store.records[record].sentences if usable(sentence))

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

    def kept(self, record: int) -> tuple[str, ...]:
        """The sentences about a record that are kept for measuring, normalised."""
        return tuple(plain(sentence) for sentence in self.store.records[record].unseen if usable(sentence))

    def unknown_words(self, records: Iterable[int]) -> set[str]:
        """The words said about some records that were not said about training motions: models read UNK."""
        train, asked = (_vocabulary(self.references(part)) for part in (self.parts.train, records))
        return asked - train

    def z(self, motion: Motion) -> Array:
        """The frames (T, D) of a motion in standard deviations from the mean of the training motions."""
        return self.contract.normalised(self.contract.frames(motion))


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
    parts = ([i for i, name in enumerate(names) if name in part] for part in (validation, test))
    return SplitStore(store, Split(train, *(tuple(part) for part in parts)))


def _vocabulary(rows: Iterable[Iterable[str]]) -> set[str]:
    return {word for row in rows for sentence in row for word in sentence.split()}


def plain(sentence: str) -> str:
    """A sentence as BLEU sees it: normalised, every digit a word."""
    return " ".join(RULES.words(sentence))


@contextmanager
def unknown_words_allowed() -> Iterator[None]:
    """Without a warning for each sentence of the corpus with unknown words; the report counts them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        yield
