"""A prepared corpus, divided as in the training of a model."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

import numpy as np

from motet.bundle.manifest import Manifest
from motet.errors import TextWarning
from motet.motion.motion import Motion
from motet.representation.contract import MotionContract
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.errors import DataError
from motet_train.data.sentences import alike, usable
from motet_train.data.store import Entry, Split, Store
from motet_train.evaluate.tables import Report


@dataclass(frozen=True, eq=False)
class SplitStore:
    """A store and its parts for training, validation and test."""

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
        """The normalised sentences about a record, words separated by one space; those without words are left out."""
        return _plain(self.store.records[record].sentences)

    def kept(self, record: int) -> tuple[str, ...]:
        """The normalised sentences about a record that are reserved for evaluation."""
        return _plain(self.store.records[record].unseen)

    def references(self, records: Iterable[int]) -> list[tuple[str, ...]]:
        """The sentences of several records."""
        return [self.sentences(record) for record in records]

    def described(self, records: Iterable[int], most: int | None = None) -> tuple[int, ...]:
        """The records that have sentences, or the same random ``most`` of them every time; DataError without any."""
        described = np.array([record for record in records if self.sentences(record)], dtype=np.intp)
        if not len(described):
            raise DataError("no motion in this part of the data has a sentence")
        if most is not None and len(described) > most:
            described = np.sort(np.random.default_rng(0).choice(described, most, replace=False))
        return tuple(described.tolist())

    def trained_sentences(self) -> set[str]:
        """The sentences about training motions, normalised."""
        return set(chain.from_iterable(self.references(self.parts.train)))

    def unseen(self, records: Iterable[int]) -> list[tuple[str, ...]]:
        """The sentences of several records that are not in training: the reserved ones and new ones."""
        known = self.trained_sentences()
        unseen = []
        for record in records:
            sentences = (*self.kept(record), *self.sentences(record))
            unseen.append(tuple(sentence for sentence in sentences if sentence not in known))
        return unseen

    def words(self, records: Iterable[int]) -> set[str]:
        """The words of the sentences of some records."""
        return set(" ".join(chain.from_iterable(self.references(records))).split())

    def people(self, records: Iterable[int]) -> set[str]:
        """The people that move in some records."""
        return {self.store.records[record].subject for record in records}

    def origin(self, manifest: Manifest) -> Report:
        """How a model was trained, and how many motions and people are in each part of the data."""
        training = manifest.training
        keys = ("seconds", "epochs", "kept_epoch", "loss", "validation", "steps_per_second")
        parts = self.parts
        test_people = self.people(parts.test)
        counts = {
            "train": len(parts.train),
            "validation": len(parts.validation),
            "test": len(parts.test),
            "test_unknown_words": len(self.words(parts.test) - self.words(parts.train)),
            "test_people": len(test_people),
            "test_people_unseen": len(test_people - self.people(parts.train)),
        }
        return {
            "train": {key: float(training[key]) for key in keys if key in training},
            "data": {key: float(count) for key, count in counts.items()},
        }


def split_as(manifest: Manifest, store: Store) -> SplitStore:
    """The store divided as the manifest of a run or bundle says; DataError if it was not trained on this store."""
    try:
        split = manifest.training["split"]
        train_count = int(split["train"])
        validation_names = set(split["validation"])
        test_names = set(split["test"])
    except (KeyError, TypeError, ValueError) as error:
        raise DataError(f"{manifest.name} does not say which motions it was trained on") from error
    names = [entry.name for entry in store.records]
    held_out = validation_names | test_names
    train = matching(names, lambda name: name not in held_out)
    # the store has these motions, and no others
    complete = len(names) == train_count + len(validation_names) + len(test_names)
    if not held_out <= set(names) or not complete or len(train) != train_count:
        raise DataError(
            f"{manifest.name} was not trained on this data: its {train_count} training, {len(validation_names)} "
            f"validation and {len(test_names)} test motions are not the {len(store.records)} that are here"
        )
    validation = matching(names, validation_names.__contains__)
    return SplitStore(store, Split(train, validation, matching(names, test_names.__contains__)))


def matching(names: Sequence[str], wanted: Callable[[str], bool]) -> tuple[int, ...]:
    """The records whose names are wanted."""
    return tuple(record for record, name in enumerate(names) if wanted(name))


def plain(sentence: str) -> str:
    """A sentence in the form that BLEU compares: normalised, every digit a word."""
    return " ".join(NEW_MODEL_RULES.words(sentence))


def _plain(sentences: Iterable[str]) -> tuple[str, ...]:
    return tuple(plain(sentence) for sentence in sentences if usable(sentence))


def description_groups(entries: Sequence[Entry]) -> list[int]:
    """A number for each record, equal for records that share a sentence, directly or through others."""
    descriptions = []
    for entry in entries:
        descriptions.append([NEW_MODEL_RULES.normalise(sentence) for sentence in (*entry.sentences, *entry.unseen)])
    return alike(descriptions)


@contextmanager
def unknown_words_allowed() -> Iterator[None]:
    """Suppress the warnings about unknown words in sentences of the corpus; the report counts them."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        yield
