"""Misspelt words: one or two letters off."""

from collections.abc import Iterable, Iterator

from motet.text.clauses import stem


def corrected(word: str, *known: Iterable[str]) -> str:
    """The known word of which another one is a misspelling; "" where that is not clear.

    It is the nearest that starts with the same letter and has four letters or more: one letter off, or two if the word
    has eight letters or more. A shorter word with another letter is no slip but one of English ("coin" is no "chin"),
    as is one of less than six letters with a letter more, unless that is there twice. If several are as near, those of
    the first of ``known`` count, and among them those of the same letters; they have to be forms of one word, and the
    first of them is returned.
    """
    most = 2 if len(word) >= 8 else 1
    for off in range(1, most + 1):
        for words in known:
            nearest = [other for other in _alike(word, words, most) if distance(word, other) == off]
            nearest = [other for other in nearest if sorted(other) == sorted(word)] or nearest
            if nearest:
                return nearest[0] if len(set(map(stem, nearest))) == 1 else ""
    return ""


def _alike(word: str, words: Iterable[str], most: int) -> Iterator[str]:
    """Words that may be as near, by a quick test: to compare letter by letter takes a thousand times as long."""
    letters = set(word)
    for other in words:
        near = other[0] == word[0] and len(other) >= 4 and abs(len(other) - len(word)) <= most
        longer = len(word) - len(other)
        changed = not longer and len(word) < 8 and sorted(word) != sorted(other)
        added = longer > 0 and len(word) < 6 and letters != set(other)
        if near and not changed and not added and len(letters.symmetric_difference(other)) <= 2 * most:
            yield other


def distance(first: str, second: str) -> int:
    """The number of letters that are added, left out, changed, or swapped with the next one between two words (optimal
    string alignment)."""
    before = [0] * (len(second) + 1)
    last = list(range(len(second) + 1))
    for i, letter in enumerate(first, start=1):
        row = [i]
        for j, other in enumerate(second, start=1):
            best = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == second[j - 2] and other == first[i - 2]:
                best = min(best, before[j - 2] + 1)
            row.append(best)
        before = last
        last = row
    return last[-1]
