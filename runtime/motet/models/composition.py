"""Composed sentences: "walk to the table, drink, then turn around" as parts that are shown one after another."""

import re
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field

STOPS = re.compile(r"(?:[.!?;](?!\d)|\n)\s*")
THEN = re.compile(
    r",?\s*\b(?:(?:and|but)\s+)?(?:then|after that|afterwards|finally|next(?!\s+to))\b,?\s*", re.IGNORECASE
)
ALSO = re.compile(r"\s*,\s*(?:and\s+)?|\s+and\s+", re.IGNORECASE)
OPENING = re.compile(r"((he|she|they|it|someone|somebody|(an?|the)\s+\w+|\w+ly)(\s+(is|are))?\s+)+", re.IGNORECASE)
"""What may stand before the verb of a part: its subject, or an adverb."""

# fmt: off
FUNCTION_WORDS = frozenset((
    "a", "after", "afterwards", "along", "an", "and", "are", "as", "at", "be", "before", "by", "finally", "first",
    "for", "from", "he", "her", "him", "his", "in", "into", "is", "it", "its", "man", "next", "of", "on", "or",
    "person", "she", "someone", "somebody", "that", "the", "their", "them", "then", "they", "this", "to", "up", "while",
    "who", "with", "woman",
))
"""Words that say little about what is done."""
# fmt: on


@dataclass(frozen=True)
class Passage:
    """A sentence of a story, shown from ``start`` to ``stop`` in seconds; ``action``, ``lacking``, ``asked`` and
    ``measured`` as for :class:`motet.models.generate.Generated`."""

    text: str
    start: float
    stop: float
    action: str = ""
    lacking: tuple[str, ...] = ()
    asked: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)


def stem(word: str) -> str:
    """What the forms of a lower-case word share: "danc" of dance, dances and dancing."""
    if len(word) <= 3:
        return word
    for ending, rest in ((r"ies$", "y"), (r"(ing|ed|es|s|e)$", ""), (r"y$", "i"), (r"([^aeiou])\1$", r"\1")):
        word = re.sub(ending, rest, word)
    return word


def verbs_of(words: Iterable[str]) -> frozenset[str]:
    """The stems of those of some words that have a form in -ing among them."""
    return frozenset(stem(word) for word in words if len(word) > 5 and word.endswith("ing"))


def sentences_of(text: str) -> list[str]:
    """The sentences of a text, and what it has between semicolons and in lines."""
    return [found for one in STOPS.split(text) if (found := one.strip(" ,"))]


def parts_of(sentence: str, verbs: Set[str]) -> list[str]:
    """The parts of a sentence, in the order in which they are done.

    verbs: stems. "then", "after that", "afterwards", "next" and "finally" always begin a part; what follows a comma or
    "and" does if it begins with a verb and one came before, so that "jumps up and down" stays whole.
    """
    sentence = re.sub(r"^first(ly)?\b,?\s*", "", sentence, flags=re.IGNORECASE)
    pieces = [piece for piece in THEN.split(sentence) if piece.strip(" ,")]
    return [part for piece in pieces for part in _before_verbs(piece.strip(" ,"), verbs)]


def _before_verbs(text: str, verbs: Set[str]) -> Iterator[str]:
    """A text cut at each comma and "and" that a verb follows."""
    start = 0
    for match in ALSO.finditer(text):
        done = re.findall(r"\w+", text[start : match.start()].lower())
        opened = re.match(r"\w+", OPENING.sub("", text[match.end() :], count=1).lower())
        if opened and stem(opened[0]) in verbs and any(stem(word) in verbs for word in done):
            yield text[start : match.start()]
            start = match.end()
    yield text[start:]
