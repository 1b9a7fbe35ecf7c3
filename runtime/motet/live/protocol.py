"""Messages between the server of live figures and its clients, JSON objects with a "type".

docs/reference/live-protocol.md describes them for authors of clients.

A client tells; the server gives frames. Quaternions are (x, y, z, w); metres; y is up, a figure faces z at 0 degrees
and x at 90.
"""

import json
import re
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import ControlError, ControlWarning, MotetError, TextError, TextWarning, collected, each_once, quoted
from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT
from motet.files import Json
from motet.settings import checked_int
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.sentence_acts import SaidActs
from motet.steering.targets import LARGEST_COMMAND

LOCAL = re.compile(r"https?://(localhost|127\.0\.0\.1|\[::1\])(:\d+)?")
"""Origins of web pages that may connect, next to programs, which have none."""

CLIENT_FIGURES = 16
"""Of a client."""

KEYS = {
    "control": ("gait", "speed", "direction", "facing", "velocity", "style"),
    "start": ("characters", "gait", "places", "hold_feet", "positions"),
    "put": ("places",),
    "push": ("velocity",),
    "go_to": ("points", "facing", "gait", "speed"),
    "look_at": ("points",),
    "reach": ("hand", "points"),
    "act": ("motion", "upper"),
    "say": ("text", "here"),
}
"""Type of a client's message -> what may stand in it."""

NUMBER_FIELDS = ("speed", "direction", "facing", "velocity", "places", "points", "here")
"""What may stand in a message as numbers, or lists of them."""

REQUIRED_FIELDS = {"put": "places", "push": "velocity", "reach": "hand", "say": "text"}
"""What a message needs."""


class ProtocolError(MotetError, ValueError):
    """A message that is not one of the protocol."""


class ClientSession:
    """The characters of one client. words: makes the acts that it tells in sentences. heard: how many of its messages
    they have obeyed. ticks: since they started."""

    def __init__(self, model: SteerModel, characters: int = 1, words: SaidActs | None = None) -> None:
        self.model = model
        self.words = words
        self.heard = 0
        self._start({"characters": characters})

    def handle(self, text: str | bytes) -> list[str]:
        """Obey a message; what is to be said of it, such as a speed that was brought into its gait's range.

        ProtocolError or ControlError for one that cannot be obeyed; nothing has changed then.
        """
        kind, arguments = parsed(text)
        with collected(ControlWarning, TextWarning) as notes:
            unknown = self._obey(kind, arguments)
        self.heard += 1
        return [*unknown, *each_once(notes)]

    def _obey(self, kind: str, arguments: Json) -> list[str]:
        """Do what a message says; why an act is not known, and what is answered to a sentence."""
        if kind == "start":
            self._start(arguments)
        elif kind == "act":
            try:
                self.session.act(arguments.pop("motion", None), **arguments)
            except TextError as error:
                return [str(error)]
        elif kind == "say":
            return [self.session.say(**arguments).caption]
        else:
            nowhere = {"points": None} if "points" in KEYS[kind] else {}
            getattr(self.session, kind)(**{**nowhere, **arguments})
        return []

    def _start(self, arguments: Json) -> None:
        characters = arguments.pop("characters", 1)
        positions = arguments.pop("positions", False)
        checked_int("characters", characters, 1, CLIENT_FIGURES, ControlError)
        self.session = self.model.start(
            arguments.pop("gait", None), characters=characters, words=self.words, **arguments
        )
        self.positions = positions
        self.ticks = 0

    def tick(self) -> Pose:
        """The next pose."""
        self.ticks += 1
        return self.session.tick()

    def frame(self, pose: Pose) -> str:
        """The message that gives a pose: hundredths of millimetres, thousandths of degrees."""
        # what a client is told of each figure
        parts: dict[str, NDArray[Any]] = {
            "position": pose.place,
            "rotation": pose.heading,
            "height": pose.height,
            "rotations": pose.rotations,
            "contacts": pose.contacts,
            **({"positions": pose.positions()} if self.positions else {}),
        }
        characters = []
        columns = [np.round(values.astype(np.float64), 5).tolist() for values in parts.values()]
        for values in zip(*columns, strict=True):
            characters.append(dict(zip(parts, values, strict=True)))
        # when, and what has happened
        time = round(self.ticks / self.model.fps, 5)
        events = [[event.kind, event.character, *([event.name] if event.name else [])] for event in pose.events]
        happened = {"events": events} if events else {}
        return message("frame", tick=self.ticks, time=time, heard=self.heard, characters=characters, **happened)


