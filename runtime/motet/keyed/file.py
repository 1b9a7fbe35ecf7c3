"""Acts of key poses in TOML: a table for each act, and in it an array of keys (docs/keyed.md)."""

import re
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from motet.errors import FormatError, quoted
from motet.keyed.acts import KeyedAct
from motet.keyed.keys import HandKey, Key, Repeat, Span
from motet.keyed.parts import DIRECTION_WORDS, FLOOR, HAND, HAND_PARTS, OTHER_HAND, PART_NUMBERS, PLACES, TOUCHES
from motet.settings import Range, is_number

LARGEST_FILE = 1_000_000
"""Bytes."""

MOST_ACTS = 1_000
MOST_KEYS = 100
MOST_KEY_TIMES = 50

TIME = Range(0, 60, "s")
EASE = Range(0.05, 5, "s")
SPEED = Range(0.3, 3)
AMPLITUDE = Range(0.1, 2)
PACE = Range(0.4, 2)
OVER = ("stand", "walk")

ACT_FIELDS = ("says", "ease", "speed", "amplitude", "mirrored", "over", "pace", "repeat", "key")
KEY_FIELDS = ("at", "hold", *PART_NUMBERS, *HAND_PARTS)
HAND_FIELDS = ("to", "palm", "fingers", "touch", *HAND)
REPEAT_FIELDS = ("keys", "every", "times")


class _EntryError(Exception):
    """What is wrong with an entry; the reader knows its line."""


def read(file: str | Path) -> dict[str, KeyedAct]:
    """The acts of a TOML file by name. FormatError, with the line, for one that cannot be read or understood."""
    path = Path(file)
    try:
        with path.open("rb") as opened:
            data = opened.read(LARGEST_FILE + 1)
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from error
    if len(data) > LARGEST_FILE:
        raise FormatError(path, f"a file of acts has at most {LARGEST_FILE} bytes")
    try:
        text = data.decode()
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(path, f"not TOML: {error}") from error
    if not tables or len(tables) > MOST_ACTS:
        raise FormatError(path, f"expected 1 to {MOST_ACTS} acts, each a table such as [nod], not {len(tables)}")
    reader = _Reader(path, text)
    return {name: reader.act(name, table) for name, table in tables.items()}


class _Reader:
    """Makes acts of tables, and knows the lines of their headers."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.lines = text.splitlines()

    def act(self, name: str, table: Any) -> KeyedAct:
        """The act of a table."""
        try:
            settings = _settings(name, table)
        except _EntryError as wrong:
            raise FormatError(self.path, f"[{name}]: {wrong}", self._line(name)) from None
        keys = tuple(self._key(name, number, key) for number, key in enumerate(table["key"]))
        self._check_order(name, keys)
        return KeyedAct(name, keys=keys, **settings)

    def _key(self, name: str, number: int, table: Any) -> Key:
        try:
            return _key(table)
        except _EntryError as wrong:
            raise FormatError(self.path, f"[[{name}.key]]: {wrong}", self._line(name, number)) from None

    def _check_order(self, name: str, keys: Sequence[Key]) -> None:
        for number in range(1, len(keys)):
            before = keys[number - 1]
            if keys[number].at[0] < before.at[0] + before.hold[0]:
                reason = f"[[{name}.key]]: at {keys[number].at[0]:g} s, before the key above it is over"
                raise FormatError(self.path, reason, self._line(name, number))

    def _line(self, name: str, key: int | None = None) -> int | None:
        """The line of an act's header, or of that of one of its keys, from 0; None if it is written otherwise."""
        quoted_name = rf'(?:{re.escape(name)}|"{re.escape(name)}"|\'{re.escape(name)}\')'
        header = rf"\s*\[{quoted_name}\]" if key is None else rf"\s*\[\[\s*{quoted_name}\s*\.\s*key\s*\]\]"
        numbers = [number for number, line in enumerate(self.lines, start=1) if re.match(header, line)]
        place = key or 0
        return numbers[place] if place < len(numbers) else None


def _settings(name: str, table: Any) -> dict[str, Any]:
    """The fields of an act beside its keys."""
    _check_fields(table, ACT_FIELDS, f"[{name}]")
    keys = table.get("key", [])
    if not isinstance(keys, list) or not 1 <= len(keys) <= MOST_KEYS:
        raise _EntryError(f"expected 1 to {MOST_KEYS} keys, each a table [[{name}.key]]")
    settings: dict[str, Any] = {"says": _sentences(table.get("says", [name]))}
    settings["mirrored"] = table.get("mirrored", False)
    if not isinstance(settings["mirrored"], bool):
        raise _EntryError("mirrored: expected true or false")
    settings["over"] = table.get("over", OVER[0])
    if settings["over"] not in OVER:
        raise _EntryError(f"over: expected {' or '.join(OVER)}, not {quoted(str(settings['over']))}")
    settings["pace"], _ = _span([table.get("pace", 1.0)] * 2, PACE, "pace")
    if "repeat" in table:
        settings["repeat"] = _repeat(table["repeat"], len(keys))
    for field, limits in (("ease", EASE), ("speed", SPEED), ("amplitude", AMPLITUDE)):
        if field in table:
            settings[field] = _span(table[field], limits, field)
    return settings


