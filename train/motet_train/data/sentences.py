"""Sentences about motions: which are usable, their mirror images, groups of equal ones, and the actions they name."""

import re
from collections import defaultdict
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from motet.text.vocabulary import MAX_WORDS, NEW_MODEL_RULES
from motet_train.data.store import Store

Wordings = tuple[tuple[str, ...], ...]
"""For each action its sentences."""

RIGHT_OF_LEFT = {
    "left": "right",
    "lefts": "rights",
    "leftmost": "rightmost",
    "leftward": "rightward",
    "leftwards": "rightwards",
    "lefthanded": "righthanded",
    "leftfooted": "rightfooted",
    "clockwise": "counterclockwise",
}
OPPOSITE_WORDS = RIGHT_OF_LEFT | {right: left for left, right in RIGHT_OF_LEFT.items()} | {"anticlockwise": "clockwise"}
"""Words for a side or a sense of rotation, and their opposites."""

SIDED_WORDS = re.compile(
    rf"\b(?!right (?:angles?|angled|away)\b)({'|'.join(sorted(OPPOSITE_WORDS, key=len, reverse=True))})\b"
)


def usable(sentence: str) -> bool:
    """Whether a sentence has 1 to MAX_WORDS words."""
    return 1 <= len(NEW_MODEL_RULES.words(sentence)) <= MAX_WORDS


def mirror_text(sentence: str) -> str:
    """The normalised sentence with left and right, clockwise and counterclockwise exchanged.

    A right angle stays a right angle. Mirroring twice gives the normalised sentence, except for "anticlockwise".
    """
    return SIDED_WORDS.sub(lambda match: OPPOSITE_WORDS[match[0]], NEW_MODEL_RULES.normalise(sentence))


def alike(features: Sequence[Iterable[Hashable]]) -> list[int]:
    """Group N things by their features: the number of each thing's group.

    Things are in one group if they share a feature, directly or through a chain of other things.
    """
    parent = list(range(len(features)))
    first_with: dict[Hashable, int] = {}

    def root(thing: int) -> int:
        while parent[thing] != thing:
            parent[thing] = parent[parent[thing]]  # path halving
            thing = parent[thing]
        return thing

    for thing, own_features in enumerate(features):
        for feature in own_features:
            parent[root(thing)] = root(first_with.setdefault(feature, thing))
    return [root(thing) for thing in range(len(features))]


@dataclass(frozen=True)
class Actions:
    """Actions that motions show.

    of: the action of each record, by its index and whether it is mirrored. sentences: normalised sentences of each
    action to train on. unseen: those reserved for measuring.
    """

    of: Mapping[tuple[int, bool], int]
    sentences: Wordings
    unseen: Wordings

    def __len__(self) -> int:
        """Number of actions."""
        return len(self.sentences)


def actions_of(store: Store, records: tuple[int, ...]) -> Actions:
    """The actions of some records; an action whose sentences name a side has a mirror image that is another action."""
    sided = _sided(store, records)
    numbers: dict[tuple[str, bool], int] = {}
    of: dict[tuple[int, bool], int] = {}
    # dicts, as sets that keep their order
    sentences = defaultdict[int, dict[str, None]](dict)
    unseen = defaultdict[int, dict[str, None]](dict)
    for record, mirrored in product(records, (False, True)):
        entry = store.records[record]
        action = (entry.shows, mirrored and entry.shows in sided)
        of[record, mirrored] = number = numbers.setdefault(action, len(numbers))
        sentences[number] |= _worded(entry.sentences, mirrored)
        unseen[number] |= _worded(entry.unseen, mirrored)
    return Actions(of, _listed(sentences), _listed(unseen))


def _listed(sentences: Mapping[int, Iterable[str]]) -> Wordings:
    return tuple(map(tuple, sentences.values()))


def _sided(store: Store, records: tuple[int, ...]) -> set[str]:
    """The actions of records with a sentence that names a side."""
    sided = set()
    for record in records:
        entry = store.records[record]
        if any(mirror_text(sentence) != NEW_MODEL_RULES.normalise(sentence) for sentence in entry.sentences):
            sided.add(entry.shows)
    return sided


def _worded(sentences: Iterable[str], mirrored: bool) -> dict[str, None]:
    """The usable sentences, normalised and perhaps mirrored, as the keys of a dict."""
    worded = mirror_text if mirrored else NEW_MODEL_RULES.normalise
    return dict.fromkeys(worded(sentence) for sentence in sentences if usable(sentence))
