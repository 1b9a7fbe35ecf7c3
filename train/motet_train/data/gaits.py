"""Gaits: ways of moving that a figure is steered by, and which recordings show them."""

import tomllib
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

from motet_train.data.errors import DataError

CMU_ACCAD = Path(__file__).with_name("gaits.toml")
"""The gaits of the recordings that the bundle ``control`` is made of."""


@dataclass(frozen=True)
class Gait:
    """A way of moving. actions, people: patterns of what its recordings show, and of who does."""

    name: str
    actions: tuple[str, ...]
    people: tuple[str, ...]

    def shown(self, action: str, person: str) -> bool:
        """Whether a recording of a person's action shows it."""
        return _fits(action, self.actions) and _fits(person, self.people)


def read_gaits(path: Path = CMU_ACCAD) -> tuple[Gait, ...]:
    """A table of gaits: each a ``[[gait]]`` with a ``name``, ``actions`` and, where not everybody counts, ``people``.

    DataError where it cannot be read.
    """
    try:
        rows = tomllib.loads(path.read_text(encoding="utf-8"))["gait"]
        return tuple(Gait(row["name"], tuple(row["actions"]), tuple(row.get("people", ["*"]))) for row in rows)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise DataError(f"{path} is not a table of gaits: {error}") from error


def _fits(name: str, patterns: tuple[str, ...]) -> bool:
    return any(fnmatchcase(name, pattern) for pattern in patterns)