def _sentences(says: Any) -> tuple[str, ...]:
    if not isinstance(says, list) or not all(isinstance(text, str) and text.strip() for text in says):
        raise _EntryError("says: expected a list of sentences")
    return tuple(says)


def _key(table: Any) -> Key:
    _check_fields(table, KEY_FIELDS, "a key")
    if "at" not in table:
        raise _EntryError("at: is missing: expected seconds")
    numbers = {}
    for part, ranges in PART_NUMBERS.items():
        if part in table:
            _check_fields(table[part], tuple(ranges), part)
            numbers[part] = {name: _span(value, ranges[name], f"{part}.{name}") for name, value in table[part].items()}
    hands = {hand: _hand(table[hand], hand) for hand in HAND_PARTS if hand in table}
    return Key(_span(table["at"], TIME, "at"), _span(table.get("hold", 0), TIME, "hold"), numbers, hands)


def _hand(table: Any, hand: str) -> HandKey:
    _check_fields(table, HAND_FIELDS, hand)
    places = (*PLACES, OTHER_HAND, FLOOR)
    place = table.get("to")
    if place not in places:
        raise _EntryError(f"{hand}.to: expected one of {', '.join(places)}, not {quoted(str(place))}")
    touch = table.get("touch", "palm")
    if touch not in TOUCHES:
        raise _EntryError(f"{hand}.touch: expected {', '.join(TOUCHES)}, not {quoted(str(touch))}")
    # its distance from there, and where palm and fingers point
    numbers = {name: _span(table[name], HAND[name], f"{hand}.{name}") for name in HAND if name in table}
    palm = _direction(table.get("palm", ""), f"{hand}.palm")
    fingers = _direction(table.get("fingers", ""), f"{hand}.fingers")
    return HandKey(place, palm=palm, fingers=fingers, touch=touch, **numbers)


def _direction(words: Any, name: str) -> str:
    if not isinstance(words, str) or any(word not in DIRECTION_WORDS for word in words.split()):
        raise _EntryError(f"{name}: expected words out of {', '.join(DIRECTION_WORDS)}, not {quoted(str(words))}")
    return words


def _repeat(table: Any, keys: int) -> Repeat:
    _check_fields(table, REPEAT_FIELDS, "repeat")
    if missing := [name for name in REPEAT_FIELDS if name not in table]:
        raise _EntryError(f"repeat.{missing[0]}: is missing")
    first, last = _whole_pair(table["keys"], keys, "repeat.keys")
    return Repeat(
        first - 1,
        last - 1,
        _span(table["every"], Range(0.05, 60, "s"), "repeat.every"),
        _whole_pair(table["times"], MOST_KEY_TIMES, "repeat.times"),
    )


def _whole_pair(value: Any, largest: int, name: str) -> tuple[int, int]:
    """Two rising whole numbers from 1, or one number twice."""
    pair = value if isinstance(value, list) else [value, value]
    is_pair = len(pair) == 2 and all(type(number) is int for number in pair)
    if not is_pair or not 1 <= pair[0] <= pair[1] <= largest:
        raise _EntryError(
            f"{name}: expected one or two rising whole numbers from 1 to {largest}, not {quoted(str(value))}"
        )
    return pair[0], pair[1]


def _span(value: Any, limits: Range, name: str) -> Span:
    """A number, or the lowest and the highest of those that are drawn."""
    pair = value if isinstance(value, list) else [value, value]
    is_pair = len(pair) == 2 and all(map(is_number, pair))
    if not is_pair or not limits.low <= pair[0] <= pair[1] <= limits.high:
        unit = f" {limits.unit}" if limits.unit else ""
        expected = f"a number from {limits.low:g} to {limits.high:g}{unit}, or [lowest, highest]"
        raise _EntryError(f"{name}: expected {expected}, not {quoted(str(value))}")
    return float(pair[0]), float(pair[1])


def _check_fields(table: Any, names: Sequence[str], what: str) -> None:
    if not isinstance(table, dict):
        raise _EntryError(f"{what}: expected a table, not {quoted(str(table))}")
    if unknown := sorted(table.keys() - set(names)):
        raise _EntryError(f"{what}: {quoted(unknown[0])} is unknown; expected {', '.join(names)}")
