"""Vectors of words: those of sentences, and of further, common words that mean about the same as one of them."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet.text.vocabulary import RULES, SPECIALS
from motet_train.data.errors import DataError

FIRST = 50_000
"""Words of a file that may become common words; its commonest come first."""

NEAR = 0.55
"""Cosine from which a word is near another: as near to one of our sentences are four in ten common English words."""


@dataclass(frozen=True, eq=False)
class WordTable:
    """common: further words, each with the word of the sentences that is nearest to it. vectors: (V, E) of the words of
    a vocabulary and of these, 0 for none; principal components, their standard deviation 1 overall."""

    common: Mapping[str, str]
    vectors: NDArray[np.float64]


def word_table(path: Path, words: Sequence[str], size: int) -> WordTable:
    """The table of a file of vectors (:func:`read_word_vectors`) for a vocabulary, with ``size`` numbers a word."""
    found = read_word_vectors(path, words, FIRST)
    common = nearest(found, words[len(SPECIALS) :])
    vectors, _ = principal(found, (*words, *common), size)
    return WordTable(common, vectors)


def nearest(vectors: Mapping[str, NDArray[np.float64]], words: Sequence[str]) -> dict[str, str]:
    """The words that have vectors and are none of ``words``, each with the one of these that is nearest to it by
    cosine; without those to which none is :data:`NEAR`."""
    known = [word for word in words if word in vectors and len(word) > 1]
    others = [word for word in vectors if word not in set(words)]
    if not others or not known:
        return {}
    ways, asked = (np.stack([_unit(vectors[word]) for word in some]) for some in (known, others))
    alike = asked @ ways.T
    best = alike.argmax(axis=1)
    close = alike[np.arange(len(others)), best] >= NEAR
    return {word: known[place] for word, place, good in zip(others, best, close, strict=True) if good}


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float32]:
    return (vector / (np.linalg.norm(vector) or 1.0)).astype(np.float32)


def read_word_vectors(path: Path, words: Collection[str], first: int = 0) -> dict[str, NDArray[np.float64]]:
    """The vectors (E,) of those of some words that a file has, and of its ``first`` further ones of two letters or
    more; the first vector where it has several of one.

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
        others = word not in wanted and first > 0 and _is_word(word)
        if word not in found and (word in wanted or others):
            first -= others
            try:
                found[word] = np.array(numbers, dtype=np.float64)
            except ValueError as error:
                raise DataError(f"{place}: {error}") from error
            if not np.isfinite(found[word]).all():
                raise DataError(f"{place}: a number is not finite")
    if not found:
        raise DataError(f"{path} has none of the {len(wanted)} words of the sentences")
    return found


def _is_word(text: str) -> bool:
    """Whether the rules leave a text of two letters or more as it is."""
    return text.isalpha() and len(text) > 1 and RULES.words(text) == [text]


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
