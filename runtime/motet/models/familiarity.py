"""What a model knows: the actions in its training data, and how well a sentence fits them."""

import math
from collections import Counter
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from motet.bundle.fields import Fields
from motet.bundle.graph import Floats
from motet.errors import BundleError
from motet.models.text import TextRules
from motet.settings import Range, Settings

ROUNDING = 0.01
"""Most by which a log-probability may exceed 0."""

NEAREST = 3
"""Number of known sentences named."""


@dataclass(frozen=True)
class FamiliaritySettings(Settings):
    """confident: least confidence of a known sentence (docs/generate.md).

    doubt: exponent of the probability of the likeliest action, which is often low because sentences share actions.
    """

    FEATURE: ClassVar[str] = "familiarity"
    confident: Annotated[float, Range(0, 1)] = 0.4
    doubt: Annotated[float, Range(0, 10)] = 0.25


@dataclass(frozen=True)
class Understood:
    """confidence: from 0 to 1: the share of known words in a sentence, rare words counting more, times the certainty
    about the action meant.

    nearest: sentences of the likeliest actions, the likeliest first. confident: whether the model knows the sentence.
    """

    confidence: float
    nearest: tuple[str, ...]
    confident: bool


@dataclass(frozen=True, eq=False)
class Known:
    """A actions. sentences: one of each. rare: the weight of a word: the logarithm of the number of actions divided by
    the number that it describes."""

    sentences: tuple[str, ...]
    rare: dict[str, float]
    rules: TextRules
    settings: FamiliaritySettings

    @staticmethod
    def read(manifest: Fields, count: int, rules: TextRules, settings: FamiliaritySettings) -> "Known":
        """The key "actions" of a manifest; BundleError unless it has one entry for each of ``count`` actions."""
        entries = manifest.list_of_fields("actions")
        if len(entries) != count:
            raise BundleError(f"manifest, actions: {len(entries)} entries, expected {count}")
        said = Counter(word for entry in entries for word in set(entry.texts("words")))
        rare = {word: math.log((1 + count) / times) for word, times in said.items()}
        return Known(tuple(entry.text("sentence") for entry in entries), rare, rules, settings)

    def understood(self, sentence: str, context: Floats) -> Understood:
        """How a sentence is understood, by the log-probabilities (A,) of actions; BundleError for other numbers."""
        asked, unheard = set(self.rules.words(sentence)), math.log(1 + len(self.sentences))
        heard = sum(self.rare.get(word, 0.0) for word in asked)
        share = heard / (sum(self.rare.get(word, unheard) for word in asked) or 1.0)
        order = np.argsort(-context, kind="stable")
        nearest = dict.fromkeys(self.sentences[action] for action in order)
        likeliest = float(context[order[0]])
        if likeliest > ROUNDING:
            raise BundleError(f"graph encoder: its context holds {likeliest:g}, which is no log-probability")
        confidence = share * math.exp(likeliest) ** self.settings.doubt
        return Understood(confidence, tuple(nearest)[:NEAREST], confidence >= self.settings.confident)
