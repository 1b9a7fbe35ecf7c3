"""Shared by the formats: bytes, text and numbers of files, names, clips, and the skeletons that text files can hold.

Clips are the motions of a file that holds several, figures its skeletons, each by a name; "file.glb#Walk" is the clip
Walk of file.glb or, if there is no such clip, the figure of that name.
"""

import logging
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from difflib import get_close_matches
from functools import wraps
from itertools import permutations
from pathlib import Path
from typing import Concatenate, Literal, NamedTuple, ParamSpec, TypeVar

import numpy as np

from motet.errors import FormatError, MotionError, listed, quoted
from motet.files import File, place_of
from motet.motion.kinematics import AXES, local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Joint, Names, Skeleton, Triple

log = logging.getLogger(__name__)

P = ParamSpec("P")
T = TypeVar("T")

NOWHERE: Triple = (0.0, 0.0, 0.0)

Clip = str | int | None
"""One of a file's clips: its name, its number from 1, or None for the first."""

Figure = str | int | None
"""One of a file's figures: its name, its number from 1, or None for the format's default."""


class Contents(NamedTuple):
    """The parts of a motion file, by unique names in the file's order.

    clips: its motions; empty in a format of one motion a file.
    figures: each of its skeletons -> the clips that move it.
    """

    clips: Names
    figures: dict[str, Names]


class ContentError(MotionError):
    """What breaks the rules of a format, in a file that is yet to be named: the reason, and the line (from 1)."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(reason)
        self.line = line


@contextmanager
def naming(file: File) -> Iterator[None]:
    """What is wrong with a file's content as a FormatError that names the file."""
    try:
        yield
    except FormatError:
        raise
    except MotionError as error:
        raise FormatError(place_of(file), str(error), getattr(error, "line", None)) from error


def names_file(read: Callable[Concatenate[File, P], T]) -> Callable[Concatenate[File, P], T]:
    """A function that reads a file, and names it in its errors."""

    @wraps(read)
    def named(file: File, /, *arguments: P.args, **options: P.kwargs) -> T:
        with naming(file):
            return read(file, *arguments, **options)

    return named


MARK = "#"

FRAME_RATES = (1e-3, 1e5)
"""The lowest and the highest frame rate of a file: the highest is ten times what cameras take."""

MAX_POSES = 10**7
FREE_POSES = 10**6
"""Poses of a file, frames times joints: an hour of 90 joints at 30 fps; and what a small file may have, and one more
for each of its bytes."""


def read_bytes(file: File, most: int | None = None) -> bytes:
    """All bytes of a file or file object; FormatError if it is missing, unreadable or longer than ``most``."""
    path = place_of(file)
    limit = -1 if most is None else most + 1
    try:
        if not isinstance(file, str | Path):
            content = file.read(limit)
        elif path.is_file():
            with path.open("rb") as opened:
                content = opened.read(limit)
        else:
            missing = "a link that leads nowhere" if path.is_symlink() else "no such file"
            raise ContentError("it is not a file" if path.exists() else missing)
    except OSError as error:
        raise ContentError(f"cannot be read: {error.strerror}") from error
    if most is not None and len(content) > most:
        raise ContentError(f"it is too large: expected at most {most} bytes")
    return content


def read_text(file: File) -> str:
    """The text of a file in UTF-8, with or without byte order mark, else Latin-1; FormatError if it is not text.

    Every line ending becomes ``\\n``: ``split("\\n")`` counts lines the way editors do.
    """
    content = read_bytes(file)
    if b"\0" in content:
        raise ContentError("not a text file")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def finite(words: Sequence[str]) -> Array | None:
    """Many words as numbers (N,), or None unless all are finite numbers."""
    try:
        values = np.array(words, dtype=np.float64)
    except ValueError:
        return None
    # Python would read 1_000, which no other program does
    return None if "_" in "".join(words) or not np.isfinite(values).all() else values


def table(lines: Sequence[str]) -> Array | None:
    """Lines of equally many finite numbers as (N, D), in one pass; None for others, and where the first is blank."""
    if not lines or not lines[0].strip():  # numpy would warn of lines without numbers
        return None
    try:
        values = np.loadtxt(lines, comments=None, ndmin=2, encoding=None)
    except ValueError:
        return None
    return values if np.isfinite(values).all() else None


def check_rate(stated: float | None, expected: float | None) -> None:
    """FormatError where a file states another frame rate than the one that its reader was called with."""
    if stated is not None and expected is not None and abs(stated - expected) > 1e-6 * stated:
        raise ContentError(f"the file states {stated:g} fps, but {expected:g} was given")


def numbers(words: Sequence[str], line: int | None) -> list[float]:
    """Finite numbers; FormatError with file and line for any other word."""
    if finite(words) is None:
        # the first word at fault, and why it may be there
        wrong = next(word for word in words if finite([word]) is None)
        comma = ": decimals are written with a point, not a comma" if re.fullmatch(r"[-+]?\d*,\d+", wrong) else ""
        raise ContentError(f"{quoted(wrong)} is not a finite number{comma}", line)
    return [float(word) for word in words]


