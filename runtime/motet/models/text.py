"""Text: from a sentence to the words a model knows, and back. Section 3.2 of Plappert et al. 2017."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.errors import TextError

PAD, SOS, EOS, UNK = SPECIALS = ("PAD", "SOS", "EOS", "UNK")
"""Padding, start and end of a sentence, unknown word: ids 0 to 3. Upper case, so that no normal word is one."""

MAX_WORDS = 40
"""Most words of a sentence."""

MAX_LETTERS = 2000
"""Most letters of a sentence."""

RULES_VERSION = 1
"""Version of how :class:`TextRules` uses its tables."""

MAX_RULES = 2000
"""Entries of its tables."""

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
NUMBERS = {name: value for value, name in enumerate((
    "zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
    "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen",
))} | {name: 10 * value for value, name in enumerate((
    "twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety",
), start=2)}
# fmt: on
"""Number words below a hundred."""

_SEPARATORS = re.compile(r"[\W_]+")
_TOKENS = re.compile(r"\d|[^\W\d]+")


@dataclass(frozen=True)
class TextRules:
    """How a sentence becomes words; a bundle has its own rules, so that words stay the same as in training.

    dropped: characters removed, so that "isn't" is one word. spelling: replacements of a word, or several.
    numbers: number words and their values, 0 to 99. hundred, conjunction, point: the words in "a hundred and five" and
    for the point in 1.5. spelled: whole numbers up to this are spelled out in a model's sentences.
    """

    dropped: str = "'`\u2018\u2019\u00b4"
    spelling: Mapping[str, str] = field(default_factory=lambda: dict(SPELLING))
    numbers: Mapping[str, int] = field(default_factory=lambda: dict(NUMBERS))
    hundred: str = "hundred"
    conjunction: str = "and"
    point: str = "point"
    spelled: int = 12

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`from_json` is the inverse."""
        return {"rules": RULES_VERSION, **asdict(self)}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "TextRules":
        """Read what :meth:`to_json` wrote; BundleError where it is not a set of rules."""
        top = Fields(data, "text")
        top.whole("rules", RULES_VERSION, RULES_VERSION)
        spelling, numbers = top.fields("spelling"), top.fields("numbers")
        if len(spelling.data) + len(numbers.data) > MAX_RULES:
            raise top.fault(f"at most {MAX_RULES} words in its tables", len(spelling.data) + len(numbers.data))
        return TextRules(
            top.text("dropped"),
            {wrong: spelling.text(wrong) for wrong in spelling.data},
            {word: numbers.whole(word, 0, 99) for word in numbers.data},
            top.text("hundred"),
            top.text("conjunction"),
            top.text("point"),
            top.whole("spelled", 0, 99),
        )

    def normalise(self, sentence: str) -> str:
        """Lower case without accents and punctuation, spelling corrected, number words as digits: "90 degrees"."""
        plain = sentence.translate(dict.fromkeys(map(ord, self.dropped)))
        plain = unicodedata.normalize("NFKD", plain).lower()
        plain = "".join(letter for letter in plain if not unicodedata.combining(letter))
        plain = re.sub(r"(?<=\d)\.(?=\d)", f" {self.point} ", plain)
        plain = " ".join(_SEPARATORS.sub(" ", plain).split())
        plain = self._misspelt.sub(lambda match: self.spelling[match[0]], plain)
        return " ".join(self._with_digits(plain.split()))

    def words(self, sentence: str) -> list[str]:
        """The words of a sentence after :meth:`normalise`; each digit is a word of its own."""
        return _TOKENS.findall(self.normalise(sentence))

    def sentence(self, words: Iterable[str]) -> str:
        """The sentence of words: consecutive digits become one number, and small numbers words.

        A word "" stands between its neighbours, and vanishes.
        """
        joined = re.sub(r"(?<=\d) (?=\d)", "", " ".join(words))
        joined = re.sub(rf"(?<=\d) {re.escape(self.point)} (?=\d)", ".", joined)
        return " ".join(self._spelled.get(word, word) for word in joined.split())

    @cached_property
    def _misspelt(self) -> re.Pattern[str]:
        longest_first = sorted(self.spelling, key=len, reverse=True)
        return re.compile(rf"\b({'|'.join(map(re.escape, longest_first))})\b" if longest_first else r"(?!)")

    @cached_property
    def _spelled(self) -> dict[str, str]:
        return {str(value): word for word, value in self.numbers.items() if value <= self.spelled}

    def _with_digits(self, tokens: list[str]) -> list[str]:
        result, place = [], 0
        while place < len(tokens):
            value, used = self._number(tokens[place : place + 5])
            result.append(str(value) if used else tokens[place])
            place += used or 1
        return result

    def _number(self, tokens: list[str]) -> tuple[int, int]:
        """The number at the start of ``tokens``, and how many of them it takes: 0 for none."""
        value, used = self._below_hundred(tokens)
        if tokens[used : used + 1] != [self.hundred]:
            return value, used
        value, used = 100 * (value if used else 1), used + 1
        skipped = tokens[used : used + 1] == [self.conjunction]
        more, length = self._below_hundred(tokens[used + skipped :])
        return (value + more, used + skipped + length) if length else (value, used)

    def _below_hundred(self, tokens: list[str]) -> tuple[int, int]:
        first, second = (self.numbers.get(token) for token in (*tokens[:2], "", "")[:2])
        if first is not None and first >= 20 and second is not None and 0 < second < 10:
            return first + second, 2
        return (0, 0) if first is None else (first, 1)


