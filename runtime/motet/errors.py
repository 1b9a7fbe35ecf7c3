"""motet's own errors: each is also a builtin, and says what is wrong, where, and what was expected. And warnings."""

import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any


def quoted(text: str, most: int = 60) -> str:
    """What was given or a file says, for an error: at most so many of its characters."""
    return repr(text if len(text) <= most else text[:most] + "...")


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names with commas, for an error: the first of them and how many more there are."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


_collecting: ContextVar[tuple[tuple[tuple[type[Warning], ...], list[Warning]], ...]] = ContextVar("motet", default=())
"""What this thread or task collects instead of warning of it: categories, and where they go; the innermost last."""


@contextmanager
def collected(*categories: type[Warning]) -> Iterator[list[Warning]]:
    """What motet warns of in these categories is put into a list instead, in this thread or task alone.

    The filters of Python's own warnings are those of all threads, so a library leaves them alone.
    """
    notes: list[Warning] = []
    token = _collecting.set((*_collecting.get(), (categories, notes)))
    try:
        yield notes
    finally:
        _collecting.reset(token)


def warn(text: str, category: type[Warning]) -> None:
    """Warn at the nearest line outside of this package: that of the caller, who can do something about it. Or add it to
    what the caller collects (:func:`collected`)."""
    for categories, notes in reversed(_collecting.get()):
        if issubclass(category, categories):
            notes.append(category(text))
            return
    level = 1
    frame = sys._getframe(0)
    while frame.f_back is not None and Path(frame.f_code.co_filename).is_relative_to(Path(__file__).parent):
        level = level + 1
        frame = frame.f_back
    warnings.warn(text, category, stacklevel=level)


def each_once(notes: Sequence[Warning]) -> list[str]:
    """The texts of what was collected, each once."""
    return list(dict.fromkeys(map(str, notes)))


class TravelWarning(UserWarning):
    """A clip in place was given the path over the ground that its feet imply."""


class MotetError(Exception):
    """Base of every error that motet raises on purpose."""


class MotionError(MotetError, ValueError):
    """A motion or a skeleton that cannot be used for what was asked."""


class ArgumentError(MotetError, TypeError):
    """An argument of a type that a function does not take."""


def needs(value: object, kinds: Any, expected: str) -> None:
    """ArgumentError, which says what was expected, for a value that is of none of the kinds of :func:`isinstance`."""
    if not isinstance(value, kinds):
        raise ArgumentError(f"expected {expected}, not {quoted(repr(value))}")


class UnitError(MotionError):
    """A length is needed in metres, and it is not known how long a unit of the skeleton is, or what is said of it makes
    a human a giant or a dwarf."""


class FormatError(MotionError):
    """A file that breaks its format's rules: names the file, the line (from 1) and the reason."""

    def __init__(self, path: str | Path, reason: str, line: int | None = None) -> None:
        self.path = Path(path)
        self.reason = reason
        self.line = line
        super().__init__(path, reason, line)  # what unpickling calls the class with

    def __str__(self) -> str:
        place = f"{self.path}" if self.line is None else f"{self.path}, line {self.line}"
        return f"{place}: {self.reason}"


class BundleError(MotetError, ValueError):
    """A bundle that is unknown, damaged, altered or of another format version."""


class TextError(MotetError, ValueError):
    """A sentence that a model cannot take: empty, too long, or without a word it knows."""


class TextWarning(UserWarning):
    """A sentence has words that the model does not know; UNK takes their place."""


class SettingError(MotetError, ValueError):
    """A setting that is unknown, out of range or of another type."""


class DecodingError(SettingError):
    """A setting of decoding that is out of range: beams, hypotheses, candidates, temperature, seed, length."""


class ControlError(SettingError):
    """A control value, label or number of characters that the model cannot take."""


class ControlWarning(UserWarning):
    """A control value that a model cannot take was brought into its range."""


class ScriptError(MotetError, ValueError):
    """A control script that does not parse: shows the script and marks the place."""

    def __init__(self, script: str, position: int, reason: str) -> None:
        self.script = script
        self.position = position
        self.reason = reason
        super().__init__(script, position, reason)  # what unpickling calls the class with

    def __str__(self) -> str:
        return f"{self.reason}\n  {self.script}\n  {' ' * self.position}^"


class OutputError(MotetError, OSError):
    """A path that cannot be written; nothing was written."""
