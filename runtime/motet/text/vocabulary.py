"""Words and their ids: how a sentence becomes words (section 3.2 of Plappert et al. 2017), and the words of a model."""

import re
import unicodedata
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import filterfalse
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.errors import TextError
from motet.text.clauses import stem
from motet.text.spelling import corrected

SPECIALS = ("PAD", "SOS", "EOS", "UNK")
PAD, SOS, EOS, UNK = SPECIALS
"""Padding, start and end of a sentence, unknown word: ids 0 to 3. Upper case, so that no normal word is one."""


MAX_WORDS = 40
"""Words of a sentence."""

MAX_LETTERS = 2000
"""Letters of a sentence."""


# fmt: off
SPELLING = {
    "aound": "around", "arround": "around", "backword": "backward", "backwords": "backwards", "clock wise": "clockwise",
    "counter clock wise": "counterclockwise", "counter clockwise": "counterclockwise", "foreward": "forward",
    "forewards": "forwards", "forword": "forward", "forwords": "forwards", "fourty": "forty", "foward": "forward",
    "fowards": "forwards", "humanbeing": "human being", "infront": "in front", "jumpes": "jumps",
    "leftfoot": "left foot", "lefthand": "left hand", "ninty": "ninety", "peron": "person", "perosn": "person",
    "persion": "person", "preson": "person", "rightfoot": "right foot", "righthand": "right hand", "runing": "running",
    "side ways": "sideways", "sombody": "somebody", "somone": "someone", "stright": "straight", "walkes": "walks",
    "waling": "walking", "walkin": "walking", "wlaks": "walks",
}
"""Common misspellings, of one word or several, without punctuation."""



NUMBER_WORDS = {name: value for value, name in enumerate((
    "zero", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve",
    "thirteen", "fourteen", "fifteen", "sixteen", "seventeen", "eighteen", "nineteen",
))} | {name: 10 * value for value, name in enumerate((
    "twenty", "thirty", "forty", "fifty", "sixty", "seventy", "eighty", "ninety",
), start=2)}
"""Number words below a hundred."""
# fmt: on


