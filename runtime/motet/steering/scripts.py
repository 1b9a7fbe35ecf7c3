"""Scripts: what a figure does, and for how long; the parts follow each other, separated by commas.

Orders in words: ``walk 3s speed 1.4, turn left 90, run 4s, walk backwards 2s, stop``. An order is a
gait, ``turn`` or ``stop``, followed in any order by a duration (``3s``; else 2 s, or 1.5 s of a turn or stop), a speed
(``speed 1.4`` in m/s; else the gait's usual one), a way (``backwards``, ``left``, ``right``, relative to the facing,
which does not change), an angle in degrees to turn (``turn left 90``, or ``walk 3s turn right 45``), and a style
(``style limping``, at its own pace where no speed is given; else a gait is as recorded). A turn alone keeps gait,
speed, way and style. ``act 'wave'`` is a sentence of what to do beside that, with a duration after it or 3 s;
``act jump`` is a gait that goes nowhere, done once.
``go to 2 -3.5`` goes to x and z in metres and stands there, facing as it comes or ``facing 90``; with a speed, or the
gait's usual one, until the next order, after its duration or 5 s.
"""

import re
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from motet.errors import ScriptError
from motet.models.control import LONGEST_SCRIPT
from motet.steering.styles import NO_STYLE, STYLE_NAMES

OTHER_VERBS = ("turn", "stop", "act", "go")  # orders besides gaits
WAY_ANGLES = {"forward": 0.0, "left": 90.0, "backwards": 180.0, "right": -90.0}  # degrees from the facing to the left
USUAL = {"turn": (None, None, 1.5, None), "stop": (None, None, 1.5, None)}  # gait, way, seconds and style of others
NUMBER = r"\d+\.?\d*|\.\d+"
SIGNED = f"-?({NUMBER})"


@dataclass(frozen=True)
class Order:
    """A part of a script."""

    gait: str | None
    """None for the previous one."""
    speed: float | None
    """m/s, None for the gait's usual one, -1 for the previous one."""
    way: float | None
    """Direction of travel, in degrees from the facing, None for the previous one."""
    turn: float
    """Degrees to the left."""
    seconds: float
    caption: str
    """The order in words."""
    act: str | None = None
    """A sentence to act, beside what was ordered before."""
    goal: tuple[float, float] | None = None
    """x and z in metres to go to."""
    facing: float | None = None
    """The facing there, in degrees, None for any."""
    style: str | None = None
    """None for the previous one."""


def parse_orders(script: str, gaits: Sequence[str]) -> list[Order]:
    """Parse a script of orders over known gaits; ScriptError marks the place of an error."""
    orders = list[Order]()
    words = list[tuple[str, int]]()
    tokens = [(match[0], match.start()) for match in re.finditer(r"[^\s,]+|,", script)]
    for word, place in [*tokens, (",", len(script))]:
        if word != ",":
            words.append((word, place))
            continue
        if not words:
            raise ScriptError(script, place, f"expected an order here: {', '.join(gaits)}, {', '.join(OTHER_VERBS)}")
        orders.append(_Words(script, words).order(gaits))
        words = []
    if sum(order.seconds for order in orders) > LONGEST_SCRIPT:
        raise ScriptError(script, 0, f"a script lasts at most {LONGEST_SCRIPT:g} s")
    return orders


class _Words:
    """The words of one order with their places, taken one after the other."""

    def __init__(self, script: str, words: Sequence[tuple[str, int]]) -> None:
        self.script = script
        self.left = deque(words)
        self.place = 0
        self.caption = " ".join(word for word, _ in words)

    def order(self, gaits: Sequence[str]) -> Order:
        kind = self.take("an order")
        if kind == "act":
            return self.act()
        if kind == "go":
            return self.go()
        if kind not in (*gaits, *OTHER_VERBS):
            raise self.fail(f"unknown order {kind!r}; expected one of {', '.join((*gaits, *OTHER_VERBS))}")
        details = self.details(self.turn() if kind == "turn" else {})
        # what an order does not say has the usual value; a turn or a stop keeps the gait, the way and the style
        gait, way, seconds, style = USUAL.get(kind, (kind, 0.0, 2.0, NO_STYLE))
        speed = details.get("speed", -1.0 if kind == "turn" else None)
        return Order(
            gait,
            0.0 if kind == "stop" else speed,
            way if kind == "stop" else details.get("way", way),
            details.get("turn", 0.0),
            details.get("seconds", seconds),
            self.caption,
            style=details.get("style", style),
        )

    def act(self) -> Order:
        words = [self.take("what to do, such as 'wave'"), *(word for word, _ in self.left)]
        last = re.fullmatch(f"({NUMBER})s", words[-1])
        sentence = " ".join(words[:-1] if last else words).strip("'\"")
        if not sentence:
            raise self.fail("expected what to do, such as act 'wave'")
        seconds = float(last[1]) if last else 3.0
        return Order(None, -1.0, None, 0.0, seconds, sentence, act=sentence)

    def go(self) -> Order:
        if self.take("to") != "to":
            raise self.fail("expected to, such as go to 2 3.5")
        goal = self.number("x in metres", SIGNED), self.number("z in metres", SIGNED)
        details = dict[str, Any]()
        while self.left:
            if self.left[0][0] == "facing":
                self.take("facing")
                more = {"facing": self.number("degrees", SIGNED)}
            else:
                more = self.detail()
            if more.keys() & (details.keys() | {"turn", "way", "style"}):
                raise self.fail("go to takes seconds, speed and facing, each once")
            details |= more
        seconds = details.get("seconds", 5.0)
        facing = details.get("facing")
        return Order(None, details.get("speed"), None, 0.0, seconds, self.caption, goal=goal, facing=facing)

    def details(self, details: dict[str, Any]) -> dict[str, Any]:
        """All details of the order, with those that are known."""
        while self.left:
            detail = self.detail()
            for name in detail.keys() & details.keys():
                raise self.fail(f"this order gives its {name} twice")
            details |= detail
        return details

    def detail(self) -> dict[str, Any]:
        word = self.take("more")
        if re.fullmatch(f"({NUMBER})s", word):
            return {"seconds": float(word[:-1])}
        if word in WAY_ANGLES:
            return {"way": WAY_ANGLES[word]}
        if word == "speed":
            return {"speed": self.number("metres a second")}
        if word == "turn":
            return self.turn()
        if word == "style":
            return {"style": self.style()}
        raise self.fail(
            'expected seconds such as "3s", "speed 1.4", "turn left 90", "style limping", or a way such as "backwards"'
        )

    def style(self) -> str:
        name = self.take("a style")
        if name not in STYLE_NAMES:
            raise self.fail(f"unknown style {name!r}; expected one of {', '.join(STYLE_NAMES)}")
        return name

    def turn(self) -> dict[str, float]:
        side = self.take("left or right")
        if side not in ("left", "right"):
            raise self.fail("expected left or right")
        degrees = self.number("degrees")
        return {"turn": degrees if side == "left" else -degrees}

    def number(self, wanted: str, pattern: str = NUMBER) -> float:
        word = self.take(wanted)
        if not re.fullmatch(pattern, word):
            raise self.fail(f"expected {wanted}, such as 1.4 or 90")
        return float(word)

    def take(self, wanted: str) -> str:
        if not self.left:
            raise self.fail(f"expected {wanted} after this")
        word, self.place = self.left.popleft()
        return word

    def fail(self, reason: str) -> ScriptError:
        return ScriptError(self.script, self.place, reason)