def number(word: str, line: int | None) -> float:
    """One finite number; FormatError like :func:`numbers`."""
    return numbers([word], line)[0]


def triple(words: Sequence[str], line: int) -> Triple:
    """Three finite numbers; FormatError like :func:`numbers`."""
    values = numbers(words, line)
    if len(values) != 3:
        raise ContentError(f"expected three numbers, not {len(values)}", line)
    return values[0], values[1], values[2]


def spaced(values: Iterable[float]) -> str:
    """Numbers as text, exact."""
    return " ".join(repr(float(value)) for value in values)


def frame_rate(fps: float, line: int | None = None) -> float:
    """A file's frame rate; FormatError if it is none of :data:`FRAME_RATES`."""
    low, high = FRAME_RATES
    if not low <= fps <= high:
        raise ContentError(f"frame rate {fps:g} is out of range: expected {low:g} to {high:g}", line)
    return fps


def most_poses(size: int) -> int:
    """Below how many poses, frames times joints, a file of so many bytes must stay, so that small files are cheap."""
    return min(MAX_POSES, FREE_POSES + size)


def units_of(channels: Iterable[str], angle: str) -> Names:
    """The units of translations, "length", and of Euler angles, which are in the unit ``angle``."""
    return tuple("length" if name[-2] == "t" else angle for name in channels)


def complete_order(axes: str) -> str:
    """An Euler order of all three axes that contains ``axes`` in this order: a missing axis does not turn."""
    pattern = ".*".join(["", *axes, ""])
    return next(order for order in map("".join, permutations("zyx")) if re.fullmatch(pattern, order))


class UniqueNames:
    """Hands out unique names: a name already taken gets the suffix _2, _3, ..."""

    def __init__(self, taken: Iterable[str] = ()) -> None:
        self._taken = set(taken)
        self._next: dict[str, int] = {}

    def unique(self, name: str) -> str:
        """``name``, with a numeric suffix if it is taken; the result is then taken too."""
        # the next free suffix of a name is remembered: thousands may share one
        candidate = name
        while candidate in self._taken:
            suffix = self._next.get(name, 2)
            candidate = f"{name}_{suffix}"
            self._next[name] = suffix + 1
        self._taken.add(candidate)
        return candidate


def plain_names(names: Iterable[str], forbidden: str) -> list[str]:
    """Unique non-empty names, with ``_`` for every character that matches the regular expression ``forbidden``."""
    plain = UniqueNames()
    return [plain.unique(re.sub(forbidden, "_", name) or "_") for name in names]


def with_names(motion: Motion, names: Sequence[str]) -> Motion:
    """The motion with its skeleton's joints renamed, one name for each."""
    skeleton = skeleton_of(motion)
    # channels follow the names of their joints
    new = dict(zip(skeleton.names, names, strict=True))
    joints = tuple(replace(joint, name=new[joint.name]) for joint in skeleton.joints)
    parts = (channel.rpartition(".") for channel in motion.channels)
    channels = tuple(f"{new.get(joint, joint)}.{kind}" for joint, _, kind in parts)
    return replace(motion, channels=channels, skeleton=Skeleton(joints, skeleton.metres_per_unit))


def with_still_offsets(path: str | Path, motion: Motion) -> tuple[Motion, Names]:
    """The motion with constant translations turned into offsets of the skeleton, and the joints that still translate.

    The root keeps its translation and is not among those joints; all translations are in "length".
    MotionError for a motion without skeleton; FormatError names channels that are neither an Euler angle nor a
    translation of one of its joints.
    """
    _check_channels(path, motion)
    joints, moving = _still_joints(motion)
    translated = (joints[0].name, *moving)
    channels = []
    units = []
    for channel, unit in zip(motion.channels, motion.units, strict=True):
        joint_name, _, kind = channel.rpartition(".")
        if kind[0] == "r" or joint_name in translated:
            channels.append(channel)
            units.append("length" if unit == "m" else unit)
    still = motion.select(tuple(channels), tuple(units))
    return replace(still, skeleton=replace(skeleton_of(motion), joints=tuple(joints))), tuple(moving)


def _still_joints(motion: Motion) -> tuple[list[Joint], list[str]]:
    """The joints, with the translation as the offset of those whose translation stays, and the names of those, without
    the root, whose translation changes."""
    skeleton = skeleton_of(motion)
    joints = list(skeleton.joints)
    moving = []
    translations = local_translations(motion)
    moved = {channel.rpartition(".")[0] for channel in motion.channels if channel[-2] == "t"}
    # a translation that does not change is an offset
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        if joint.name not in moved or not len(motion):
            continue
        if np.ptp(translations[:, i], axis=0).max() > 1e-9 * skeleton.height:
            moving.append(joint.name)
        else:
            x, y, z = translations[0, i].tolist()
            joints[i] = replace(joint, offset=(x, y, z))
    return joints, moving


