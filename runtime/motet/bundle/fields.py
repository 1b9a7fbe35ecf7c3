"""JSON read with types: every refusal is a BundleError with the path of the key, such as ``motion.mean``."""

import json
import reprlib
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import BundleError
from motet.settings import is_number

Json = Mapping[str, Any]
"""A JSON object."""

LARGEST_NUMBER = 1e9
"""Of any number: what is larger is an error, and would overflow in float32 soon."""


def parse(text: bytes) -> Any:
    """A JSON document; BundleError if it is invalid, nested too deeply, or contains NaN or Infinity."""

    def no_constant(name: str) -> None:
        raise ValueError(f"JSON has no number {name}")

    try:
        return json.loads(text, parse_constant=no_constant)
    except (ValueError, RecursionError) as error:
        raise BundleError(f"manifest.json is not valid JSON: {error}") from error


class Fields:
    """A JSON object read key by key.

    data: what stands at ``path`` ("" for the whole document); BundleError where it is not an object.
    """

    def __init__(self, data: object, path: str = "") -> None:
        self.path = path
        if not isinstance(data, Mapping):
            raise self.fault("an object", data)
        self.data: Json = data

    def __contains__(self, key: str) -> bool:
        return self.data.get(key) is not None

    def fault(self, wanted: str, value: object, key: str = "") -> BundleError:
        """The error that says what must stand at a key, and what stands there."""
        return BundleError(f"manifest, {self.at(key) or 'all of it'}: must be {wanted}, not {reprlib.repr(value)}")

    def at(self, key: str) -> str:
        """The path of a key."""
        return ".".join(filter(None, (self.path, key)))

    def value(self, key: str) -> Any:
        """What stands at a key; BundleError where there is no such key."""
        if key not in self.data:
            raise BundleError(f"manifest, {self.at(key)}: is missing")
        return self.data[key]

    def text(self, key: str) -> str:
        """A string."""
        value = self.value(key)
        if not isinstance(value, str):
            raise self.fault("a string", value, key)
        return value

    def one_of(self, key: str, allowed: Collection[str]) -> str:
        """One of the allowed strings."""
        text = self.text(key)
        if text not in allowed:
            raise self.fault(f"one of {', '.join(allowed)}", text, key)
        return text

    def number(self, key: str, low: float = -LARGEST_NUMBER, high: float = LARGEST_NUMBER) -> float:
        """A number between two others."""
        number = self.value(key)
        if not is_number(number) or not low <= number <= high:
            raise self.fault(f"a number between {low:g} and {high:g}", number, key)
        return float(number)

    def whole(self, key: str, low: int, high: int) -> int:
        """A whole number between two others."""
        number = self.value(key)
        if isinstance(number, bool) or not isinstance(number, int) or not low <= number <= high:
            raise self.fault(f"a whole number between {low} and {high}", number, key)
        return number

    def items(self, key: str) -> list[Any]:
        """A list of anything."""
        items = self.value(key)
        if not isinstance(items, list):
            raise self.fault("a list", items, key)
        return items

    def texts(self, key: str) -> tuple[str, ...]:
        """A list of distinct strings."""
        strings = self.items(key)
        if not all(isinstance(item, str) for item in strings):
            raise self.fault("a list of strings", strings, key)
        if len(set(strings)) != len(strings):
            raise BundleError(f"manifest, {self.at(key)}: holds a string twice")
        return tuple(strings)

    def numbers(self, key: str, count: int, low: float = -LARGEST_NUMBER) -> NDArray[np.float64]:
        """A list of ``count`` numbers as (count,) float64."""
        items = self.items(key)
        if len(items) != count:
            raise BundleError(f"manifest, {self.at(key)}: must hold {count} numbers, not {len(items)}")
        for item in items:
            if not is_number(item) or not low <= item <= LARGEST_NUMBER:
                raise self.fault(f"numbers between {low:g} and {LARGEST_NUMBER:g}", item, key)
        return np.array(items, dtype=np.float64)

    def wholes(self, key: str, low: int, high: int) -> tuple[int, ...]:
        """A list of whole numbers between two others."""
        numbers = Fields({str(n): item for n, item in enumerate(self.items(key))}, self.at(key))
        return tuple(numbers.whole(n, low, high) for n in numbers.data)

    def table(self, key: str, columns: int) -> NDArray[np.float64]:
        """A list of lists of ``columns`` numbers as (rows, columns) float64."""
        rows = Fields({str(n): row for n, row in enumerate(self.items(key))}, self.at(key))
        return np.array([rows.numbers(row, columns) for row in rows.data]).reshape(-1, columns)

    def fields(self, key: str) -> "Fields":
        """An object."""
        return Fields(self.value(key), self.at(key))

    def mapping(self, key: str) -> Json:
        """An object of anything; empty where there is none."""
        return self.fields(key).data if key in self else {}

    def optional(self, key: str) -> "Fields":
        """An object; an empty one where there is none."""
        return Fields(self.mapping(key), self.at(key))

    def entries(self, key: str) -> Iterator[tuple[str, "Fields"]]:
        """The objects of an object, by name; none where there is none."""
        objects = self.optional(key)
        return ((name, objects.fields(name)) for name in objects.data)

    def list_of_fields(self, key: str) -> "list[Fields]":
        """A list of objects."""
        return [Fields(item, self.at(f"{key}[{n}]")) for n, item in enumerate(self.items(key))]
