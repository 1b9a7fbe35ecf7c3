"""Kinds of action: those that a sentence names, and those that a motion shows according to its sentences."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.data.table import read_toml

KIND_PATTERNS: Mapping[str, str] = read_toml(__file__, "kinds.toml")
"""Name of a kind -> the regular expression of the words that name it."""

_WORDS = {kind: re.compile(rf"\b(?:{words})\b") for kind, words in KIND_PATTERNS.items()}


@cache
def named(sentence: str) -> frozenset[str]:
    """The kinds of action that a sentence names; the word after "instead of" or "without" does not count."""
    text = re.sub(r"(?:instead of|without) \w+", "", " ".join(NEW_MODEL_RULES.words(sentence)))
    return frozenset(kind for kind, words in _WORDS.items() if words.search(text))


@dataclass(frozen=True)
class Shown:
    """The kinds of action of a motion. shown: named by many of its sentences or by its title. sayable: these, and those
    named by more than one sentence."""

    shown: frozenset[str]
    sayable: frozenset[str]

    def right(self, sentence: str) -> bool:
        """Whether a sentence names a shown kind, and only sayable ones."""
        return self.right_kinds(named(sentence))

    def right_kinds(self, kinds: Collection[str]) -> bool:
        """Whether a sentence that names these kinds is right."""
        return not self.shown.isdisjoint(kinds) and self.sayable.issuperset(kinds)


def shown_by(sentences: Sequence[str], title: str = "") -> Shown:
    """The kinds of action of a motion: shown are those that 35 % of its sentences name, or its title.

    If there are none, shown are the two most frequent kinds that several sentences name. Sayable are kinds named by at
    least two sentences and a tenth of all, so that a single careless wording makes nothing right.
    """
    counts = Counter[str]()
    for sentence in sentences:
        counts.update(named(sentence))
    shown = _at_least(counts, 0.35 * len(sentences)) | named(title)
    if not shown:
        shown = frozenset(kind for kind, count in counts.most_common(2) if count > 1)
    return Shown(shown, shown | _at_least(counts, max(2.0, 0.1 * len(sentences))))


def _at_least(counts: Counter[str], least: float) -> frozenset[str]:
    return frozenset(kind for kind, count in counts.items() if count >= least)


def careful(sentences: Iterable[str], shown: frozenset[str], most: int) -> list[str]:
    """The different sentences that name only kinds in ``shown``: for each set of kinds, the first ``most``."""
    kept: dict[frozenset[str], list[str]] = {}
    for sentence in dict.fromkeys(sentences):
        kinds = named(sentence)
        if kinds and kinds <= shown:
            kept.setdefault(kinds, []).append(sentence)
    careful_sentences = []
    for same_kinds in kept.values():
        careful_sentences += same_kinds[:most]
    return careful_sentences
