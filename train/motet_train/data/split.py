"""Dividing a corpus into training, validation and test motions: never a motion with some of its sentences elsewhere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet_train.data.errors import DataError
from motet_train.data.store import Entry

SHARE = 0.1
"""Of the motions in the validation and in the test part each (Plappert et al. 2017, section 5.1: .8/.1/.1)."""


@dataclass(frozen=True)
class Split:
    """Indices into the entries of a store, sorted."""

    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]


def split(entries: Sequence[Entry], seed: int, by: str = "trial") -> Split:
    """Divide motions .8/.1/.1 by chance, the same for the same seed.

    by: "trial", which keeps the pieces of a take together, or "subject" to keep all motions of a person together, so
        that validation and test show people never seen in training; these parts then have at most .1 each. DataError
        where a part would be empty.
    """
    if by not in ("trial", "subject"):
        raise DataError(f"motions are split by trial or by subject, not by {by!r}")
    groups: dict[str, list[int]] = {}
    for index, entry in enumerate(entries):
        groups.setdefault(entry.subject if by == "subject" else entry.take or entry.name, []).append(index)
    wanted = max(1, round(SHARE * len(entries)))
    parts: list[list[int]] = [[], [], []]
    for key in np.random.default_rng(seed).permutation(sorted(groups)).tolist():
        room = [2, 1, 0] if len(parts[1]) >= len(parts[2]) else [1, 2, 0]
        fits = (part for part in room if part == 0 or len(parts[part]) + len(groups[key]) <= wanted)
        parts[next(fits)].extend(groups[key])
    if not all(parts):
        who = (
            " (who moved: the column subject of the table, or else the name up to its first _)"
            if by == "subject"
            else ""
        )
        raise DataError(
            f"{len(entries)} motions of {len(groups)} {by}s are too few for training, validation and test{who}"
        )
    train, validation, test = (tuple(sorted(part)) for part in parts)
    return Split(train, validation, test)
