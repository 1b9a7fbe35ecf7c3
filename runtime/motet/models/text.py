"""Text: from a sentence to the words a model knows, and back. Section 3.2 of Plappert et al. 2017."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.errors import TextError

PAD, SOS, EOS, UNK = SPECIALS = ("PAD", "SOS", "EOS", "UNK")
"""Padding, start and end of a sentence, unknown word: ids 0 to 3. Upper case, so that no normal word is one."""

MAX_WORDS = 40
"""Words of the longest sentence that a model takes or gives."""

SPELLING = {
    "aound": "around",
    "arround": "around",
    "backword": "backward",
    "backwords": "backwards",
    "clock wise": "clockwise",
    "counter clock wise": "counterclockwise",
    "counter clockwise": "counterclockwise",
    "foreward": "forward",
    "forewards": "forwards",
    "forword": "forward",
    "forwords": "forwards",
    "fourty": "forty",
    "foward": "forward",
    "fowards": "forwards",
    "humanbeing": "human being",
    "infront": "in front",
    "jumpes": "jumps",
    "leftfoot": "left foot",
    "lefthand": "left hand",
    "ninty": "ninety",
    "peron": "person",
    "perosn": "person",
    "persion": "person",
    "preson": "person",
    "rightfoot": "right foot",
    "righthand": "right hand",
    "runing": "running",
    "side ways": "sideways",
    "sombody": "somebody",
    "somone": "someone",
    "stright": "straight",
    "walkes": "walks",
    "waling": "walking",
    "walkin": "walking",
    "wlaks": "walks",
}
"""Common misspellings, of one word or several, without punctuation."""

# fmt: off
TEENS = {name: value for value, name in enumerate((
    "zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
    "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen",
))}
TENS = {name: 10 * value for value, name in enumerate((
    "twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety",
), start=2)}
# fmt: on

_APOSTROPHES = re.compile("['`\u2018\u2019\u00b4]")
_PUNCTUATION = re.compile(r"[\W_]+")
_TOKENS = re.compile(r"\d|[^\W\d]+")


def normalise(sentence: str, spelling: Mapping[str, str] = SPELLING) -> str:
    """Lower case without accents and punctuation, spelling mended, number words as digits: "90 degrees"."""
    plain = unicodedata.normalize("NFKD", _APOSTROPHES.sub("", sentence)).lower()
    plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
    plain = " ".join(_PUNCTUATION.sub(" ", plain).split())
    if spelling:
        longest_first = sorted(spelling, key=len, reverse=True)
        plain = re.sub(rf"\b({'|'.join(map(re.escape, longest_first))})\b", lambda m: spelling[m[0]], plain)
    return " ".join(_with_digits(plain.split()))


def words(sentence: str) -> list[str]:
    """The words of a sentence after :func:`normalise`; each digit is a word of its own."""
    return _TOKENS.findall(normalise(sentence))


def _with_digits(tokens: list[str]) -> list[str]:
    result, place = [], 0
    while place < len(tokens):
        value, used = _number(tokens[place:])
        result.append(str(value) if used else tokens[place])
        place += used or 1
    return result


def _number(tokens: list[str]) -> tuple[int, int]:
    """The number that ``tokens`` start with, and how many of them it takes; 0 of them where they start with none."""
    value, used = _below_hundred(tokens)
    if tokens[used : used + 1] != ["hundred"]:
        return value, used
    value, used = 100 * (value if used else 1), used + 1
    skipped = tokens[used : used + 1] == ["and"]
    more, length = _below_hundred(tokens[used + skipped :])
    return (value + more, used + skipped + length) if length else (value, used)


def _below_hundred(tokens: list[str]) -> tuple[int, int]:
    first, second = (*tokens[:2], "", "")[:2]
    if first in TENS:
        unit = TEENS.get(second, 0)
        return (TENS[first] + unit, 2) if 0 < unit < 10 else (TENS[first], 1)
    return (TEENS[first], 1) if first in TEENS else (0, 0)


@dataclass(frozen=True)
class Vocabulary:
    """The words a model knows; a word's place is its id.

    words: all of them, PAD, SOS, EOS and UNK first. TextError where they are not, or a word is there twice.
    """

    words: tuple[str, ...]

    def __init__(self, words: Sequence[str]) -> None:
        object.__setattr__(self, "words", tuple(words))
        if self.words[: len(SPECIALS)] != SPECIALS:
            raise TextError(f"a vocabulary starts with {', '.join(SPECIALS)}, not with {', '.join(self.words[:4])}")
        if len(self.ids) != len(self.words):
            raise TextError("a vocabulary holds each word once")

    @staticmethod
    def of(sentences: Iterable[str]) -> "Vocabulary":
        """The vocabulary of sentences: their words by falling count, then by name."""
        counts = Counter(word for sentence in sentences for word in words(sentence))
        return Vocabulary([*SPECIALS, *sorted(counts, key=lambda word: (-counts[word], word))])

    def __len__(self) -> int:
        return len(self.words)

    @cached_property
    def ids(self) -> dict[str, int]:
        """Word -> id."""
        return {word: i for i, word in enumerate(self.words)}

    def encode(self, sentence: str) -> tuple[NDArray[np.int64], list[str]]:
        """Ids (words,) int64 of a sentence, without SOS and EOS, and its words that are not known: their id is UNK's.

        TextError for a sentence without words, one without a known word, and one of more than :data:`MAX_WORDS` words.
        """
        found = words(sentence)
        unknown = [word for word in found if word not in self.ids]
        if not found:
            raise TextError(f"the sentence {sentence!r} has no words")
        if len(found) > MAX_WORDS:
            raise TextError(f"the sentence has {len(found)} words, and at most {MAX_WORDS} are possible: {sentence!r}")
        if len(unknown) == len(found):
            raise TextError(f"the model knows no word of {sentence!r}; it knows words such as {self._examples()}")
        return np.array([self.ids.get(word, self.ids[UNK]) for word in found], dtype=np.int64), unknown

    def _examples(self) -> str:
        return ", ".join(self.words[len(SPECIALS) : len(SPECIALS) + 20])

    def decode(self, ids: Iterable[int]) -> str:
        """The sentence of ids, without PAD, SOS, EOS and UNK; digits that follow each other become one number."""
        text = " ".join(self.words[i] for i in ids if i >= len(SPECIALS))
        return re.sub(r"(?<=\d) (?=\d)", "", text)

    def to_json(self) -> list[str]:
        """The whole list of words; :meth:`from_json` is the inverse."""
        return list(self.words)

    @staticmethod
    def from_json(data: Sequence[str]) -> "Vocabulary":
        """Read what :meth:`to_json` wrote; TextError where it is no vocabulary."""
        return Vocabulary(data)
