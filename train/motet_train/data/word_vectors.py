"""Vectors of words from a file: from them a net knows before it is trained which words are alike."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet_train.data.errors import DataError

Floats = NDArray[np.float64]


def read_word_vectors(path: Path, words: Collection[str]) -> dict[str, Floats]:
    """The vectors (E,) of those of some words that a file has; the first where it has several of one.

    The file is text as GloVe and word2vec write it: in each line a word and E numbers, with spaces between. A first
    line of two whole numbers, how many words and E, is passed over. DataError names the line where that is not so, and
    says so where none of the words has a vector.
    """
    wanted, found, size = set(words), dict[str, Floats](), 0
    for number, line in _lines(path):
        if number == 1 and len(line.split()) == 2 and all(map(str.isdigit, line.split())):
            continue
        size = size or line.count(" ")
        word, *numbers = line.rsplit(" ", size)  # some files have words with spaces inside
        place = f"{path}, line {number}"
        if not size or len(numbers) != size:
            raise DataError(f"{place}: expected a word and {size or 'some'} numbers, not {len(numbers)}")
        if word in wanted and word not in found:
            found[word] = _vector(numbers, place)
    if not found:
        raise DataError(f"{path} has none of the {len(wanted)} words of the sentences")
    return found


def principal(vectors: Mapping[str, Floats], words: Sequence[str], size: int) -> tuple[Floats, NDArray[np.bool_]]:
    """The principal components of vectors as rows (words, size) of standard deviation 1 in all, and which words have
    one; of the others, and of components beyond those that there are, the numbers are 0."""
    known = np.array([word in vectors for word in words])
    given = np.stack([vectors[word] for word in words if word in vectors])
    given = given - given.mean(axis=0)
    _, _, axes = np.linalg.svd(given, full_matrices=False)
    found = np.zeros((len(words), size))
    parts = given @ axes[:size].T
    found[known, : parts.shape[1]] = parts / (parts.std() or 1.0)
    return found, known


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a file that say anything, with their numbers."""
    try:
        with path.open(encoding="utf-8") as lines:
            yield from ((number, line.strip()) for number, line in enumerate(lines, start=1) if line.strip())
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the word vectors {path} cannot be read: {error}") from error


def _vector(numbers: Sequence[str], place: str) -> Floats:
    try:
        found = np.array(numbers, dtype=np.float64)
    except ValueError as error:
        raise DataError(f"{place}: {error}") from error
    if not np.isfinite(found).all():
        raise DataError(f"{place}: a number is not finite")
    return found
