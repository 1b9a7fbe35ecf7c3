"""Bare commands, such as "walk" or "sit down", and the plain act that each means: docs/reference/bundle.md, "Bare
commands"."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.errors import BundleError
from motet.text.clauses import POLITE_WORDS, stem
from motet.text.vocabulary import TextRules

Key = frozenset[str]
"""The stems of a command's words, without those that say nothing."""


@dataclass(frozen=True)
class Command:
    """A plain act."""

    sentence: str
    """It as a sentence."""

    action: int
    """The known action that the writer continues it as."""

    texts: frozenset[Key]
    """Commands that mean it."""

    instead: frozenset[Key]
    """Commands for acts that nobody recorded, for which it is shown with a warning."""

    words: tuple[str, ...]
    """All words that it does not leave out: those of its texts, and polite ones."""


@dataclass(frozen=True)
class Commands:
    """The commands of a bundle. Command i is the action ``first + i`` of the memory and of contexts."""

    rules: TextRules
    first: int
    acts: Sequence[Command]
    numbers: Mapping[Key, int]
    """The number of the act of each command."""

    verbs: frozenset[str]
    """The stems of the words that commands begin with."""

    meant: Callable[[str], str] = str
    """The known word that a word is, or of which it is a misspelling; "" where there is none."""

    @staticmethod
    def of(entries: Sequence[Fields], rules: TextRules, actions: int, meant: Callable[[str], str] = str) -> "Commands":
        """Those of a manifest. actions: how many known actions there are; the number after them stands for none.
        BundleError for an action that is not there, and for a command that means two acts."""
        acts: list[Command] = []
        numbers: dict[Key, int] = {}
        verbs: set[str] = set()
        for number, entry in enumerate(entries):
            texts = entry.texts("texts")
            instead = entry.texts("instead")
            for text in [*texts, *instead]:
                key = key_of(rules.words(text))
                if numbers.setdefault(key, number) != number or not key:
                    raise BundleError(f"manifest, commands: {text!r} does not mean one act")
            verbs.update(stem(rules.words(text)[0]) for text in texts)
            acts.append(_command(entry, rules, actions))
        return Commands(rules, actions + 1, acts, numbers, frozenset(verbs), meant)

    @property
    def written(self) -> NDArray[np.int64]:
        """For each action, none, and each command the action that the writer knows it as."""
        return np.array([*range(self.first), *(command.action for command in self.acts)])

    def act(self, text: str) -> int | None:
        """The action of the command that a text is; None if it is none."""
        key = self._key(text)
        return self.action(key) if key in self.numbers else None

    def _key(self, text: str) -> Key:
        """The key of a text; of what it means, if it is misspelt."""
        words = self.rules.words(text)
        key = key_of(words)
        return key if key in self.numbers else key_of(self.meant(word) or word for word in words)

    def action(self, key: Key) -> int:
        """The action of a command."""
        return self.first + self.numbers[key]

    def is_instead(self, text: str) -> bool:
        """Whether a text is a command for an act that nobody recorded."""
        key = self._key(text)
        return key in self.numbers and key in self._act(key).instead

    def nearest(self, text: str) -> Key | None:
        """The longest command in a text that begins with a command's verb; None without one."""
        words = self.rules.words(text)
        first = stem(words[0]) if words else ""
        if first not in self.verbs:
            return None
        key = key_of(words)
        inside = (known for known in self.numbers if first in known <= key and known not in self._act(known).instead)
        return max(inside, key=lambda known: (len(known), sorted(known)), default=None)

    def _act(self, key: Key) -> Command:
        return self.acts[self.numbers[key]]


def _command(entry: Fields, rules: TextRules, actions: int) -> Command:
    texts = [rules.words(text) for text in entry.texts("texts")]
    instead = [rules.words(text) for text in entry.texts("instead")]
    return Command(
        entry.text("sentence"),
        entry.whole("action", 0, actions - 1),
        frozenset(map(key_of, texts)),
        frozenset(map(key_of, instead)),
        (*sorted(POLITE_WORDS), *chain.from_iterable(texts)),
    )


def key_of(words: Iterable[str]) -> Key:
    """The stems of words without :data:`motet.text.clauses.POLITE_WORDS`."""
    return frozenset(stem(word) for word in words if word not in POLITE_WORDS)