@dataclass(frozen=True)
class TextRules:
    """How a sentence becomes words; a bundle has its own rules, so that words stay the same as in training.

    dropped: characters removed, so that "isn't" is one word. spelling: replacements of a word, or several.
    numbers: number words and their values, 0 to 99. hundred, conjunction, point: the words in "a hundred and five" and
    for the point in 1.5. spelled: whole numbers up to this are spelled out in a model's sentences.
    """

    dropped: str = "'`\u2018\u2019\u00b4"
    spelling: Mapping[str, str] = field(default_factory=lambda: dict(SPELLING))
    numbers: Mapping[str, int] = field(default_factory=lambda: dict(NUMBER_WORDS))
    hundred: str = "hundred"
    conjunction: str = "and"
    point: str = "point"
    spelled: int = 12

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`from_json` is the inverse."""
        return {"rules": 1, **asdict(self)}

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "TextRules":
        """Read what :meth:`to_json` wrote; BundleError where it is not a set of rules."""
        top = Fields(data, "text")
        top.whole("rules", 1, 1)
        spelling = top.fields("spelling")
        numbers = top.fields("numbers")
        if (count := len(spelling.data) + len(numbers.data)) > 2000:
            raise top.fault("at most 2000 words in its tables", count)
        right = {wrong: spelling.text(wrong) for wrong in spelling.data}
        values = {word: numbers.whole(word, 0, 99) for word in numbers.data}
        words = {name: top.text(name) for name in ("dropped", "hundred", "conjunction", "point")}
        return TextRules(spelling=right, numbers=values, spelled=top.whole("spelled", 0, 99), **words)

    def normalise(self, sentence: str) -> str:
        """Lower case without accents and punctuation, spelling corrected, number words as digits: "90 degrees"."""
        plain = sentence.translate(dict.fromkeys(map(ord, self.dropped)))
        plain = "".join(filterfalse(unicodedata.combining, unicodedata.normalize("NFKD", plain).lower()))
        plain = re.sub(r"(?<=\d)\.(?=\d)", f" {self.point} ", plain)
        plain = " ".join(re.sub(r"[\W_]+", " ", plain).split())
        tokens = self._misspelt.sub(lambda match: self.spelling[match[0]], plain).split()
        result = []
        place = 0
        while place < len(tokens):
            value, used = self._number(tokens[place : place + 5])
            result.append(str(value) if used else tokens[place])
            place += used or 1
        return " ".join(result)

    def words(self, sentence: str) -> list[str]:
        """The words of a sentence after :meth:`normalise`; each digit is a word of its own."""
        return re.findall(r"\d|[^\W\d]+", self.normalise(sentence))

    def sentence(self, words: Iterable[str]) -> str:
        """The sentence of words: consecutive digits become one number, and small numbers words. A word "" stands
        between its neighbours, and vanishes."""
        joined = re.sub(r"(?<=\d) (?=\d)", "", " ".join(words))
        joined = re.sub(rf"(?<=\d) {re.escape(self.point)} (?=\d)", ".", joined)
        return " ".join(self._numerals.get(word, word) for word in joined.split())

    @cached_property
    def _numerals(self) -> dict[str, str]:
        """The words of small numbers by their digits."""
        return {str(value): word for word, value in self.numbers.items() if value <= self.spelled}

    @cached_property
    def _misspelt(self) -> re.Pattern[str]:
        longest_first = sorted(self.spelling, key=len, reverse=True)
        return re.compile(rf"\b({'|'.join(map(re.escape, longest_first))})\b" if longest_first else r"(?!)")

    def _number(self, tokens: list[str]) -> tuple[int, int]:
        """The number at the start of ``tokens``, and how many of them it takes: 0 for none."""
        value, used = self._below_hundred(tokens)
        if tokens[used : used + 1] != [self.hundred]:
            return value, used
        value = 100 * (value if used else 1)
        used += 1
        skipped = tokens[used : used + 1] == [self.conjunction]
        more, length = self._below_hundred(tokens[used + skipped :])
        return (value + more, used + skipped + length) if length else (value, used)

    def _below_hundred(self, tokens: list[str]) -> tuple[int, int]:
        first, second = map(self.numbers.get, (*tokens[:2], "", "")[:2])
        if first is not None and first >= 20 and second is not None and 0 < second < 10:
            return first + second, 2
        return (0, 0) if first is None else (first, 1)


NEW_MODEL_RULES = TextRules()
"""The rules for training new models."""


def check_length(sentence: str) -> None:
    """TextError for a sentence of more than :data:`MAX_LETTERS` letters."""
    if len(sentence) > MAX_LETTERS:
        raise TextError(f"the sentence has {len(sentence)} letters, but at most {MAX_LETTERS} are allowed")


@dataclass(frozen=True)
class Vocabulary:
    """The words a model knows: a word's place is its id. TextError unless PAD, SOS, EOS and UNK are the first, and each
    word is there once. rules: how sentences become words. common: further words, whose ids go on after those, each with
    the one of ``words`` that is nearest to it."""

    words: tuple[str, ...]
    rules: TextRules = field(default=NEW_MODEL_RULES, hash=False)
    common: Mapping[str, str] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "words", tuple(self.words))
        if self.words[: len(SPECIALS)] != SPECIALS:
            raise TextError(f"a vocabulary starts with {', '.join(SPECIALS)}, not with {', '.join(self.words[:4])}")
        if len(self.ids) != len(self.words) + len(self.common):
            raise TextError("a vocabulary holds each word once")
        if lacking := set(self.common.values()) - set(self.words):
            raise TextError(f"a vocabulary's common words are near words that it holds, not {min(lacking)!r}")

    @staticmethod
    def of(sentences: Iterable[str]) -> "Vocabulary":
        """The vocabulary of sentences: their words by falling count, then by name."""
        counts = Counter[str]()
        for sentence in sentences:
            counts.update(NEW_MODEL_RULES.words(sentence))
        return Vocabulary((*SPECIALS, *sorted(counts, key=lambda word: (-counts[word], word))))

    def __len__(self) -> int:
        return len(self.words)

    @cached_property
    def ids(self) -> dict[str, int]:
        """Word -> id."""
        return {word: i for i, word in enumerate((*self.words, *self.common))}

    def meant(self, word: str) -> str:
        """The known word that a lower-case word is, or the first that has its stem, or of which it is a misspelling
        (:func:`motet.text.spelling.corrected`); "" where there is none."""
        if word in self.ids or len(word) < 4:
            return word if word in self.ids else ""
        if (of_stem := self._stems.get(stem(word), "")) or not self.common:  # else "torches" were read as "touches"
            return of_stem
        return corrected(word, self.words[len(SPECIALS) :], self.common)

    def near(self, word: str) -> str:
        """The one of ``words`` that a word is (:meth:`meant`), or that is nearest to it; "" where there is none."""
        known = self.meant(word)
        return self.common.get(known, known)

    @cached_property
    def _stems(self) -> dict[str, str]:
        return {stem(word): word for word in reversed((*self.words[len(SPECIALS) :], *self.common))}

    def encode(self, sentence: str) -> tuple[NDArray[np.int64], list[str]]:
        """Ids (words,) int64 of a sentence, without SOS and EOS, and its unknown words, whose id is UNK's.

        TextError for a sentence without words, one without a known word, and one of more than :data:`MAX_WORDS` words
        or :data:`MAX_LETTERS` letters.
        """
        check_length(sentence)
        words = self.rules.words(sentence)
        if not words:
            raise TextError(f"the sentence {sentence!r} has no words")
        if len(words) > MAX_WORDS:
            raise TextError(f"the sentence has {len(words)} words, but at most {MAX_WORDS} are allowed: {sentence!r}")
        # each word as it is known, by its stem, or as the nearest spelling
        meant = list(map(self.meant, words))
        unknown = [word for word, known in zip(words, meant, strict=True) if not known]
        if len(unknown) == len(words):
            examples = ", ".join(self.words[len(SPECIALS) : len(SPECIALS) + 20])
            raise TextError(f"the model, for English, knows no word of {sentence!r}; it knows words such as {examples}")
        return np.array([self.ids[word or UNK] for word in meant], dtype=np.int64), unknown

    def decode(self, ids: Iterable[int]) -> str:
        """The sentence of ids (:meth:`TextRules.sentence`), without PAD, SOS, EOS and UNK."""
        return self.rules.sentence(self.words[i] if i >= len(SPECIALS) else "" for i in ids)
