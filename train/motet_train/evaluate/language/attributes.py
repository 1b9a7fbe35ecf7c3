"""What a sentence says of a motion: walk, run or jump; left or right; whether it turns. Small tables of English."""

import re
from collections.abc import Sequence

import numpy as np

from motet_train.evaluate.language.split_store import plain

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
TURNS: Patterns = {"turn": r"(?<!in )turn\w*|veer\w*|swerv\w*|curv\w*|corner|rotat\w*|spin\w*|dodg\w*|circle"}
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


def said(table: Patterns, *sentences: str) -> frozenset[str]:
    """The attributes that any of some sentences names, but for words after "instead of" and "without"."""
    texts = [re.sub(r"(?:instead of|without) \w+", "", plain(sentence)) for sentence in sentences]
    return frozenset(key for key, words in table.items() for text in texts if re.search(rf"\b(?:{words})\b", text))


def side(sentence: str) -> frozenset[str]:
    """Left or right; nothing where a sentence names both, as with "the left and the right foot in turn"."""
    found = said(SIDES, sentence)
    return found if len(found) == 1 else frozenset()


def turning(sentence: str) -> bool:
    """Whether a sentence about walking or running says that the path is not straight."""
    return bool(said(TURNS, sentence) or side(sentence))


def common(found: Sequence[frozenset[str]]) -> frozenset[str]:
    """The attributes that at least half of a motion's sentences name."""
    return frozenset(name for name in frozenset().union(*found) if 2 * sum(name in one for one in found) >= len(found))


def common_verbs(sentences: Sequence[str]) -> frozenset[str]:
    """Walk, run, jump: what half of the sentences agree on."""
    return common([said(VERBS, sentence) for sentence in sentences])


def common_side(sentences: Sequence[str]) -> str | None:
    """The one side that half of the sentences agree on."""
    found = common([side(sentence) for sentence in sentences])
    return next(iter(found)) if len(found) == 1 else None


def common_turning(sentences: Sequence[str]) -> bool | None:
    """Whether half of the sentences say that a walk or run turns; None for anything but walking and running."""
    verbs = common_verbs(sentences)
    if not verbs or verbs - {"walk", "run"}:
        return None
    return 2 * sum(map(turning, sentences)) >= len(sentences)


def action_right(text: str, sentences: Sequence[str]) -> bool:
    """Whether a sentence about a motion names an action, and none that nobody named."""
    named = said(ACTIONS, text)
    return bool(named) and named <= said(ACTIONS, *sentences)


def words_right(hypotheses: Sequence[str], references: Sequence[Sequence[str]]) -> dict[str, float]:
    """The shares of hypotheses that are right, NaN of none; and of how many, "_of".

    "verbs": a verb is named that people agree on, and none that nobody named. "sides": the one side is named that
    people agree on. "turns", of walking and running: what people agree on is said about turning.
    """
    found: dict[str, list[bool]] = {"verbs": [], "sides": [], "turns": []}
    for text, sentences in zip(hypotheses, references, strict=True):
        if verbs := common_verbs(sentences):
            named = said(VERBS, text)
            found["verbs"].append(bool(named & verbs) and named <= said(VERBS, *sentences))
        if agreed := common_side(sentences):
            found["sides"].append(side(text) == {agreed})
        if (turns := common_turning(sentences)) is not None:
            found["turns"].append(turning(text) == turns)
    shares = {key: sum(right) / len(right) if right else np.nan for key, right in found.items()}
    return shares | {f"{key}_of": float(len(right)) for key, right in found.items()}
