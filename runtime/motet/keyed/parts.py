"""The parts of a key pose: which numbers each takes, in which ranges, and the places on the body that hands go to.

Letters in shapes: T frames. The body's axes are those of the humanoid: x to its left, y up, z forward.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from motet.motion.rotations import Array, unit
from motet.settings import Range

DEGREES = "degrees"
LENGTH_UNIT = "m"


def _degrees(low: float, high: float) -> Range:
    return Range(low, high, DEGREES)


def _metres(low: float, high: float) -> Range:
    return Range(low, high, LENGTH_UNIT)


_FOOT = {
    "out": _metres(-0.5, 0.8),
    "up": _metres(0, 1.2),
    "forward": _metres(-1, 1),
    "turn": _degrees(-60, 90),
    "point": _degrees(-60, 80),
}

PART_NUMBERS: Mapping[str, Mapping[str, Range]] = {
    "head": {"nod": _degrees(-60, 60), "turn": _degrees(-85, 85), "tilt": _degrees(-45, 45)},
    "chest": {"bend": _degrees(-40, 100), "turn": _degrees(-70, 70), "lean": _degrees(-45, 45)},
    "hips": {
        "down": _metres(-0.8, 0.8),
        "forward": _metres(-0.8, 0.8),
        "left": _metres(-0.8, 0.8),
        "bend": _degrees(-90, 90),
        "turn": _degrees(-180, 180),
        "lean": _degrees(-60, 60),
    },
    "shoulders": {"up": _degrees(-10, 30)},
    "left_foot": _FOOT,
    "right_foot": _FOOT,
}
"""Part -> its numbers, each a difference from the base; a foot's are seen from its own side."""

HAND: Mapping[str, Range] = {
    "out": _metres(-1, 1),
    "up": _metres(-1, 2.5),
    "forward": _metres(-1, 1),
    "elbow": _degrees(-30, 150),
}
"""The numbers of a hand: how far from the place that it goes to, away from the middle, up and forward, and how far the
elbow is raised to the side from hanging down."""

HAND_PARTS = ("left_hand", "right_hand")

SIDE_OF_HAND: Mapping[str, float] = {"left_hand": 1.0, "right_hand": -1.0}
"""The sign of x on a hand's side."""

TOUCHES: Mapping[str, float] = {"wrist": 0.0, "palm": 0.09, "fingers": 0.17}
"""Part of a hand that is brought to a place -> metres from the wrist."""

DIRECTION_WORDS: Mapping[str, tuple[float, float, float]] = {
    "out": (1, 0, 0),
    "in": (-1, 0, 0),
    "up": (0, 1, 0),
    "down": (0, -1, 0),
    "forward": (0, 0, 1),
    "back": (0, 0, -1),
}
"""Word -> direction seen from the left side of the upper chest; several words are added up."""


class Place(NamedTuple):
    """A place on the body: a bone, without its side if it is one of two, and where the place of the left side is in the
    bone's frame, in metres."""

    bone: str
    x: float
    y: float
    z: float
    sided: bool = False
    """Whether the bone is one of two, that of the hand's side."""


PLACES: Mapping[str, Place] = {
    "top of head": Place("head", 0.02, 0.17, 0.0),
    "back of head": Place("head", 0.04, 0.08, -0.11),
    "forehead": Place("head", 0.03, 0.11, 0.12),
    "temple": Place("head", 0.09, 0.10, 0.07),
    "eye": Place("head", 0.04, 0.08, 0.12),
    "ear": Place("head", 0.10, 0.06, 0.01),
    "nose": Place("head", 0.01, 0.05, 0.14),
    "cheek": Place("head", 0.07, 0.03, 0.09),
    "mouth": Place("head", 0.02, 0.02, 0.13),
    "chin": Place("head", 0.02, -0.01, 0.12),
    "throat": Place("neck", 0.02, 0.03, 0.09),
    "shoulder": Place("upperChest", 0.17, 0.12, 0.05),
    "other shoulder": Place("upperChest", -0.17, 0.11, 0.07),
    "other arm": Place("upperChest", -0.20, -0.12, 0.10),
    "chest": Place("upperChest", 0.04, 0.02, 0.15),
    "belly": Place("spine", 0.04, 0.03, 0.15),
    "back": Place("spine", 0.05, 0.02, -0.15),
    "hip": Place("hips", 0.18, 0.02, 0.02),
    "pocket": Place("hips", 0.19, -0.10, 0.04),
    "thigh": Place("UpperLeg", 0.02, -0.25, 0.10, sided=True),
    "knee": Place("LowerLeg", 0.0, 0.0, 0.08, sided=True),
    "foot": Place("Foot", 0.0, -0.03, 0.10, sided=True),
    "beside": Place("hips", 0.30, -0.12, 0.05),
    "desk": Place("hips", 0.14, 0.16, 0.40),
    "front": Place("upperChest", 0.12, -0.16, 0.34),
    "ahead": Place("upperChest", 0.16, 0.09, 0.55),
    "side": Place("upperChest", 0.66, 0.09, 0.05),
    "above": Place("upperChest", 0.22, 0.58, 0.06),
}
"""Place by name, of the left hand's side; all but those beside and before the body are on its surface."""

OTHER_HAND = "other hand"
"""The palm of the other hand is a place, too."""

FLOOR = "floor"
"""And so is the floor under the hips of the base, whatever the act does with them; its axes are those of the facing."""


def direction(words: str, side: float) -> Array:
    """The unit vector (3,) of words such as "forward down", seen from the upper chest, of a hand with this sign of x.
    KeyError for another word; a zero vector where they cancel out."""
    total = np.zeros(3)
    for word in words.split():
        total += DIRECTION_WORDS[word]
    return unit(total * [side, 1.0, 1.0])
