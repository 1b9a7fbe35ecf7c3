"""Key poses: what the parts of the body do at a time."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

Span = tuple[float, float]
"""The lowest and the highest value of a number that each draw chooses anew; both are equal where it is fixed."""


@dataclass(frozen=True)
class HandKey:
    """Where a hand goes.

    place: a name of :data:`motet.keyed.parts.PLACES`, or :data:`motet.keyed.parts.OTHER_HAND`. out, up, forward: metres
    from there, seen from the bone of the place. elbow: degrees that it is raised to the side. palm, fingers: where the
    palm faces and the fingers point (:func:`motet.keyed.parts.direction`), "" for as the forearm has them. touch: the
    part of the hand that goes there (:data:`motet.keyed.parts.TOUCHES`).
    """

    place: str
    out: Span = (0.0, 0.0)
    up: Span = (0.0, 0.0)
    forward: Span = (0.0, 0.0)
    elbow: Span = (20.0, 20.0)
    palm: str = ""
    fingers: str = ""
    touch: str = "palm"


@dataclass(frozen=True)
class Key:
    """A key pose.

    at: seconds from the begin of the act. hold: seconds that it stays. numbers: part -> its numbers, such as "head" ->
    {"nod": ...} (:data:`motet.keyed.parts.PART_NUMBERS`). hands: "left_hand", "right_hand" -> where each goes.
    """

    at: Span
    hold: Span = (0.0, 0.0)
    numbers: Mapping[str, Mapping[str, Span]] = field(default_factory=dict)
    hands: Mapping[str, HandKey] = field(default_factory=dict)


@dataclass(frozen=True)
class Repeat:
    """The keys from ``first`` to ``last`` (counted from 0) come ``times`` times, each ``every`` seconds later."""

    first: int
    last: int
    every: Span
    times: tuple[int, int]

    def longer(self, seconds: float) -> "Repeat":
        """As often as takes some seconds more than at least."""
        times = self.times[0] + math.ceil(seconds / self.every[0])
        return replace(self, times=(times, times))


def held_longer(keys: tuple[Key, ...], seconds: float) -> tuple[Key, ...]:
    """Keys of which the one that is held longest, if any is held, stays some seconds longer, and those after it come
    as much later."""
    held = max(keys, key=lambda key: key.hold[1])
    if not held.hold[1]:
        return keys
    place = keys.index(held)
    later = [replace(key, at=_longer(key.at, seconds)) for key in keys[place + 1 :]]
    return (*keys[:place], replace(held, hold=_longer(held.hold, seconds)), *later)


def _longer(span: Span, seconds: float) -> Span:
    return span[0] + seconds, span[1] + seconds


def mirrored_keys(keys: Iterable[Key]) -> tuple[Key, ...]:
    """Keys with left and right exchanged."""
    swapped = []
    for key in keys:
        numbers = {}
        for part, values in key.numbers.items():
            numbers[_other_side(part)] = {
                name: _negated(span) if (part, name) in SIDED_NUMBERS else span for name, span in values.items()
            }
        hands = {_other_side(hand): where for hand, where in key.hands.items()}
        swapped.append(replace(key, numbers=numbers, hands=hands))
    return tuple(swapped)


SIDED_NUMBERS = {("head", "turn"), ("head", "tilt"), ("chest", "turn"), ("chest", "lean")} | {
    ("hips", "left"),
    ("hips", "turn"),
    ("hips", "lean"),
}
"""Numbers that are to a side."""


def _other_side(part: str) -> str:
    if part.startswith("left_"):
        return "right_" + part.removeprefix("left_")
    if part.startswith("right_"):
        return "left_" + part.removeprefix("right_")
    return part


def _negated(span: Span) -> Span:
    low, high = span
    return -high, -low
