"""Composed sentences: "walk to the table, drink, then turn around" as parts that are shown one after another."""

import re
from collections.abc import Iterable, Iterator, Mapping, Set
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import product
from typing import NamedTuple

STOPS = re.compile(r"(?:[.!?;](?!\d)|\n)\s*")
THEN = re.compile(
    r",?\s*\b(?:(?:and|but)\s+)?(?:then|after that|(?<=and )after(?! (?:the|an?|this|his|her|their|your|\w+ing)\b)|"
    r"afterwards|finally|next(?!\s+to)|before(?=\s+(?:he|she|they|it|you|\w+ing)\b)|"
    r"(?:(?<=\bstop )|(?<=\bstops ))to(?=\s+(?!(?:the|an?|his|her|your)\b)))\b,?\s*",
    re.IGNORECASE,
)
ALSO = re.compile(r"\s*,\s*(?:and\s+)?|\s+and\s+", re.IGNORECASE)
SUBJECT = re.compile(
    r"^((he|she|they|it|someone|somebody|(an?|the|my|our)\s+\w+|\w+ly)(\s+(is|are))?\s+)+", re.IGNORECASE
)
"""Words that may stand before the verb of a part: its subject, or an adverb."""

DIRECTION = re.compile(
    r"\b(?:to (?:the|your|his|her) )?(?:left|right|up|down|forwards?|backwards?|straight(?: ahead)?|ahead)\b",
    re.IGNORECASE,
)
TIMES = re.compile(r" (?:once more|again|once|twice|\w+ times)\b", re.IGNORECASE)
SIDE_ALONE = re.compile(
    r"(?:with |on |(?:switch(?:es)?|changes?|swaps?) to )?(?:the |your |his |her |their )?"
    r"(left|right)(?: (?:one|foot|hand|leg|arm|knee|side))?",
    re.IGNORECASE,
)
THE_OTHER = re.compile(
    r"(?:with |on )?(?:the |your |his |her |their )?other(?: (?:one|foot|hand|leg|arm|knee|side))?", re.IGNORECASE
)
TOUCHED = re.compile(r"(\w+) (?:the|your|his|her|their|my) (?:left |right )?\w+", re.IGNORECASE)
THING_ALONE = re.compile(
    r"(?:the|your|his|her|their|my) (?:left |right )?(?!left|right|one|other|side)\w+", re.IGNORECASE
)
OBJECT = re.compile(
    r"\b(?:an?|the) (\w+(?: (?!from|off|of|on|onto|in|into|with|at|to|and|up|down|over|once|twice|\d|\w+ly\b)\w+)?)",
    re.IGNORECASE,
)
LOW = re.compile(r"\b(?:sit|kneel|lie|lay|crouch|squat|knee)\w*", re.IGNORECASE)
STOOPS = re.compile(r"\b(?:bend|bow|stoop|touch|tie|tying|pick)", re.IGNORECASE)
RISES = re.compile(r"(?:stand|straighten|get|come)s? (?:back )?up(?: again| straight)?", re.IGNORECASE)
AROUND = re.compile(r"\b(?:turn\w* (?:a?round|180)|half turn)", re.IGNORECASE)
ADDRESSEE = re.compile(
    r"^(?:(?:hey|ok|okay) )?(?:robot|avatar|character|bot|dude|buddy|computer|guys?|man|boy|girl),\s+", re.IGNORECASE
)

# fmt: off
FUNCTION_WORDS = frozenset((
    "a", "after", "afterwards", "along", "am", "an", "and", "are", "as", "at", "athlete", "avatar", "be", "before",
    "boy", "by", "character", "child", "finally", "first", "for", "from", "girl", "guy", "he", "her", "him", "his", "i",
    "in", "into", "is", "it", "its", "kid", "lady", "man", "my", "next", "of", "on", "or", "our", "patient", "person",
    "player", "she", "someone", "somebody", "student", "that", "the", "their", "them", "then", "they", "this", "to",
    "up", "while", "who", "with", "woman", "worker", "you", "your",
))
"""Words that say little about an action."""
# fmt: on

# fmt: off
POLITE_WORDS = frozenset((
    "a", "again", "an", "and", "do", "does", "finally", "first", "her", "his", "its", "just", "make", "makes", "my",
    "next", "now", "please", "take", "takes", "the", "their", "then", "to", "your",
))
"""Words that make no difference to a command."""
# fmt: on

SIMULTANEOUS = re.compile(
    r"\b(?:while|whilst|simultaneously|without|as (?:he|she|they|it)|(?:and )?at the same time(?: as)?)\b",
    re.IGNORECASE,
)
POSTURES = {
    "still": r"stand\w*|motionless|fre?ezes?|freezing",
    "low": r"sit|sits|sitting|seated|lie|lies|lying|kneel\w*",
    "going": r"(?:walk|run|jog|sprint|jump|hop|leap|skip|march|climb|crawl)\w*",
}
"""Postures that exclude each other."""

OWN = re.compile(
    r"\b(\w+) (?:your|his|her|their|my|the|both) (?:left |right )?"
    r"(?:arm|hand|fist|leg|foot|feet|knee|head|shoulder|elbow|hip|finger|toe|leg)s?\b"
)
"""A part of the body, and the word for what is done with it."""


class Shown(NamedTuple):
    """How a sentence is shown: ``action``, ``lacking`` and ``confidence`` as for
    :class:`motet.generate.base.Generated`."""

    action: str = ""
    lacking: tuple[str, ...] = ()
    confidence: float | None = None

    def left_out(self, sentence: str) -> str:
        """The message for a sentence some of whose words are left out."""
        words = ", ".join(f"'{word}'" for word in self.lacking)
        return f"{sentence!r} is read as {self.action!r}, which leaves out {words}"