def hello(model: SteerModel) -> str:
    """The first message: gaits with their speeds in m/s (lowest, usual, highest), styles, the rate, and the figure."""
    speeds = {gait: [low, model.usual[gait], high] for gait, (low, high) in model.speeds.items()}
    return message(
        "hello", fps=model.fps, gaits=speeds, styles=list(model.styles), bones=list(BONES), joints=HUMANOID.outline()
    )


def message(kind: str, **fields: Any) -> str:
    """A message to a client, as JSON that is as short as it can be."""
    return json.dumps({"type": kind, **fields}, separators=(",", ":"), allow_nan=False)


def from_json(text: str | bytes) -> Any:
    """The value of JSON, without infinite numbers; ValueError for what is none."""

    def refuse(constant: str) -> None:
        raise ValueError(f"{constant} is no number")

    try:
        return json.loads(text, parse_constant=refuse)
    except RecursionError as fault:
        raise ValueError(fault) from fault


def parsed(text: str | bytes) -> tuple[str, Json]:
    """The type of a client's message and what it says, without what is null; ProtocolError for one that is none."""
    # a JSON object of a known type
    if not isinstance(text, str):
        raise ProtocolError("messages must be text, not binary")
    try:
        document = from_json(text)
    except ValueError as fault:
        raise ProtocolError(f"a message must be JSON: {fault}") from fault
    kind = document.pop("type", None) if isinstance(document, dict) else None
    if not isinstance(kind, str) or kind not in KEYS:
        raise ProtocolError(f'a message must be an object whose "type" is one of {", ".join(KEYS)}')
    # whose values are known and fit
    arguments = {name: value for name, value in document.items() if value is not None}
    _check_arguments(kind, arguments)
    return kind, arguments


def _check_arguments(kind: str, arguments: Json) -> None:
    """ProtocolError for what a type of message does not have, or does not take, and where it lacks what it needs."""
    for name, value in arguments.items():
        if name not in KEYS[kind]:
            raise ProtocolError(f"{kind}: {quoted(name)} is unknown; expected one of {', '.join(KEYS[kind])}")
        if wanted := _unfit(kind, name, value):
            raise ProtocolError(f"{kind}, {name}: expected {wanted}")
    if kind in REQUIRED_FIELDS and REQUIRED_FIELDS[kind] not in arguments:
        raise ProtocolError(f"{kind}: expected {REQUIRED_FIELDS[kind]}")


def _unfit(kind: str, name: str, value: Any) -> str | None:
    """What a value should be, where it is not."""
    if name in NUMBER_FIELDS and not _numeric(value, depth=2):
        return f"numbers up to {LARGEST_COMMAND:g}, or lists of them"
    one_for_each = kind == "control" and isinstance(value, list) and all(isinstance(part, str) for part in value)
    if name in ("gait", "style") and not (isinstance(value, str) or one_for_each):
        return f"the name of a {name}"
    if name == "hand" and value not in LEFT_RIGHT:
        return " or ".join(LEFT_RIGHT)
    if name in ("motion", "text") and not _are_sentences(name, value):
        return "a sentence" if name == "text" else "a sentence, or a list of sentences and null"
    if name in ("hold_feet", "positions", "upper") and not isinstance(value, bool):
        return "true or false"
    return None


def _are_sentences(name: str, value: Any) -> bool:
    if name == "text":
        return isinstance(value, str)
    return all(text is None or isinstance(text, str) for text in _each(value))


def sentences(text: str | bytes) -> list[str]:
    """What a client's message tells its figures to do in words, so that it can be made before it is obeyed."""
    kind, arguments = parsed(text)
    return [text for text in _each(arguments.get("motion")) if text] if kind == "act" else []


def _each(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _numeric(value: Any, depth: int) -> bool:
    if isinstance(value, list):
        return depth > 0 and all(_numeric(part, depth - 1) for part in value)
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_COMMAND
