"""Recordings that a figure is steered by: which of a store they are, by gait, their feet held to the ground."""

from collections import Counter
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from motet.motion.motion import Motion
from motet.motion.rotations import rotmat_to_rotvec
from motet.representation.contract import named
from motet.representation.root_sixd import joint_rotations
from motet_train.data.errors import DataError
from motet_train.data.gaits import Gait, read_gaits
from motet_train.data.sixd_windows import action_of
from motet_train.data.store import Store

SHORTEST = 1.5
"""Seconds that a recording lasts at least."""

LARGEST = 45.0
"""Degrees that a bone but the toes turns between two frames at most; where it turns more, the recording has a flaw."""

HEIGHT, AROUND = 0.06, 0.5
"""A jump is where the hips rise so many metres above where they mostly are; and so many seconds before and after."""


@dataclass(frozen=True, eq=False)
class Recording:
    """features: a motion in ``root_sixd``. gaits: names of those that it shows."""

    features: Motion
    gaits: frozenset[str]


def gaits_of(store: Store) -> tuple[Gait, ...]:
    """The gaits that a store's records name, that of the most frames first; CMU's and ACCAD's where none is named."""
    frames = Counter[str]()
    for record in store.records:
        frames.update(dict.fromkeys(record.gaits, sum(stop - start for start, stop in record.spans)))
    return tuple(Gait(name, (), ()) for name, _ in frames.most_common()) or read_gaits()


def recordings(store: Store, gaits: tuple[Gait, ...], held: bool = True) -> list[Recording]:
    """The recordings of a store that show gaits; DataError where a gait has none. held: their feet are held."""
    representation, found = named(store.representation), list[Recording]()
    for index, record in enumerate(store.records):
        action = action_of(store, index)
        shown = frozenset(g.name for g in gaits if g.name in record.gaits or g.shown(action, record.subject))
        if not shown:
            continue
        features = store.motion(index)
        if held:
            features = representation.planted(features)
        pieces = _jumps(features) if shown == {"jump"} else _sound(features)
        found += [Recording(piece, shown) for piece in pieces if len(piece) >= SHORTEST * store.fps]
    missing = [gait.name for gait in gaits if not any(gait.name in one.gaits for one in found)]
    if missing:
        how = "name gaits in a column gait of the table of sentences, or give motet prepare a table of them, --gaits"
        raise DataError(f"no recording of {SHORTEST:g} s shows the gait {missing[0]!r}: {how}")
    return found


def _sound(features: Motion) -> list[Motion]:
    """The parts of a recording without flaws; its first and last frames, where such are mostly, are left out."""
    turns = [
        np.degrees(np.linalg.norm(rotmat_to_rotvec(np.swapaxes(local[:-1], 1, 2) @ local[1:]), axis=1))
        for bone, local in joint_rotations(features).items()
        if not bone.endswith("Toes")
    ]
    flaws = np.flatnonzero(np.max(turns, axis=0) > LARGEST)
    edges = [1, *(flaws + 1).tolist(), len(features) - 1]
    return [features[start:stop] for start, stop in pairwise(edges) if stop > start]


def _jumps(features: Motion) -> list[Motion]:
    """The parts of a recording in which somebody jumps, without the standing between."""
    height, reach = features.select(("root.height",)).values[:, 0], round(AROUND * features.fps)
    high = np.convolve(height > np.median(height) + HEIGHT, np.ones(2 * reach + 1), "same") > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(int))).reshape(-1, 2)
    return [features[start:stop] for start, stop in edges.tolist()]
