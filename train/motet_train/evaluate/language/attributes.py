"""What a sentence says of a motion: walk, run or jump; left or right; whether it turns. Small tables of English."""

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from motet_train.evaluate.language.split_store import plain

if TYPE_CHECKING:
    from motet_train.evaluate.language.bleu import References  # whose package training does without

Patterns = dict[str, str]
"""Name of an attribute -> regular expression of the words that say it."""

VERBS: Patterns = {
    "walk": r"walk\w*|stroll\w*|strid\w*|on foot|(?:several|few|slow) steps|steps? forwards?",
    "run": r"run|runs|ran|running|runner\w*|jog\w*|sprint\w*",
    "jump": r"jump\w*|leap\w*|hop|hops|hopp\w*|springs?",
}
SIDES: Patterns = {
    "left": r"left(?:wards?|most|handed)?",
    "right": r"right(?:wards?|most|handed)?(?! (?:angles?|angled|away))",
}
TURN_WORDS: Patterns = {"turn": r"(?<!in )turn\w*|veer\w*|swerv\w*|curv\w*|corner|rotat\w*|spin\w*|dodg\w*|circle"}
DIRECTIONS: Patterns = SIDES | {"backward": r"backwards?"}
ACTIONS: Patterns = VERBS | {
    "dance": r"danc\w*|ballet|arabesque|pirouette\w*",
    "kick or punch": r"kick\w*|punch\w*|karate|box\w*",
    "wave": r"wav(?:e|es|ing)",
    "wipe or mix": r"wip\w*|wash\w*|mop\w*|mix\w*|stir\w*",
    "climb": r"climb\w*",
    "sit": r"sit|sits|sitting|seat",
    "squat or kneel": r"squat\w*|kneel\w*|crouch\w*",
}

_DENIED = re.compile(r"(?:instead of|without) \w+")

Score = tuple[int, int]
"""How many are right, out of how many."""


def said(table: Patterns, sentence: str) -> frozenset[str]:
    """The attributes that a sentence names."""
    text = _DENIED.sub("", plain(sentence))
    return frozenset(name for name, pattern in table.items() if re.search(rf"\b(?:{pattern})\b", text))


def side(sentence: str) -> frozenset[str]:
    """Left or right; nothing where a sentence names both, as with "the left and the right foot in turn"."""
    found = said(SIDES, sentence)
    return found if len(found) == 1 else frozenset()


def common(found: Sequence[frozenset[str]]) -> frozenset[str]:
    """The attributes that at least half of a motion's sentences name."""
    return frozenset(name for name in frozenset().union(*found) if 2 * sum(name in one for one in found) >= len(found))


def turning(sentence: str) -> bool:
    """Whether a sentence about walking or running says that the path is not straight."""
    return bool(said(TURN_WORDS, sentence) or side(sentence))


def common_verbs(sentences: Sequence[str]) -> frozenset[str]:
    """Walk, run, jump: what half of the sentences agree on."""
    return common([said(VERBS, sentence) for sentence in sentences])


def common_side(sentences: Sequence[str]) -> str | None:
    """The one side that half of the sentences agree on."""
    found = common([side(sentence) for sentence in sentences])
    return next(iter(found)) if len(found) == 1 else None


def turns(sentences: Sequence[str]) -> bool | None:
    """Whether half of the sentences say that a walk or run turns; None for anything but walking and running."""
    verbs = common_verbs(sentences)
    if not verbs or verbs - {"walk", "run"}:
        return None
    return 2 * sum(map(turning, sentences)) >= len(sentences)


def verbs_right(hypotheses: Sequence[str], references: "References") -> Score:
    """A hypothesis is right if it names a verb people agree on, and none that nobody named."""
    found = []
    for text, sentences in zip(hypotheses, references, strict=True):
        agreed, anyone = common_verbs(sentences), frozenset().union(*(said(VERBS, sentence) for sentence in sentences))
        if agreed:
            named = said(VERBS, text)
            found.append(bool(named & agreed) and named <= anyone)
    return sum(found), len(found)


def sides_right(hypotheses: Sequence[str], references: "References") -> Score:
    """A hypothesis is right if it names the one side people agree on, not if it names none or both."""
    sides = [(side(text), common_side(sentences)) for text, sentences in zip(hypotheses, references, strict=True)]
    found = [named == {agreed} for named, agreed in sides if agreed]
    return sum(found), len(found)


def action_right(text: str, sentences: Sequence[str]) -> bool:
    """Whether a sentence about a motion names an action, and none that nobody named."""
    named = said(ACTIONS, text)
    return bool(named) and named <= frozenset().union(*(said(ACTIONS, sentence) for sentence in sentences))


def turns_right(hypotheses: Sequence[str], references: "References") -> Score:
    """Of walking and running: a hypothesis is right if it says about turning what people agree on."""
    pairs = [(turning(text), turns(sentences)) for text, sentences in zip(hypotheses, references, strict=True)]
    found = [named == agreed for named, agreed in pairs if agreed is not None]
    return sum(found), len(found)