def _check_channels(path: str | Path, motion: Motion) -> None:
    """FormatError for channels that are neither an Euler angle nor a translation of a joint."""
    skeleton = skeleton_of(motion)
    units_of: dict[str, Collection[str]] = {}
    for axis in AXES:
        units_of |= {f"r{axis}": TURN, f"t{axis}": ("length", "m")}
    wrong = []
    for channel, unit in zip(motion.channels, motion.units, strict=True):
        joint, _, kind = channel.rpartition(".")
        if joint not in skeleton.places or unit not in units_of.get(kind, ()):
            wrong.append(f"{channel} [{unit}]")
    if wrong:
        raise FormatError(path, f"holds only Euler angles and translations of joints, not {', '.join(wrong)}")


def part_names(names_in_file: Iterable[str], kind: str = "clip") -> Names:
    """Unique names for a file's clips or figures, in order: printable and on one line, "clip3" for an empty third."""
    names = UniqueNames()
    return tuple(names.unique(_tidy(name) or f"{kind}{i}") for i, name in enumerate(names_in_file, start=1))


def _tidy(name: str) -> str:
    printable = "".join(letter if letter.isprintable() else " " for letter in name)
    return " ".join(printable.split())[:200]


def is_name_of(part: Clip, names: Sequence[str]) -> bool:
    """Whether a part is given by one of these names, rather than by its number."""
    return isinstance(part, str) and _tidy(part) in names


def chosen(path: Path, names: Sequence[str], part: Clip, kind: Literal["clip", "figure"] = "clip") -> int:
    """The index of a clip or figure among a file's; for a number as text, one of that name precedes that number.

    None is the first, with a note in the log if there are others. FormatError, with the names, for an unknown one.
    """
    if part is None:
        _note_others(path, names, kind)
        return 0
    if is_name_of(part, names):
        return names.index(_tidy(str(part)))
    at = int(part) if isinstance(part, int) or (part.isdecimal() and len(part) < 10) else 0
    if 1 <= at <= len(names):
        return at - 1
    known = "none"
    if names:
        known = f"{listed([quoted(name) for name in _nearest_first(str(part), names)])}, or 1 to {len(names)}"
    raise FormatError(path, f"no {kind} {part if isinstance(part, int) else quoted(part)}: expected {known}")


def _note_others(path: Path, names: Sequence[str], kind: str) -> None:
    if len(names) > 1:
        message = "%s: reading the first of %d %ss, %s; the next is %s%s%s"
        log.warning(message, path, len(names), kind, quoted(names[0]), path.name, MARK, names[1])
        log.info("%s: %ss: %s", path, kind, ", ".join(map(quoted, names)))


def choice(path: Path, parts: Contents, clip: Clip, figure: Figure) -> tuple[int | None, int | None]:
    """The indices of a clip, None for none, and of a figure, None for the format's default.

    Of a figure without a clip the first clip that moves it. A clip may be the name of a figure. FormatError like
    :func:`chosen`, and for a clip that does not move the figure.
    """
    # the name of a figure may stand in a clip's place
    titles = tuple(parts.figures)
    if figure is None and is_name_of(clip, titles) and not is_name_of(clip, parts.clips):
        figure = clip
        clip = None
    if figure is None:
        return (chosen(path, parts.clips, clip) if parts.clips or clip is not None else None), None
    # with a figure, the clip must move it
    place = chosen(path, titles, figure, "figure")
    moving = parts.figures[titles[place]]
    if clip is None:
        return (parts.clips.index(moving[0]) if moving else None), place
    at = chosen(path, parts.clips, clip)
    if parts.clips[at] not in moving:
        raise _does_not_move(path, parts.clips[at], titles[place], moving)
    return at, place


def _does_not_move(path: Path, clip: str, figure: str, moving: Sequence[str]) -> FormatError:
    known = listed([quoted(name) for name in moving]) if moving else "none"
    return FormatError(path, f"its clip {quoted(clip)} does not move the figure {quoted(figure)}: expected {known}")


def _nearest_first(clip: str, names: Sequence[str]) -> list[str]:
    """Names of clips, first those that an unknown one is a part of or is spelt like."""
    # names that hold the text, those that are spelt like it, then all others
    wanted = clip.casefold()
    known = names[:1000]
    holding = [name for name in known if wanted and wanted in name.casefold()]
    alike = get_close_matches(clip[:200], [name for name in known if name not in set(holding)])
    return list(dict.fromkeys([*sorted(holding, key=len), *alike, *names]))


def split_clip(file: File, extensions: Sequence[str]) -> tuple[File, str | None]:
    """A file and the clip named after :data:`MARK`, or None.

    An existing file with the mark in its name takes precedence, then the shortest existing path before a mark, then
    the shortest one with one of ``extensions``.
    """

    if not isinstance(file, str | Path) or MARK not in str(file) or _exists(Path(file)):
        return file, None
    # every mark may be the one: in names of files it is allowed
    parts = str(file).split(MARK)
    ways = []
    for i in range(1, len(parts)):
        path = Path(MARK.join(parts[:i]))
        if path.suffix.lower() in extensions:
            ways.append((path, MARK.join(parts[i:])))
    return next((way for way in ways if _exists(way[0])), ways[0] if ways else (file, None))


def _exists(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # not a valid file name
        return False
