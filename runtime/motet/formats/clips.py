"""Clips: files that hold several motions, each by a name; "file.glb#Walk" is the clip Walk of file.glb."""

import logging
from collections.abc import Iterable, Sequence
from pathlib import Path

from motet.errors import FormatError, listed, quoted
from motet.files import File
from motet.formats.lines import Names

log = logging.getLogger(__name__)

Clip = str | int | None
"""One of a file's clips: its name, its number from 1, or None for the first."""

MARK = "#"
"""Separates a file from its clip."""


def clip_names(given: Iterable[str]) -> tuple[str, ...]:
    """Unique names for a file's clips, in order: printable and on one line, "clip3" for an empty third."""
    names = Names()
    return tuple(names.unique(_tidy(name) or f"clip{number}") for number, name in enumerate(given, start=1))


def _tidy(name: str) -> str:
    printable = "".join(letter if letter.isprintable() else " " for letter in name)
    # characters beyond this are cut off
    return " ".join(printable.split())[:200]


def chosen(path: Path, names: Sequence[str], clip: Clip) -> int:
    """The index of a clip among a file's; for a number as text, a clip of that name precedes the clip of that number.

    None is the first, with a note in the log if there are others. FormatError, with the names, for an unknown clip.
    """
    if clip is None:
        if len(names) > 1:
            said = "%s: reading the first of %d clips, %s; the next is %s%s%s"
            log.warning(said, path, len(names), quoted(names[0]), path.name, MARK, names[1])
            log.info("%s: clips: %s", path, ", ".join(map(quoted, names)))
        return 0
    if isinstance(clip, str) and _tidy(clip) in names:
        return names.index(_tidy(clip))
    number = int(clip) if isinstance(clip, int) or (clip.isdecimal() and len(clip) < 10) else 0
    if 1 <= number <= len(names):
        return number - 1
    known = f"{listed([quoted(name) for name in names])}, or 1 to {len(names)}" if names else "none"
    raise FormatError(path, f"no clip {clip if isinstance(clip, int) else quoted(clip)}: expected {known}")


def split_clip(file: File, extensions: Sequence[str]) -> tuple[File, str | None]:
    """A file and the clip named after :data:`MARK`, or None.

    An existing file with the mark in its name takes precedence, then the shortest existing path before a mark, then
    the shortest one with one of ``extensions``.
    """
    if not isinstance(file, str | Path) or MARK not in str(file) or _is_file(Path(file)):
        return file, None
    parts = str(file).split(MARK)
    ways = [(Path(MARK.join(parts[:i])), MARK.join(parts[i:])) for i in range(1, len(parts))]
    ways = [(path, clip) for path, clip in ways if path.suffix.lower() in extensions]
    return next((way for way in ways if _is_file(way[0])), ways[0] if ways else (file, None))


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # not a valid file name
        return False
