"""Shared by the formats: reading a file's bytes, text and numbers, and names that a file can hold."""

import math
import re
from collections.abc import Iterable
from itertools import permutations
from pathlib import Path

from motet.errors import FormatError, quoted
from motet.files import File, place_of


def read_bytes(file: File, most: int | None = None) -> bytes:
    """All bytes of a file or file object; FormatError if it is missing or cannot be read.

    most: FormatError for more bytes than this, before reading them.
    """
    path = place_of(file)
    try:
        if not isinstance(file, str | Path):
            content = file.read() if most is None else file.read(most + 1)
            if most is not None and len(content) > most:
                raise _too_large(path, most)
            return content
        if not path.is_file():
            missing = "a link that leads nowhere" if path.is_symlink() else "no such file"
            raise FormatError(path, "it is not a file" if path.exists() else missing)
        if most is not None and path.stat().st_size > most:
            raise _too_large(path, most)
        return path.read_bytes()
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror}") from error


def _too_large(path: Path, most: int) -> FormatError:
    return FormatError(path, f"it is too large: expected at most {most} bytes")


def read_text(file: File) -> str:
    """The text of a file in UTF-8, with or without byte order mark, else Latin-1; FormatError if it is not text.

    Every line ending becomes ``\\n``: ``split("\\n")`` counts lines the way editors do.
    """
    content = read_bytes(file)
    if b"\0" in content:
        raise FormatError(place_of(file), "not a text file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def numbers(words: Iterable[str], path: Path, line: int | None) -> list[float]:
    """Finite numbers; FormatError with file and line for any other word."""
    return [number(word, path, line) for word in words]


def number(word: str, path: Path, line: int | None) -> float:
    """One finite number; FormatError like :func:`numbers`."""
    try:
        # Python would read 1_000, which no other program does
        value = math.nan if "_" in word else float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise FormatError(path, f"{quoted(word)} is not a finite number", line)
    return value


def frame_rate(fps: float, path: Path, line: int | None = None) -> float:
    """A file's frame rate; FormatError if a motion cannot have it."""
    if not 1e-3 <= fps <= 1e6:
        raise FormatError(path, f"frame rate {fps:g} is out of range", line)
    return fps


def complete_order(axes: str) -> str:
    """An Euler order of all three axes that contains ``axes`` in this order: a missing axis does not turn."""
    orders = ("".join(order) for order in permutations("zyx"))
    return next(order for order in orders if [axis for axis in order if axis in axes] == list(axes))


class Names:
    """Hands out unique names: a name already taken gets the suffix _2, _3, ..."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._next: dict[str, int] = {}

    def unique(self, name: str) -> str:
        """``name``, with a numeric suffix if it is taken; the result is then taken too."""
        candidate = name
        while candidate in self._taken:
            number = self._next.get(name, 2)
            candidate, self._next[name] = f"{name}_{number}", number + 1
        self._taken.add(candidate)
        return candidate


def plain_names(names: Iterable[str], forbidden: str) -> list[str]:
    """Unique non-empty names, with ``_`` for every character that matches the regular expression ``forbidden``."""
    given = Names()
    return [given.unique(re.sub(forbidden, "_", name) or "_") for name in names]
