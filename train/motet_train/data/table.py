"""Tables beside mocap files: what is said of each clip, and who moves in which."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from pathlib import Path

from motet_train.data.errors import DataError

POOLS = ("train", "test")


@dataclass
class Described:
    """What a table says of a clip.

    sentences: to train on. unseen: those whose wordings no training sees. subject: who moved, "" where it is not said.
    action: what the clip shows, in words that all clips which show it share; "" where it is not said. gaits: which
    ways of moving it shows, for a figure to be steered by.
    """

    sentences: list[str] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)
    subject: str = ""
    action: str = ""
    gaits: tuple[str, ...] = ()


def read_table(path: Path) -> dict[str, Described]:
    """What a table says of each clip: tabs between, and a header that has the columns ``clip`` and ``sentence``.

    Several lines of a clip give several sentences, empty ones are left out, as are clips without any. A column ``pool``
    says which are to train on, "train" or empty, and which are kept for measuring, "test". A column ``subject`` says
    who moved, once for each clip or always alike; a column ``description`` which action is shown; a column ``gait``
    which ways of moving are, such as "walk" or, of several, "walk, run". DataError names the line that does not fit.
    """
    found: dict[str, Described] = {}
    for number, row in _rows(path, "clip", "sentence"):
        said, pool = found.setdefault(row["clip"], Described()), row.get("pool", "") or POOLS[0]
        if pool not in POOLS:
            raise DataError(f"{path}, line {number}: the pool is one of {', '.join(POOLS)}, not {pool!r}")
        if row["sentence"]:
            (said.sentences if pool == POOLS[0] else said.unseen).append(row["sentence"])
        subject = row.get("subject", "")
        if subject and said.subject and subject != said.subject:
            raise DataError(
                f"{path}, line {number}: the subject of {row['clip']} is {subject!r}, and {said.subject!r} above"
            )
        said.subject = subject or said.subject
        said.action = row.get("description", "") or said.action
        said.gaits = tuple(filter(None, map(str.strip, row.get("gait", "").split(",")))) or said.gaits
    return {clip: said for clip, said in found.items() if clip and said.sentences}


@dataclass(frozen=True)
class Person:
    """Who moves in the clips of a pattern, and the take that these are parts of, "" where each is its own."""

    pattern: str
    subject: str
    take: str = ""


def read_people(path: Path) -> tuple[Person, ...]:
    """Who moves in which clips: a table with the columns ``clip`` and ``subject``, and ``take`` if wanted.

    A clip may be a pattern, as "ACCAD_Male1_*"; of several that fit the first counts. Clips of one take are never
    divided between training and test. DataError names the line that does not fit.
    """
    rows = _rows(path, "clip", "subject")
    return tuple(Person(row["clip"], row["subject"], row.get("take", "")) for _, row in rows)


def person(people: tuple[Person, ...], clip: str) -> Person:
    """Who moves in a clip; who is not in the table is called by the clip's name up to its first "_"."""
    plain = clip.rpartition("/")[2]
    fits = (row for row in people if fnmatchcase(plain, row.pattern))
    return next(fits, Person(plain, plain.split("_")[0]))


def _rows(path: Path, *needed: str) -> Iterator[tuple[int, dict[str, str]]]:
    """The lines of a table with their numbers, each by the header's columns."""
    try:
        lines = [line.split("\t") for line in path.read_text(encoding="utf-8-sig").split("\n")]
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the table {path} cannot be read: {error}") from error
    header = [name.strip() for name in lines[0]] if lines else []
    if not set(needed) <= set(header):
        wanted = " and ".join(needed)
        raise DataError(f"{path}, line 1: the header needs the columns {wanted}, with tabs between: {header}")
    for number, line in enumerate(lines[1:], start=2):
        if line == [""]:
            continue
        if len(line) != len(header):
            raise DataError(f"{path}, line {number}: {len(line)} columns where the header has {len(header)}")
        yield number, dict(zip(header, map(str.strip, line), strict=True))
