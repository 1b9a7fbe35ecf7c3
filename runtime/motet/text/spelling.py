"""Misspelt words: one or two letters off."""

from collections.abc import Iterable, Iterator

from motet.text.clauses import stem


def corrected(word: str, *known: Iterable[str]) -> str:
    """The known word that a misspelt one is meant to be; "" where that is not clear.

    That is the nearest that starts with the same letter and has four letters or more: one letter off, or two if the
    word has eight letters or more. Of several that are as near, those of the first of ``known`` count, and they have to
    be forms of one word, of which the first is given.
    """
    most = 2 if len(word) >= 8 else 1
    for off in range(1, most + 1):
        for words in known:
            found = [one for one in _alike(word, words, most) if distance(word, one) == off]
            if found:
                return found[0] if len(set(map(stem, found))) == 1 else ""
    return ""


def _alike(word: str, words: Iterable[str], most: int) -> Iterator[str]:
    """Words that can be so near, told without comparing letter by letter: that takes a thousand times as long."""
    letters = set(word)
    for one in words:
        near = one[0] == word[0] and len(one) >= 4 and abs(len(one) - len(word)) <= most
        if near and len(letters.symmetric_difference(one)) <= 2 * most:
            yield one


def distance(first: str, second: str) -> int:
    """How many letters are added, left out, changed, or swapped with the next one between two words (optimal string
    alignment)."""
    before, last = [0] * (len(second) + 1), list(range(len(second) + 1))
    for i, letter in enumerate(first, start=1):
        row = [i]
        for j, other in enumerate(second, start=1):
            best = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (letter != other))
            if i > 1 and j > 1 and letter == second[j - 2] and other == first[i - 2]:
                best = min(best, before[j - 2] + 1)
            row.append(best)
        before, last = last, row
    return last[-1]
