"""Kinds of action: which a sentence names, and which a motion shows, by what is said of it."""

import re
import tomllib
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from motet.text.vocabulary import RULES

KINDS = tomllib.loads((files("motet_train.data") / "kinds.toml").read_text(encoding="utf-8"))
"""Name of a kind -> the regular expression of the words that name it."""

_WORDS = {kind: re.compile(rf"\b(?:{words})\b") for kind, words in KINDS.items()}


@cache
def named(sentence: str) -> frozenset[str]:
    """The kinds of action that a sentence names, but for words after "instead of" and "without"."""
    text = re.sub(r"(?:instead of|without) \w+", "", " ".join(RULES.words(sentence)))
    return frozenset(kind for kind, words in _WORDS.items() if words.search(text))


@dataclass(frozen=True)
class Shown:
    """The kinds of action of a motion. shown: those that many sentences name, or its title. sayable: these, and those
    that more than one sentence names."""

    shown: frozenset[str]
    sayable: frozenset[str]

    def right(self, sentence: str) -> bool:
        """Whether a sentence names a kind that is shown, and none that is not sayable."""
        return self.right_kinds(named(sentence))

    def right_kinds(self, kinds: Collection[str]) -> bool:
        """Whether some kinds are right to be named, like a sentence that names them."""
        return not self.shown.isdisjoint(kinds) and self.sayable.issuperset(kinds)


def shown_by(sentences: Sequence[str], title: str = "") -> Shown:
    """The kinds that a motion shows, by all sentences about it: at least 35 in a hundred name them, or the title.

    Sayable is what more than one sentence in ten names, so that one careless wording makes nothing right.
    """
    counts, told = Counter(kind for sentence in sentences for kind in named(sentence)), named(title)
    shown = frozenset(kind for kind, count in counts.items() if count >= 0.35 * len(sentences)) | told
    shown = shown or frozenset(kind for kind, count in counts.most_common(2) if count > 1)
    least = max(2.0, 0.1 * len(sentences))
    return Shown(shown, shown | {kind for kind, count in counts.items() if count >= least})


def careful(sentences: Iterable[str], shown: frozenset[str], most: int) -> list[str]:
    """Of sentences about a motion those that name nothing but what it ``shows``: of each set of kinds up to ``most``,
    the first."""
    kept: dict[frozenset[str], list[str]] = {}
    for sentence in dict.fromkeys(sentences):
        kinds = named(sentence)
        if kinds and kinds <= shown:
            kept.setdefault(kinds, []).append(sentence)
    return [sentence for said in kept.values() for sentence in said[:most]]
