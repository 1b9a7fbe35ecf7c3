"""The recordings of gaits in a store, on level ground, with even collar bones, and without flaws."""

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
from motet_train.data.store import Entry, Store
from motet_train.data.table import Gait, read_gaits

LEVELLED = ContactSettings(heights=(0.05, 0.08))
"""Contacts of soles that show where the ground is."""

LEVEL_FOR = 0.1
"""Standard deviation, in seconds, of the window over which the height of the ground is averaged."""

COLLAR_SLOPE = 10.0
"""Degrees by which collar bones slope below the horizontal when the arms hang."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording. features: its motion in ``root_sixd``. gaits: names of the gaits that it shows."""

    features: Motion
    gaits: frozenset[str]


def gaits_of(store: Store) -> tuple[Gait, ...]:
    """The gaits that a store's records name, by decreasing number of frames; CMU's and ACCAD's if none are named."""
    frames = Counter[str]()
    for record in store.records:
        count = sum(stop - start for start, stop in record.spans)
        frames.update(dict.fromkeys(record.gaits, count))
    return tuple(Gait(name, (), ()) for name, _ in frames.most_common()) or read_gaits()


def recordings(store: Store, gaits: tuple[Gait, ...], held: bool = True) -> list[Recording]:
    """The recordings of a store that show gaits, of 1.5 s or more; DataError where a gait has none.

    held: put feet on level ground and give collar bones the same slope; otherwise motions stay as recorded.
    """
    representation = named(store.representation)
    kept: list[Recording] = []
    for index, record in enumerate(store.records):
        # recordings of gaits, in their usable parts
        names = frozenset(gait.name for gait in gaits if _shows(record, gait))
        if not names:
            continue
        features = store.motion(index)
        if held:
            features = _with_even_collars(_levelled(representation.planted(features)))
        pieces = _jumps(features) if names == {"jump"} else _sound(features)
        kept += [Recording(piece, names) for piece in pieces if len(piece) >= 1.5 * store.fps]
    # every gait needs one
    recorded_gaits = frozenset[str]().union(*(recording.gaits for recording in kept))
    for gait in gaits:
        if gait.name not in recorded_gaits:
            raise DataError(
                f"no recording of 1.5 s shows the gait {gait.name!r}: name gaits in a column gait of the table of "
                "sentences, or give motet prepare a table of them, --gaits"
            )
    return kept


def _shows(record: Entry, gait: Gait) -> bool:
    return gait.name in record.gaits or gait.shown(record.shows, record.subject)


def _levelled(features: Motion) -> Motion:
    """A recording on level ground.

    Recorded floors rise and fall by centimetres, even within a step, and the lock does not hold feet that seem to
    float. The ground is the height of the soles' lowest point, averaged over frames in which it is slow and low.
    """
    from scipy.ndimage import gaussian_filter1d  # here, so that other trainings do not load scipy

    soles = sole_points(*global_transforms(named("root_sixd").motion(features)))
    lowest = soles[..., 1].min(axis=1)
    lowest_point = soles[..., 1].argmin(axis=1)
    # weight frames in which that point is in contact
    speeds = np.take_along_axis(ground_speeds(soles, features.fps), lowest_point[1:, None], axis=1)[:, 0]
    heights = lowest[1:] - np.percentile(lowest, GROUND_PERCENT)
    stands = contacts(heights, speeds, LEVELLED)
    weights = np.append(stands[:1], stands) + 1e-6
    # subtract the weighted running mean
    window = LEVEL_FOR * features.fps
    ground = gaussian_filter1d(weights * lowest, window) / gaussian_filter1d(weights, window)
    values = features.values.copy()
    values[:, features.channels.index("root.height")] -= ground
    return replace(features, values=values)


def _with_even_collars(features: Motion) -> Motion:
    """A recording whose collar bones slope by :data:`COLLAR_SLOPE` on average; the arms keep their directions.

    Marker sets give them slopes of 0 (CMU's) to 40 degrees (ACCAD's), with which other figures' shoulders droop.
    """
    local = joint_rotations(features)
    values = features.values.copy()
    for side in ("left", "right"):
        collar = local[f"{side}Shoulder"]
        arm = local[f"{side}UpperArm"]
        # swing the collar bone's mean direction to the desired one
        rest = HUMANOID.offsets[HUMANOID.index(f"{side}UpperArm")]
        sloping = np.array([rest[0], -abs(rest[0]) * np.tan(np.radians(COLLAR_SLOPE)), 0.0])
        even_collar = product(swing(rotated(collar, rest).mean(axis=0), sloping), collar)
        # the upper arm undoes that
        same_arm = product(product(inverse(even_collar), collar), arm)
        for bone, rotations in ((f"{side}Shoulder", even_collar), (f"{side}UpperArm", same_arm)):
            columns = [features.channels.index(f"{bone}.{kind}") for kind in SIXD_KINDS]
            values[:, columns] = rotmat_to_sixd(rotations)
    return replace(features, values=values)


def _sound(features: Motion) -> list[Motion]:
    """The parts of a recording between flaws: frames in which a bone other than the toes turns by over 45 degrees.

    The first and last frames of the recording, where flaws are common, are left out.
    """
    turns = []
    for bone, local in joint_rotations(features).items():
        if not bone.endswith("Toes"):
            steps = np.swapaxes(local[:-1], 1, 2) @ local[1:]
            turns.append(np.degrees(np.linalg.norm(rotmat_to_rotvec(steps), axis=1)))
    flaws = np.flatnonzero(np.max(turns, axis=0) > 45.0)
    edges = [1, *(flaws + 1).tolist(), len(features) - 1]
    return [features[start:stop] for start, stop in pairwise(edges) if stop > start]


def _jumps(features: Motion) -> list[Motion]:
    """The parts of a recording from half a second before to half a second after the hips rise 6 cm above their median
    height."""
    height = features.select(("root.height",)).values[:, 0]
    reach = round(0.5 * features.fps)
    rises = height > np.median(height) + 0.06
    within_reach = np.convolve(rises, np.ones(2 * reach + 1), "same") > 0
    # pairs of frames where a part begins and ends
    padded = np.concatenate([[False], within_reach, [False]]).astype(int)
    edges = np.flatnonzero(np.diff(padded)).reshape(-1, 2)
    return [features[start:stop] for start, stop in edges.tolist()]
