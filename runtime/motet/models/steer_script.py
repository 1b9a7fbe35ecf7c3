"""Scripts for steered figures: their orders, in words, one after the other.

``walk 3s speed 1.4, turn left 90, run 4s, walk backwards 2s, stop``. An order is a gait, ``turn`` or ``stop``,
followed in any order by a duration (``3s``; else SECONDS), a speed (``speed 1.4`` in m/s; else the gait's usual one),
a way (``backwards``, ``left``, ``right``, relative to the facing, which does not change), and an angle in degrees
to turn (``turn left 90``, or ``walk 3s turn right 45``). A turn alone keeps gait, speed and way.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from motet.errors import ScriptError
from motet.models.tdbn_script import MAX_SECONDS

SECONDS = {"turn": 1.5, "stop": 1.5}
"""Default seconds of an order; a gait takes 2."""

WAYS = {"forward": 0.0, "left": 90.0, "backwards": 180.0, "right": -90.0}
"""Degrees from the facing, positive to the left."""

_WORD = re.compile(r"[^\s,]+|,")
_SECONDS = re.compile(r"(\d+\.?\d*|\.\d+)s")
_NUMBER = re.compile(r"\d+\.?\d*|\.\d+")


@dataclass(frozen=True)
class Order:
    """gait: None for the previous one. speed: m/s, None for the gait's usual one, -1 for the previous one.

    way: of travel, in degrees from the facing, None for the previous one. turn: degrees to the left. caption: in words.
    """

    gait: str | None
    speed: float | None
    way: float | None
    turn: float
    seconds: float
    caption: str


def parse_orders(script: str, gaits: Sequence[str]) -> list[Order]:
    """Parse a script over known gaits; ScriptError marks the place of an error."""
    words = [(match[0], match.start()) for match in _WORD.finditer(script)]
    orders, start = list[Order](), 0
    for end in [i for i, (word, _) in enumerate(words) if word == ","] + [len(words)]:
        place = words[start][1] if start < len(words) else len(script)
        orders.append(_Order(script, words[start:end], place, gaits).parse())
        start = end + 1
    if sum(order.seconds for order in orders) > MAX_SECONDS:
        raise ScriptError(script, 0, f"a script lasts at most {MAX_SECONDS:g} s")
    return orders


def captions(orders: Sequence[Order]) -> list[tuple[float, str]]:
    """The start of each order, in seconds, and its words."""
    found, at = [], 0.0
    for order in orders:
        found.append((at, order.caption))
        at += order.seconds
    return found


class _Order:
    """The words of one order, with their places in the script."""

    def __init__(self, script: str, words: list[tuple[str, int]], place: int, gaits: Sequence[str]) -> None:
        self.script, self.words, self.place, self.gaits = script, words, place, gaits
        self.next = 0
        self.found: dict[str, float] = {}

    def fail(self, reason: str) -> ScriptError:
        at = self.words[self.next][1] if self.next < len(self.words) else self.place
        return ScriptError(self.script, at, reason)

    def word(self, wanted: str) -> str:
        if self.next == len(self.words):
            self.place = self.words[-1][1] if self.words else self.place
            raise self.fail(f"expected {wanted} after this")
        return self.words[self.next][0]

    def number(self, wanted: str) -> float:
        word = self.word(wanted)
        if not _NUMBER.fullmatch(word):
            raise self.fail(f"expected {wanted}, such as 1.4 or 90")
        self.next += 1
        return float(word)

    def parse(self) -> Order:
        if not self.words:
            raise self.fail(f"expected an order here: {', '.join(self.gaits)}, turn or stop")
        kind, _ = self.words[0]
        if kind not in (*self.gaits, "turn", "stop"):
            raise self.fail(f"unknown order {kind!r}; expected one of {', '.join(self.gaits)}, turn, stop")
        self.next = 0 if kind == "turn" else 1
        while self.next < len(self.words):
            self._detail()
        caption = " ".join(word for word, _ in self.words)
        seconds = self.found.get("seconds", SECONDS.get(kind, 2.0))
        turn = self.found.get("turn", 0.0)
        if kind == "stop":
            return Order(None, 0.0, None, turn, seconds, caption)
        if kind == "turn":
            return Order(None, self.found.get("speed", -1.0), self.found.get("way"), turn, seconds, caption)
        return Order(kind, self.found.get("speed"), self.found.get("way", 0.0), turn, seconds, caption)

    def _detail(self) -> None:
        word = self.word("more")
        seconds = _SECONDS.fullmatch(word)
        if seconds:
            self._put("seconds", float(seconds[1]))
            self.next += 1
        elif word in WAYS:
            self._put("way", WAYS[word])
            self.next += 1
        elif word == "speed":
            self.next += 1
            self._put("speed", self.number("metres a second"))
        elif word == "turn":
            self._turn()
        else:
            raise self.fail('expected seconds such as "3s", "speed 1.4", "turn left 90", or a way such as "backwards"')

    def _turn(self) -> None:
        self.next += 1
        side = self.word("left or right")
        if side not in ("left", "right"):
            raise self.fail("expected left or right")
        self.next += 1
        degrees = self.number("degrees")
        self._put("turn", degrees if side == "left" else -degrees)

    def _put(self, name: str, value: float) -> None:
        if name in self.found:
            raise self.fail(f"this order gives its {name} twice")
        self.found[name] = value
