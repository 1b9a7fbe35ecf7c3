"""Tables beside mocap files: what is said of each clip, who moves in which, and which gaits they show."""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from motet_train.data.errors import DataError


@dataclass
class Described:
    """What a table says of a clip; for its fields see :class:`motet_train.data.corpus.Record`."""

    sentences: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)
    subject: str = ""
    action: str = ""
    gaits: tuple[str, ...] = ()
    in_place: bool = False
    loops: bool = False


def read_table(path: Path) -> dict[str, Described]:
    """What a table says of each clip: tab-separated, with a header that has the columns ``clip`` and ``sentence``.

    Several lines of a clip give several sentences; empty ones are left out, as are clips without any. The other columns
    are optional. ``pool``: "train" or empty for sentences to train on, "test" for those to measure by. ``subject``: who
    moved, once for each clip or the same each time. ``description``: which action is shown. ``gait``: which ways of
    moving, such as "walk" or "walk, run". ``in_place``, ``loops``: "yes" or "no", whether the clip's root stays though
    its feet go somewhere, and whether it is one period of what repeats. DataError names the line that does not fit.
    """
    found: dict[str, Described] = {}
    for number, row in _rows(path, "clip", "sentence"):
        said, pool = found.setdefault(row["clip"], Described()), row.get("pool", "") or "train"
        if pool not in ("train", "test"):
            raise DataError(f"{path}, line {number}: the pool is one of train, test, not {pool!r}")
        if row["sentence"]:
            (said.sentences if pool == "train" else said.unseen).append(row["sentence"])
        subject = row.get("subject", "")
        if subject and said.subject and subject != said.subject:
            raise DataError(
                f"{path}, line {number}: the subject of {row['clip']} is {subject!r}, and {said.subject!r} above"
            )
        said.subject = subject or said.subject
        said.action = row.get("description", "") or said.action
        said.gaits = tuple(filter(None, map(str.strip, row.get("gait", "").split(",")))) or said.gaits
        said.in_place |= _yes(row, "in_place", f"{path}, line {number}")
        said.loops |= _yes(row, "loops", f"{path}, line {number}")
    return {clip: said for clip, said in found.items() if clip and said.sentences}


def _yes(row: dict[str, str], column: str, place: str) -> bool:
    """What an optional column says; DataError where that is neither yes nor no."""
    said = row.get(column, "") or "no"
    if said not in ("yes", "no"):
        raise DataError(f"{place}: {column} is yes or no, not {said!r}")
    return said == "yes"


@dataclass(frozen=True)
class Person:
    """Who moves in the clips of a pattern, and the take that these are parts of, "" where each is its own."""

    pattern: str
    subject: str
    take: str = ""


def read_people(path: Path) -> tuple[Person, ...]:
    """Who moves in which clips: a table with the columns ``clip``, ``subject`` and, optionally, ``take``.

    A clip may be a pattern, such as "ACCAD_Male1_*"; the first that fits counts. Clips of one take are never divided
    between training and test. DataError names the line that does not fit.
    """
    rows = _rows(path, "clip", "subject")
    return tuple(Person(row["clip"], row["subject"], row.get("take", "")) for _, row in rows)


def person(people: tuple[Person, ...], clip: str) -> Person:
    """Who moves in a clip; by default somebody called like the clip up to its first "_"."""
    plain = clip.rpartition("/")[2]
    fits = (row for row in people if fnmatchcase(plain, row.pattern))
    return next(fits, Person(plain, plain.split("_")[0]))


def _rows(path: Path, *needed: str) -> Iterator[tuple[int, dict[str, str]]]:
    """The lines of a table with their numbers, each by the header's columns."""
    try:
        lines = [line.split("\t") for line in path.read_text(encoding="utf-8-sig").split("\n")]
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the table {path} cannot be read: {error}") from error
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
    """A way of moving that a figure is steered by. actions, people: patterns of what its recordings show, and who."""

    name: str
    actions: tuple[str, ...]
    people: tuple[str, ...]

    def shown(self, action: str, person: str) -> bool:
        """Whether a recording of a person's action shows it."""
        pairs = ((action, self.actions), (person, self.people))
        return all(any(fnmatchcase(name, pattern) for pattern in patterns) for name, patterns in pairs)


def read_gaits(path: Path | None = None) -> tuple[Gait, ...]:
    """A table of gaits: each a ``[[gait]]`` with a ``name``, ``actions`` and, where not everybody counts, ``people``.

    By default that of CMU's and ACCAD's recordings, of which the bundle ``control`` is made. DataError where it cannot
    be read.
    """
    path = path or Path(__file__).with_name("gaits.toml")
    try:
        rows = tomllib.loads(path.read_text(encoding="utf-8"))["gait"]
        gaits = tuple(Gait(row["name"], tuple(row["actions"]), tuple(row.get("people", ["*"]))) for row in rows)
        if not all(isinstance(text, str) for gait in gaits for text in (gait.name, *gait.actions, *gait.people)):
            raise TypeError("names of gaits, actions and people are texts")
        return gaits
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise DataError(f"{path} is not a table of gaits: {error}") from error