@dataclass(frozen=True)
class Passage:
    """A sentence of a story, shown from ``start`` to ``stop`` in seconds; ``action``, ``lacking``, ``confidence``,
    ``requested`` and ``measured`` as for :class:`motet.generate.base.Generated`."""

    text: str
    start: float
    stop: float
    action: str = ""
    lacking: tuple[str, ...] = ()
    confidence: float | None = None
    requested: Mapping[str, float] = field(default_factory=dict)
    measured: Mapping[str, float] = field(default_factory=dict)


ENDINGS = (
    (re.compile(r"ies$"), "y"),
    (re.compile(r"(ing|ed|es|s|e)$"), ""),
    (re.compile(r"y$"), "i"),
    (re.compile(r"([^aeiou])\1$"), r"\1"),
)
"""Endings that stems lack, in the order in which they are dropped, and what takes their place."""


@lru_cache(1 << 14)
def stem(word: str) -> str:
    """The part that the forms of a lower-case word share: "danc" of dance, dances and dancing."""
    if len(word) <= 3 and not word.endswith(("e", "y")):
        return word
    for ending, rest in ENDINGS:
        shorter = ending.sub(rest, word)
        # the ing of "sing" is no ending
        if shorter != word and re.search("[aeiouy]", shorter):
            word = shorter
    return word


def verbs_of(words: Iterable[str]) -> frozenset[str]:
    """The stems of the words that end in -ing."""
    return frozenset(stem(word) for word in words if len(word) > 5 and word.endswith("ing"))


def at_odds(sentence: str) -> tuple[str, str] | None:
    """Two things in a sentence that exclude each other at the same time: "stands still while running"."""
    postures: list[tuple[str, str]] = []
    for clause in SIMULTANEOUS.split(sentence.lower()):
        for posture, words in POSTURES.items():
            match = re.search(rf"\b(?:{words})\b", clause)
            if match:
                postures.append((posture, match[0]))
                break
    for (posture, first), (other_posture, second) in product(postures, postures):
        if posture < other_posture:
            return first, second
    return None


def sentences_of(text: str) -> list[str]:
    """The sentences of a text; semicolons and line breaks end a sentence, too."""
    sentences = [ADDRESSEE.sub("", sentence.strip(" ,")) for sentence in STOPS.split(text)]
    return [sentence for sentence in sentences if sentence]


def parts_of(sentence: str, verbs: Set[str]) -> list[str]:
    """The parts of a sentence, in the order in which they are done.

    verbs: stems. "then", "after that", "afterwards", "next" and "finally" always begin a part; a comma or "and" does
    before a verb if another verb came before, so that "jumps up and down" stays whole.
    """
    sentence = re.sub(r"^first(ly)?\b,?\s*", "", sentence, flags=re.IGNORECASE)
    parts: list[str] = []
    for piece in THEN.split(sentence):
        stripped = piece.strip(" ,")
        if stripped:
            parts += _before_verbs(stripped, verbs)
    return _in_full(parts)


def _in_full(parts: Iterable[str]) -> list[str]:
    """Parts with what they leave out since the part before says it: "look up", "down" looks down, "take a ball",
    "throw it" throws the ball, who sits and then stands stands up, and who turns around and walks back goes forward."""
    full: list[str] = []
    for part in parts:
        full.append(_after(full[-1], part) if full else part)
    return full


def _after(before: str, part: str) -> str:
    """A part in full, by the one before it."""
    directions = list(DIRECTION.finditer(before))
    if directions and DIRECTION.fullmatch(TIMES.sub("", part)):
        # as often as it says itself, or as the part before
        following = before[directions[-1].end() :]
        own_times = TIMES.search(part)
        return before[: directions[-1].start()] + part + (TIMES.sub("", following) if own_times else following)
    touched = TOUCHED.fullmatch(before)
    if touched and THING_ALONE.fullmatch(part):
        return f"{touched[1]} {part}"
    if side := _side_of(before, part):
        return re.sub(r"\b(?:left|right)\b", side, before)
    thing = OBJECT.search(SUBJECT.sub("", before, count=1))
    if thing and re.match(r"\w+ it\b", part):
        return re.sub(r"\bit\b", f"the {thing[1]}", part, count=1)
    if AROUND.search(before):
        return re.sub(r"^(walks?|goe?s?) back\b", r"\1 forward", part)
    return _upright(before, part)


def _side_of(before: str, part: str) -> str:
    """The side that a part says and nothing else, or that is not that of the part before it; "" where it says none."""
    sides = re.findall(r"\b(?:left|right)\b", before)
    if sides and THE_OTHER.fullmatch(part):
        return "left" if sides[-1] == "right" else "right"
    side = SIDE_ALONE.fullmatch(part)
    return side[1] if sides and side else ""


def _upright(before: str, part: str) -> str:
    """A part that stands up after one that sits, and stands still after one that only bends."""
    if LOW.search(before):
        return f"{part} up" if re.fullmatch(r"stands?", part) else part
    return "stands still" if RISES.fullmatch(part) and STOOPS.search(before) else part


def _before_verbs(text: str, verbs: Set[str]) -> Iterator[str]:
    """A text cut at each comma and "and" before a verb."""
    start = 0
    for match in ALSO.finditer(text):
        done = re.findall(r"\w+", text[start : match.start()].lower())
        following = SUBJECT.sub("", text[match.end() :], count=1).lower()
        opened = re.match(r"(?!back (?!up|away|off)|holds? (?:\w+ )?for|(?:left|right)\b)\w+", following)
        if opened and stem(opened[0]) in verbs and any(stem(word) in verbs for word in done):
            yield text[start : match.start()]
            start = match.end()
    yield text[start:]