RULES = TextRules()
"""The rules for training new models."""


@dataclass(frozen=True)
class Vocabulary:
    """The words a model knows; a word's place is its id.

    words: all of them, PAD, SOS, EOS and UNK first. TextError otherwise, or for a duplicate word.
    rules: how sentences become words.
    """

    words: tuple[str, ...]
    rules: TextRules = field(default=RULES, hash=False)

    def __init__(self, words: Sequence[str], rules: TextRules = RULES) -> None:
        object.__setattr__(self, "words", tuple(words))
        object.__setattr__(self, "rules", rules)
        if self.words[: len(SPECIALS)] != SPECIALS:
            raise TextError(f"a vocabulary starts with {', '.join(SPECIALS)}, not with {', '.join(self.words[:4])}")
        if len(self.ids) != len(self.words):
            raise TextError("a vocabulary holds each word once")

    @staticmethod
    def of(sentences: Iterable[str]) -> "Vocabulary":
        """The vocabulary of sentences: their words by falling count, then by name."""
        counts = Counter(word for sentence in sentences for word in RULES.words(sentence))
        return Vocabulary([*SPECIALS, *sorted(counts, key=lambda word: (-counts[word], word))])

    def __len__(self) -> int:
        return len(self.words)

    @cached_property
    def ids(self) -> dict[str, int]:
        """Word -> id."""
        return {word: i for i, word in enumerate(self.words)}

    def encode(self, sentence: str) -> tuple[NDArray[np.int64], list[str]]:
        """Ids (words,) int64 of a sentence, without SOS and EOS, and its unknown words, whose id is UNK's.

        TextError for a sentence without words, one without a known word, and one of more than :data:`MAX_WORDS` words
        or :data:`MAX_LETTERS` letters.
        """
        if len(sentence) > MAX_LETTERS:
            raise TextError(f"the sentence has {len(sentence)} letters, but at most {MAX_LETTERS} are allowed")
        found = self.rules.words(sentence)
        unknown = [word for word in found if word not in self.ids]
        if not found:
            raise TextError(f"the sentence {sentence!r} has no words")
        if len(found) > MAX_WORDS:
            raise TextError(f"the sentence has {len(found)} words, but at most {MAX_WORDS} are allowed: {sentence!r}")
        if len(unknown) == len(found):
            raise TextError(f"the model knows no word of {sentence!r}; it knows words such as {self._examples()}")
        return np.array([self.ids.get(word, self.ids[UNK]) for word in found], dtype=np.int64), unknown

    def _examples(self) -> str:
        return ", ".join(self.words[len(SPECIALS) : len(SPECIALS) + 20])

    def decode(self, ids: Iterable[int]) -> str:
        """The sentence of ids (:meth:`TextRules.sentence`), without PAD, SOS, EOS and UNK."""
        return self.rules.sentence(self.words[i] if i >= len(SPECIALS) else "" for i in ids)
