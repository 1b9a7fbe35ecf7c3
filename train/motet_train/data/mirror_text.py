"""Left-right mirroring of a sentence: the same, said of the mirrored motion."""

import re

from motet.models.language import RULES

PAIRS = {
    "left": "right",
    "lefts": "rights",
    "leftmost": "rightmost",
    "leftward": "rightward",
    "leftwards": "rightwards",
    "lefthanded": "righthanded",
    "leftfooted": "rightfooted",
    "clockwise": "counterclockwise",
}
OTHER = PAIRS | {right: left for left, right in PAIRS.items()} | {"anticlockwise": "clockwise"}

_WORDS = re.compile(rf"\b(?!right (?:angles?|angled|away)\b)({'|'.join(sorted(OTHER, key=len, reverse=True))})\b")


def mirror_text(sentence: str) -> str:
    """The sentence, normalised, with left and right, clockwise and counterclockwise exchanged.

    A right angle stays one. Twice mirrored gives the normalised sentence, but for "anticlockwise".
    """
    return _WORDS.sub(lambda match: OTHER[match[0]], RULES.normalise(sentence))
