"""Sentences about motions: which are usable, mirrored, alike, and ask for which action."""

import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from motet.text.vocabulary import MAX_WORDS, RULES
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
