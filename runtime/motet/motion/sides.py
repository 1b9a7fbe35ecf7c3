"""Left and right from names: which joints mirror each other."""

import re
from collections.abc import Iterator, Sequence

LEFT, MIDDLE, RIGHT = "left", "middle", "right"

OTHER_SIDE = {"l": "r", "L": "R", "r": "l", "R": "L", "left": "right", "Left": "Right", "LEFT": "RIGHT"}
OTHER_SIDE |= {right: left for left, right in OTHER_SIDE.items()}

PATTERNS = (
    r"left|Left|LEFT|right|Right|RIGHT",  # LeftArm, arm_left, mixamorig:RightHand
    r"(?<![A-Za-z])[lLrR](?![A-Za-z])",  # L_Arm, arm.R, "Bip01 L Thigh"
    r"^[lr](?=[A-Za-z])|^[LR](?=[A-Z])",  # lfemur, RThigh
    r"(?<=[a-z])[LR]$",  # armL
)


def partners_of(names: Sequence[str]) -> tuple[int, ...]:
    """For each name the index of its partner on the other side, or its own if there is none."""
    return tuple(partner for partner, _ in _found(names))


def sides_of(names: Sequence[str]) -> tuple[str, ...]:
    """:data:`LEFT`, :data:`RIGHT` or :data:`MIDDLE` for each name; one without a partner is in the middle."""
    return tuple(side for _, side in _found(names))


def _found(names: Sequence[str]) -> Iterator[tuple[int, str]]:
    places = {name: index for index, name in enumerate(names)}
    for index, name in enumerate(names):
        partners = ((places[other], side) for other, side in _other_names(name) if other in places)
        yield next(partners, (index, MIDDLE))


def _other_names(name: str) -> Iterator[tuple[str, str]]:
    """Possible names of the partner, each with the side that ``name`` is then on."""
    for pattern in PATTERNS:
        for match in re.finditer(pattern, name):
            side = LEFT if match[0][0] in "lL" else RIGHT
            yield name[: match.start()] + OTHER_SIDE[match[0]] + name[match.end() :], side
