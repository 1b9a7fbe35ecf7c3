"""Tables beside mocap files: the sentences of clips, their performers, and the gaits that they show."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

from motet.bundle.fields import Json
from motet_train.data.errors import DataError


def read_toml(file: str, name: str) -> Json:
    """The TOML file ``name`` beside the file of a module."""
    return tomllib.loads(Path(file).with_name(name).read_text(encoding="utf-8"))


@dataclass
class Described:
    """The entries of a table about a clip; for the fields see :class:`motet_train.data.corpus.Record`."""

    sentences: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)
    subject: str = ""
    action: str = ""
    gaits: tuple[str, ...] = ()
    in_place: bool = False
    loops: bool = False


def read_table(path: Path) -> dict[str, Described]:
    """The descriptions of clips in a tab-separated table, whose header has the columns ``clip`` and ``sentence``.

    Several lines of a clip give several sentences; empty ones are left out, as are clips without any. The other columns
    are optional. ``pool``: "train" or empty for sentences to train on, "test" for those to measure by. ``subject``: the
    performer, once for each clip or the same each time. ``description``: the action shown. ``gait``: the ways of
    moving, such as "walk" or "walk, run". ``in_place``: "yes" or "no", whether the root stays in place while the feet
    walk. ``loops``: "yes" or "no", whether the clip is one period of a loop. DataError names the line at fault.
    """
    clips: dict[str, Described] = {}
    for number, row in _rows(path, "clip", "sentence"):
        _describe(clips.setdefault(row["clip"], Described()), row, f"{path}, line {number}")
    return {clip: described for clip, described in clips.items() if clip and described.sentences}


def _describe(described: Described, row: dict[str, str], place: str) -> None:
    """Add one line of a table to the description of its clip."""
    pool = row.get("pool", "") or "train"
    if pool not in ("train", "test"):
        raise DataError(f"{place}: the pool is one of train, test, not {pool!r}")
    # the sentence, to train on or to measure by
    if row["sentence"]:
        sentences = described.sentences if pool == "train" else described.unseen
        sentences.append(row["sentence"])
    # who moves: once, or the same each time
    subject = row.get("subject", "")
    if subject and described.subject and subject != described.subject:
        raise DataError(f"{place}: the subject of {row['clip']} is {subject!r}, and {described.subject!r} above")
    described.subject = subject or described.subject
    # later lines replace earlier ones
    described.action = row.get("description", "") or described.action
    gaits = [name.strip() for name in row.get("gait", "").split(",")]
    described.gaits = tuple(filter(None, gaits)) or described.gaits
    described.in_place |= _yes(row, "in_place", place)
    described.loops |= _yes(row, "loops", place)


def _yes(row: dict[str, str], column: str, place: str) -> bool:
    """Whether an optional column is "yes"; DataError if it is neither "yes" nor "no"."""
    value = row.get(column, "") or "no"
    if value not in ("yes", "no"):
        raise DataError(f"{place}: {column} is yes or no, not {value!r}")
    return value == "yes"


@dataclass(frozen=True)
class Person:
    """The performer of the clips of a pattern, and the take that they are parts of, "" if each is a take of its own."""

    pattern: str
    subject: str
    take: str = ""


def read_people(path: Path) -> tuple[Person, ...]:
    """The performers of clips: a table with the columns ``clip``, ``subject`` and, optionally, ``take``.

    A clip may be a pattern, such as "ACCAD_Male1_*"; the first that matches counts. Clips of one take are never divided
    between training and test. DataError names the line at fault.
    """
    rows = _rows(path, "clip", "subject")
    return tuple(Person(row["clip"], row["subject"], row.get("take", "")) for _, row in rows)


def person(people: tuple[Person, ...], clip: str) -> Person:
    """The performer of a clip; by default named like the clip up to its first "_"."""
    plain = clip.rpartition("/")[2]
    for row in people:
        if fnmatchcase(plain, row.pattern):
            return row
    return Person(plain, plain.split("_")[0])


def _rows(path: Path, *needed: str) -> Iterator[tuple[int, dict[str, str]]]:
    """The lines of a table with their numbers, as dicts by column."""
    try:
        lines = [line.split("\t") for line in path.read_text(encoding="utf-8-sig").split("\n")]
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the table {path} cannot be read: {error}") from error
    # the columns
    header = [name.strip() for name in lines[0]]
    if not set(needed) <= set(header):
        raise DataError(
            f"{path}, line 1: the header needs the columns {' and '.join(needed)}, with tabs between: {header}"
        )
    for number, line in enumerate(lines[1:], start=2):
        if line == [""]:
            continue
        if len(line) != len(header):
            raise DataError(f"{path}, line {number}: {len(line)} columns where the header has {len(header)}")
        yield number, dict(zip(header, map(str.strip, line), strict=True))


@dataclass(frozen=True)
class Gait:
    """A gait of a steered figure. actions, people: patterns of the actions and performers of its recordings."""

    name: str
    actions: tuple[str, ...]
    people: tuple[str, ...]

    def shown(self, action: str, person: str) -> bool:
        """Whether a recording of a person's action shows it."""
        return _matches(action, self.actions) and _matches(person, self.people)


def _matches(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)


def read_gaits(path: Path | None = None) -> tuple[Gait, ...]:
    """A TOML table of gaits: each a ``[[gait]]`` with a ``name``, ``actions`` and, to limit the performers, ``people``.

    By default the gaits of CMU's and ACCAD's recordings, from which the bundle ``control`` is made. DataError if it
    cannot be read.
    """
    path = path or Path(__file__).with_name("gaits.toml")
    try:
        rows = tomllib.loads(path.read_text(encoding="utf-8"))["gait"]
        return tuple(map(_gait, rows))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(f"{path} is not a table of gaits: {error}") from error


def _gait(row: dict[str, Any]) -> Gait:
    gait = Gait(row["name"], tuple(row["actions"]), tuple(row.get("people", ["*"])))
    if not all(isinstance(text, str) for text in (gait.name, *gait.actions, *gait.people)):
        raise TypeError("names of gaits, actions and people are texts")
    return gait
