"""What the text formats share: reading a file's text, its numbers, and names that a file can hold."""

import math
import re
from collections.abc import Iterable
from itertools import permutations
from pathlib import Path

from motet.errors import FormatError


def read_text(path: str | Path) -> str:
    """The text of a file in UTF-8, with or without byte order mark, else Latin-1; FormatError if it is no text.

    Lines end with ``\\n`` whatever the file has: split them with ``split("\\n")`` to count as editors count.
    """
    path = Path(path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error
    if b"\0" in content:
        raise FormatError(path, "this is no text file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def numbers(words: Iterable[str], path: Path, line: int) -> list[float]:
    """Finite numbers; FormatError with file and line for any other word."""
    return [_number(word, path, line) for word in words]


def _number(word: str, path: Path, line: int) -> float:
    try:
        # Python would read 1_000, which no other program does
        value = math.nan if "_" in word else float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FormatError(path, f"{word!r} is not a finite number", line)
    return value


def complete_order(axes: str) -> str:
    """The Euler order of all three axes that has ``axes`` in this order: a missing axis does not turn."""
    orders = ("".join(order) for order in permutations("zyx"))
    return next(order for order in orders if [axis for axis in order if axis in axes] == list(axes))


def unique_name(name: str, taken: Iterable[str]) -> str:
    """``name``, with _2, _3, ... behind it if it is taken."""
    taken = set(taken)
    candidate, number = name, 2
    while candidate in taken:
        candidate, number = f"{name}_{number}", number + 1
    return candidate


def plain_names(names: Iterable[str], forbidden: str) -> list[str]:
    """Different names, not empty, with ``_`` for every character that matches the regular expression ``forbidden``."""
    plain: list[str] = []
    for name in names:
        plain.append(unique_name(re.sub(forbidden, "_", name) or "_", plain))
    return plain
