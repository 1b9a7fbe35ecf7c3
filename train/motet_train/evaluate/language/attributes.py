"""Attributes of motions in sentences: walk, run or jump; left or right; turns. Small tables of English words."""

import re
from collections import Counter
from collections.abc import Sequence
from itertools import chain

import numpy as np

from motet_train.evaluate.language.split_store import plain
from motet_train.evaluate.tables import Figures

Patterns = dict[str, str]
"""Name of an attribute -> regular expression of the words that express it."""

VERBS: Patterns = {
    "walk": r"walk\w*|stroll\w*|strid\w*|on foot|(?:several|few|slow) steps|steps? forwards?",
    "run": r"run|runs|ran|running|runner\w*|jog\w*|sprint\w*",
    "jump": r"jump\w*|leap\w*|hop|hops|hopp\w*|springs?",
}
SIDE_SPELLINGS: Patterns = {
    "left": r"left(?:wards?|most|handed)?",
    "right": r"right(?:wards?|most|handed)?(?! (?:angles?|angled|away))",
}
TURN_PATTERNS: Patterns = {"turn": r"(?<!in )turn\w*|veer\w*|swerv\w*|curv\w*|corner|rotat\w*|spin\w*|dodg\w*|circle"}
DIRECTION_PATTERNS: Patterns = SIDE_SPELLINGS | {"backward": r"backwards?"}
ACTIONS: Patterns = VERBS | {
    "dance": r"danc\w*|ballet|arabesque|pirouette\w*",
    "kick or punch": r"kick\w*|punch\w*|karate|box\w*",
    "wave": r"wav(?:e|es|ing)",
    "wipe or mix": r"wip\w*|wash\w*|mop\w*|mix\w*|stir\w*",
    "climb": r"climb\w*",
    "sit": r"sit|sits|sitting|seat",
    "squat or kneel": r"squat\w*|kneel\w*|crouch\w*",
}


def mentioned(table: Patterns, *sentences: str) -> frozenset[str]:
    """The attributes that any of some sentences mentions, except words after "instead of" and "without"."""
    texts = [re.sub(r"(?:instead of|without) \w+", "", plain(sentence)) for sentence in sentences]
    attributes = set()
    for attribute, words in table.items():
        if any(re.search(rf"\b(?:{words})\b", text) for text in texts):
            attributes.add(attribute)
    return frozenset(attributes)


def side(sentence: str) -> frozenset[str]:
    """Left or right; empty if a sentence mentions both, as in "the left and the right foot in turn"."""
    sides = mentioned(SIDE_SPELLINGS, sentence)
    return sides if len(sides) == 1 else frozenset()


def turning(sentence: str) -> bool:
    """Whether a sentence about walking or running says that the path is not straight."""
    return bool(mentioned(TURN_PATTERNS, sentence) or side(sentence))


def common(attributes: Sequence[frozenset[str]]) -> frozenset[str]:
    """The attributes that at least half of a motion's sentences mention, by those of each sentence."""
    # how many sentences mention each attribute
    counts = Counter(chain.from_iterable(attributes))
    return frozenset(name for name, count in counts.items() if 2 * count >= len(attributes))


def common_verbs(sentences: Sequence[str]) -> frozenset[str]:
    """Walk, run, jump: those that half of the sentences agree on."""
    return common([mentioned(VERBS, sentence) for sentence in sentences])


def common_side(sentences: Sequence[str]) -> str | None:
    """The side that half of the sentences agree on, None unless it is a single one."""
    sides = common([side(sentence) for sentence in sentences])
    return next(iter(sides)) if len(sides) == 1 else None


def common_turning(sentences: Sequence[str]) -> bool | None:
    """Whether half of the sentences say that a walk or run turns; None for anything but walking and running."""
    # jumps and everything else have no path to speak of
    verbs = common_verbs(sentences)
    if not verbs or verbs - {"walk", "run"}:
        return None
    return 2 * sum(map(turning, sentences)) >= len(sentences)


def action_right(text: str, sentences: Sequence[str]) -> bool:
    """Whether a description mentions an action, and only actions that a reference sentence mentions."""
    actions = mentioned(ACTIONS, text)
    return bool(actions) and actions <= mentioned(ACTIONS, *sentences)


def words_right(hypotheses: Sequence[str], references: Sequence[Sequence[str]]) -> Figures:
    """The shares of hypotheses that are right, NaN without any, and their numbers with the suffix "_of".

    "verbs": a verb that people agree on is mentioned, and none that nobody mentioned. "sides": the side that people
    agree on is mentioned. "turns", for walking and running: the description agrees with people about turning.
    """
    right: dict[str, list[bool]] = {"verbs": [], "sides": [], "turns": []}
    for text, sentences in zip(hypotheses, references, strict=True):
        # each attribute counts only where people agree on it
        if agreed_verbs := common_verbs(sentences):
            verbs = mentioned(VERBS, text)
            right["verbs"].append(bool(verbs & agreed_verbs) and verbs <= mentioned(VERBS, *sentences))
        if agreed_side := common_side(sentences):
            right["sides"].append(side(text) == {agreed_side})
        if (agreed_turning := common_turning(sentences)) is not None:
            right["turns"].append(turning(text) == agreed_turning)
    shares = {key: sum(flags) / len(flags) if flags else np.nan for key, flags in right.items()}
    return shares | {f"{key}_of": float(len(flags)) for key, flags in right.items()}
