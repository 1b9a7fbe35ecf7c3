"""What a model knows: the actions that it was trained on, and how well a sentence fits any of them."""

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
"""By which a log-probability may be above 0."""

NEAREST = 3
"""Known sentences that are named."""


@dataclass(frozen=True)
class FamiliaritySettings(Settings):
    """confident: the least confidence of a sentence that the model knows (docs/generate.md).

    doubt: the power by which the probability of the likeliest action counts: sentences share actions, so it is often
        low.
    """

    FEATURE: ClassVar[str] = "familiarity"
    confident: Annotated[float, Range(0, 1)] = 0.4
    doubt: Annotated[float, Range(0, 10)] = 0.25


@dataclass(frozen=True)
class Understood:
    """confidence: from 0 to 1: how much of what a sentence says is in known words, rare words counting more, times how
    sure it is which action is meant.

    nearest: sentences of the likeliest of these actions, the likeliest first. confident: whether the model knows what
    the sentence says.
    """

    confidence: float
    nearest: tuple[str, ...]
    confident: bool


@dataclass(frozen=True, eq=False)
class Known:
    """A actions. sentences: one of each. rare: how much a word says: the logarithm of how many actions there are for
    each of which it is said."""

    sentences: tuple[str, ...]
    rare: dict[str, float]
    rules: TextRules
    settings: FamiliaritySettings

    @staticmethod
    def read(manifest: Fields, count: int, rules: TextRules, settings: FamiliaritySettings) -> "Known":
        """The key "actions" of a manifest; BundleError where it is not one entry for each of ``count`` actions."""
        entries = manifest.list_of_fields("actions")
        if len(entries) != count:
            raise BundleError(f"manifest, actions: {len(entries)} entries, expected {count}")
        said = Counter(word for entry in entries for word in set(entry.texts("words")))
        rare = {word: math.log((1 + count) / times) for word, times in said.items()}
        return Known(tuple(entry.text("sentence") for entry in entries), rare, rules, settings)

    def understood(self, sentence: str, context: Floats) -> Understood:
        """What a sentence is taken for, by the log-probabilities (A,) of actions; BundleError where they are none."""
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
