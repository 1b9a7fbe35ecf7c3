"""Recordings of a store whose gaits are played: on level ground, with shoulders that hang alike, without flaws."""

from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from motet.figures.feet.contacts import GROUND_PERCENT, ContactSettings, contacts, ground_speeds
from motet.figures.humanoid import HUMANOID, sole_points
from motet.motion.kinematics import global_transforms
from motet.motion.motion import Motion
from motet.motion.rotations import inverse, product, rotated, rotmat_to_rotvec, swing
from motet.representation.contract import named
from motet.representation.root_sixd import SIXD_KINDS, joint_rotations, rotmat_to_sixd
from motet_train.data.errors import DataError
from motet_train.data.store import Store
from motet_train.data.table import Gait, read_gaits

LEVELLED = ContactSettings(heights=(0.05, 0.08))
"""Of soles that show where the ground is."""

LEVEL_FOR = 0.1
"""Seconds, the standard deviation of the window over which ground is level."""

SLOPE = 10.0
"""Degrees by which collar bones of people whose arms hang slope, more than in a T-pose."""


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
    """The recordings of a store that show gaits, of 1.5 s or more; DataError where a gait has none.

    held: their feet are held to level ground, and their collar bones slope alike; else they are as recorded.
    """
    representation, found = named(store.representation), list[Recording]()
    for index, record in enumerate(store.records):
        shown = frozenset(g.name for g in gaits if g.name in record.gaits or g.shown(record.shows, record.subject))
        if not shown:
            continue
        features = store.motion(index)
        if held:
            features = _with_even_collars(_levelled(representation.planted(features)))
        pieces = _jumps(features) if shown == {"jump"} else _sound(features)
        found += [Recording(piece, shown) for piece in pieces if len(piece) >= 1.5 * store.fps]
    missing = [gait.name for gait in gaits if not any(gait.name in one.gaits for one in found)]
    if missing:
        how = "name gaits in a column gait of the table of sentences, or give motet prepare a table of them, --gaits"
        raise DataError(f"no recording of 1.5 s shows the gait {missing[0]!r}: {how}")
    return found


def _levelled(features: Motion) -> Motion:
    """A recording on level ground: floors of recordings rise and fall by centimetres, even within a step, and feet that
    seem to float are not held. The ground is where the lowest point of the soles is, as far as it is slow and low."""
    from scipy.ndimage import gaussian_filter1d  # for this alone, so that other trainings do not load it

    soles = sole_points(*global_transforms(named("root_sixd").motion(features)))
    lowest, which = soles[..., 1].min(axis=1), soles[..., 1].argmin(axis=1)
    speeds = np.take_along_axis(ground_speeds(soles, features.fps), which[1:, None], axis=1)[:, 0]
    stands = contacts(lowest[1:] - np.percentile(lowest, GROUND_PERCENT), speeds, LEVELLED)
    weights, window = np.append(stands[:1], stands) + 1e-6, LEVEL_FOR * features.fps
    ground = gaussian_filter1d(weights * lowest, window) / gaussian_filter1d(weights, window)
    values = features.values.copy()
    values[:, features.channels.index("root.height")] -= ground
    return replace(features, values=values)


def _with_even_collars(features: Motion) -> Motion:
    """A recording whose collar bones slope by :data:`SLOPE` on average, arms as they were: systems of markers let them
    slope by nothing (CMU's) to 40 degrees (ACCAD's), with which the shoulders of other figures droop."""
    local, values = joint_rotations(features), features.values.copy()
    for side in ("left", "right"):
        x, *_ = rest = HUMANOID.offsets[HUMANOID.index(f"{side}UpperArm")]
        collar, arm = local[f"{side}Shoulder"], local[f"{side}UpperArm"]
        sloping = np.array([x, -abs(x) * np.tan(np.radians(SLOPE)), 0.0])
        even = product(swing(rotated(collar, rest).mean(axis=0), sloping), collar)
        hanging = product(product(inverse(even), collar), arm)
        for bone, turns in ((f"{side}Shoulder", even), (f"{side}UpperArm", hanging)):
            columns = [features.channels.index(f"{bone}.{kind}") for kind in SIXD_KINDS]
            values[:, columns] = rotmat_to_sixd(turns)
    return replace(features, values=values)


def _sound(features: Motion) -> list[Motion]:
    """The parts of a recording without flaws, where a bone other than the toes turns by over 45 degrees in a frame.

    Its first and last frames, where flaws are common, are left out.
    """
    turns = [
        np.degrees(np.linalg.norm(rotmat_to_rotvec(np.swapaxes(local[:-1], 1, 2) @ local[1:]), axis=1))
        for bone, local in joint_rotations(features).items()
        if not bone.endswith("Toes")
    ]
    flaws = np.flatnonzero(np.max(turns, axis=0) > 45.0)
    edges = [1, *(flaws + 1).tolist(), len(features) - 1]
    return [features[start:stop] for start, stop in pairwise(edges) if stop > start]


def _jumps(features: Motion) -> list[Motion]:
    """The parts of a recording up to half a second before and after the hips are 6 cm above their median height."""
    height, reach = features.select(("root.height",)).values[:, 0], round(0.5 * features.fps)
    high = np.convolve(height > np.median(height) + 0.06, np.ones(2 * reach + 1), "same") > 0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], high, [False]]).astype(int))).reshape(-1, 2)
    return [features[start:stop] for start, stop in edges.tolist()]
