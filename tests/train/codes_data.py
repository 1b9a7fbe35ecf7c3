"""Walkers in ``root_sixd``, each shown as one of a few actions, and tiny nets for their codes."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from language_data import walker
from stores import prepare

from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.representation.contract import MotionContract
from motet.representation.root_sixd import ROOT_SIXD, ROOT_SIXD_UNITS, SIXD_KINDS
from motet_train.data.corpus import Record
from motet_train.data.preparation import Preparation
from motet_train.data.store import Store

ACTIONS = {
    "walk": ("a person walks", "someone walks along", "walking"),
    "turn left": ("a person turns left", "someone goes to the left"),
    "turn right": ("a person turns right", "someone goes to the right"),
    "run": ("a person runs", "running ahead"),
}
"""What is shown, and what is said of it."""

PREPARATION = Preparation("root_sixd", humanoid=False, trim=False, cut=False, fps=30.0)

CODEC = """
[training]
steps = 6
every = 3
batch = 8
warm_up = 0
cosine = false
precision = "float32"
[model]
moves = 8
groups = 2
levels = [3, 5]
width = 12
blocks = 1
ahead = [1, 0]
fine = 6
[visits]
frames = 16
"""

CODES = """
[training]
steps = 6
every = 3
batch = 4
warm_up = 0
falling = 0.0
precision = "float32"
[model]
width = 12
layers = 2
heads = 2
action = 5
ages = 6
[visits]
window = 6
"""

TEXT = """
[training]
steps = 6
every = 3
batch = 8
falling = 0.0
[model]
embedding = 6
hidden = 5
"""


def humanoid_contract(root: Sequence[float] = (0.0, 0.0, 0.0, 0.95), std: float = 0.2) -> MotionContract:
    """Of frames in ``root_sixd`` whose mean has all joints at rest; root: the mean of the root's four numbers."""
    channels = (*ROOT_SIXD, *(f"{bone}.{kind}" for bone in BONES for kind in SIXD_KINDS))
    units = (*ROOT_SIXD_UNITS, *("1",) * (len(channels) - len(ROOT_SIXD)))
    mean = np.array([*root, *(1.0, 0.0, 0.0, 0.0, 1.0, 0.0) * len(BONES)])
    return MotionContract("root_sixd", channels, units, 30.0, mean, np.full(len(channels), std), HUMANOID)


def records(count: int = 20) -> Iterator[Record]:
    """Motions of 1.3 to 1.8 seconds, each with an action, its sentences, and one for measuring."""
    for i in range(count):
        action = list(ACTIONS)[i % len(ACTIONS)]
        said = ACTIONS[action]
        yield Record(f"{i:02}", f"{i % 4}", walker(i, 40 + i % 15), said, (f"{said[0]} slowly",), action=action)


def small_store(folder: Path, count: int = 20) -> Store:
    """The walkers at 30 Hz, in ``folder``/store."""
    return prepare(records(count), folder / "store", PREPARATION)


def without_actions(store: Store) -> Store:
    """The same, nobody having said what is shown."""
    return replace(store, records=tuple(replace(entry, action="") for entry in store.records))
