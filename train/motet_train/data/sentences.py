"""Sentences about motions: which are usable, mirrored, alike, and ask for which action; and vectors of their words."""

import re
from collections.abc import Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet.models.language import MAX_WORDS, RULES
from motet_train.data.errors import DataError
from motet_train.data.store import Store

OTHER = {
    "left": "right",
    "lefts": "rights",
    "leftmost": "rightmost",
    "leftward": "rightward",
    "leftwards": "rightwards",
    "lefthanded": "righthanded",
    "leftfooted": "rightfooted",
    "clockwise": "counterclockwise",
}
OTHER |= {right: left for left, right in OTHER.items()} | {"anticlockwise": "clockwise"}
"""Words that say a side, and their opposites."""

SIDED = re.compile(rf"\b(?!right (?:angles?|angled|away)\b)({'|'.join(sorted(OTHER, key=len, reverse=True))})\b")


def usable(sentence: str) -> bool:
    """Whether a sentence has 1 to MAX_WORDS words."""
    return 1 <= len(RULES.words(sentence)) <= MAX_WORDS


def mirror_text(sentence: str) -> str:
    """The sentence, normalised, with left and right, clockwise and counterclockwise exchanged.

    A right angle stays one. Mirroring twice gives the normalised sentence, except for "anticlockwise".
    """
    return SIDED.sub(lambda match: OTHER[match[0]], RULES.normalise(sentence))


def alike(said: Sequence[Iterable[Hashable]]) -> list[int]:
    """For each of N things the number of its group: equal for things that share something, or are linked by others."""
    group, first = list(range(len(said))), dict[Hashable, int]()

    def root(one: int) -> int:
        while group[one] != one:
            group[one] = one = group[group[one]]
        return one

    for one, things in enumerate(said):
        for thing in things:
            group[root(one)] = root(first.setdefault(thing, one))
    return [root(one) for one in range(len(said))]


@dataclass(frozen=True)
class Actions:
    """Actions that motions show. of: that of each record, as it is and mirrored. sentences: those of each action that
    are to train on, normalised; unseen: those whose wordings are for measuring."""

    of: Mapping[tuple[int, bool], int]
    sentences: tuple[tuple[str, ...], ...]
    unseen: tuple[tuple[str, ...], ...]

    def __len__(self) -> int:
        """Their number."""
        return len(self.sentences)


def actions_of(store: Store, records: tuple[int, ...]) -> Actions:
    """The actions of some records; the mirror image of an action is another if one of its sentences says a side."""
    numbers: dict[tuple[str, bool], int] = {}
    of: dict[tuple[int, bool], int] = {}
    said: list[tuple[dict[str, None], dict[str, None]]] = []
    entries = {record: store.records[record] for record in records}
    sided = {e.shows for e in entries.values() if any(mirror_text(s) != RULES.normalise(s) for s in e.sentences)}
    for record, entry in entries.items():
        for mirrored, worded in ((False, RULES.normalise), (True, mirror_text)):
            number = numbers.setdefault((entry.shows, mirrored and entry.shows in sided), len(numbers))
            of[record, mirrored] = number
            if number == len(said):
                said.append(({}, {}))
            for known, sentences in zip(said[number], (entry.sentences, entry.unseen), strict=True):
                known.update(dict.fromkeys(worded(s) for s in sentences if usable(s)))
    return Actions(of, tuple(tuple(found) for found, _ in said), tuple(tuple(found) for _, found in said))


def read_word_vectors(path: Path, words: Collection[str]) -> dict[str, NDArray[np.float64]]:
    """The vectors (E,) of those of some words that a file has; the first where it has several of one.

    The file is text as of GloVe and word2vec: in each line a word and E numbers, separated by spaces. A first line of
    two whole numbers, how many words and E, is skipped. DataError names a line that is different, and says so where
    none of the words has a vector.
    """
    wanted, found, size = set(words), dict[str, NDArray[np.float64]](), 0
    for number, line in _lines(path):
        if number == 1 and len(line.split()) == 2 and all(map(str.isdigit, line.split())):
            continue
        size = size or line.count(" ")
        word, *numbers = line.rsplit(" ", size)  # some files have words with spaces inside
        place = f"{path}, line {number}"
        if not size or len(numbers) != size:
            raise DataError(f"{place}: expected a word and {size or 'some'} numbers, not {len(numbers)}")
        if word in wanted and word not in found:
            try:
                found[word] = np.array(numbers, dtype=np.float64)
            except ValueError as error:
                raise DataError(f"{place}: {error}") from error
            if not np.isfinite(found[word]).all():
                raise DataError(f"{place}: a number is not finite")
    if not found:
        raise DataError(f"{path} has none of the {len(wanted)} words of the sentences")
    return found


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a file that are not blank, with their numbers."""
    try:
        with path.open(encoding="utf-8") as lines:
            yield from ((number, line.strip()) for number, line in enumerate(lines, start=1) if line.strip())
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the word vectors {path} cannot be read: {error}") from error


def principal(
    vectors: Mapping[str, NDArray[np.float64]], words: Sequence[str], size: int
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The principal components of vectors as rows (words, size) of standard deviation 1 overall, and which words have
    one; the other rows, and components beyond the number of axes, are 0."""
    known = np.array([word in vectors for word in words])
    given = np.stack([vectors[word] for word in words if word in vectors])
    given = given - given.mean(axis=0)
    _, _, axes = np.linalg.svd(given, full_matrices=False)
    found = np.zeros((len(words), size))
    parts = given @ axes[:size].T
    found[known, : parts.shape[1]] = parts / (parts.std() or 1.0)
    return found, known
