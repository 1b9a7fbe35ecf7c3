"""Word vectors of the vocabulary, and of further common words that mean about the same as a word of it."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.rotations import Array
from motet.text.vocabulary import NEW_MODEL_RULES, SPECIALS
from motet_train.data.errors import DataError

FIRST = 50_000
"""Number of words of a file that may become common words; files begin with the most frequent."""


@dataclass(frozen=True, eq=False)
class WordTable:
    """Word vectors for a net.

    common: further words, each with the nearest word of the vocabulary. vectors: (V, E), principal components of the
    vectors of the vocabulary's words and of the common ones, scaled to an overall standard deviation of 1; 0 for words
    without a vector.
    """

    common: Mapping[str, str]
    vectors: Array


def word_table(path: Path, words: Sequence[str], size: int) -> WordTable:
    """The table of a file of vectors (:func:`read_word_vectors`) for a vocabulary, with ``size`` numbers per word."""
    read = read_word_vectors(path, words, FIRST)
    common = nearest(read, words[len(SPECIALS) :])
    return WordTable(common, principal(read, (*words, *common), size))


def nearest(vectors: Mapping[str, Array], words: Sequence[str]) -> dict[str, str]:
    """The further words that have vectors, each with the nearest of ``words`` by cosine, if that is
    0.55: four in ten common English words are as near to a word of our sentences."""
    known = [word for word in words if word in vectors and len(word) > 1]
    others = [word for word in vectors if word not in set(words)]
    if not others or not known:
        return {}
    # cosines between all pairs
    known_directions = np.stack([_unit(vectors[word]) for word in known])
    other_directions = np.stack([_unit(vectors[word]) for word in others])
    cosines = other_directions @ known_directions.T
    neighbours = {}
    for word, row in zip(others, cosines, strict=True):
        best = int(row.argmax())
        if row[best] >= 0.55:
            neighbours[word] = known[best]
    return neighbours


def _unit(vector: Array) -> Floats:
    return (vector / (np.linalg.norm(vector) or 1.0)).astype(np.float32)


def read_word_vectors(path: Path, words: Collection[str], first: int = 0) -> dict[str, Array]:
    """The vectors (E,) of ``words`` in a file, and of its ``first`` further words of two letters or more.

    The file is text as of GloVe and word2vec: in each line a word and E numbers, separated by spaces; of two lines of a
    word the first counts. A first line of two whole numbers, the number of words and E, is skipped. DataError names a
    line that is different, or says that none of the words has a vector.
    """
    wanted = set(words)
    vectors: dict[str, Array] = {}
    size = 0
    for number, line in _lines(path):
        if _is_header(number, line):
            continue
        # the first line says how many numbers a word has
        size = size or line.count(" ")
        word, *numbers = line.rsplit(" ", size)  # some files have words with spaces inside
        place = f"{path}, line {number}"
        if not size or len(numbers) != size:
            raise DataError(f"{place}: expected a word and {size or 'some'} numbers, not {len(numbers)}")
        if word in vectors:
            continue
        # the wanted words, and the first further ones
        is_further = word not in wanted and first > 0 and _is_word(word)
        if word in wanted or is_further:
            vectors[word] = _vector(numbers, place)
            first -= is_further
    if not vectors:
        raise DataError(f"{path} has none of the {len(wanted)} words of the sentences")
    return vectors


def _is_header(number: int, line: str) -> bool:
    parts = line.split()
    return number == 1 and len(parts) == 2 and all(map(str.isdigit, parts))


def _vector(numbers: list[str], place: str) -> Array:
    try:
        vector = np.array(numbers, dtype=np.float64)
    except ValueError as error:
        raise DataError(f"{place}: {error}") from error
    if not np.isfinite(vector).all():
        raise DataError(f"{place}: a number is not finite")
    return vector


def _is_word(text: str) -> bool:
    """Whether a text is a word of two letters or more that normalisation does not change."""
    return text.isalpha() and len(text) > 1 and NEW_MODEL_RULES.words(text) == [text]


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The non-blank lines of a file with their numbers."""
    try:
        with path.open(encoding="utf-8") as lines:
            for number, line in enumerate(lines, start=1):
                if line.strip():
                    yield number, line.strip()
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the word vectors {path} cannot be read: {error}") from error


def principal(vectors: Mapping[str, Array], words: Sequence[str], size: int) -> Array:
    """Principal components of vectors as rows (words, size), scaled to an overall standard deviation of 1.

    Rows of words without a vector, and components beyond the number of axes, are 0.
    """
    known = np.array([word in vectors for word in words])
    # principal axes of the words with a vector
    rows = np.stack([vectors[word] for word in words if word in vectors])
    rows = rows - rows.mean(axis=0)
    _, _, axes = np.linalg.svd(rows, full_matrices=False)
    parts = rows @ axes[:size].T
    components = np.zeros((len(words), size))
    components[known, : parts.shape[1]] = parts / (parts.std() or 1.0)
    return components
