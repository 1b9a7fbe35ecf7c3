"""Recordings that a figure is steered by: on level ground, with even collar bones, and without flaws."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from motet.figures.feet.contacts import GROUND_PERCENT, ContactSettings, contacts, ground_speeds
from motet.figures.humanoid import HUMANOID, sole_points
from motet.motion.kinematics import global_transforms
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotated, rotmat_to_rotvec, swing
from motet.representation.contract import named
from motet.representation.root_sixd import SIXD_KINDS, joint_rotations, rotmat_to_sixd

SHORTEST_RECORDING = 1.5
"""Shortest recording, in seconds."""

LEVELLED = ContactSettings(heights=(0.05, 0.08))
"""Contacts of soles that show where the ground is."""

LEVEL_FOR = 0.1
"""Standard deviation, in seconds, of the window over which the height of the ground is averaged."""

COLLAR_SLOPE = 10.0
"""Degrees by which collar bones slope below the horizontal when the arms hang."""

COLLARS = {side: HUMANOID.offsets[HUMANOID.index(f"{side}UpperArm")] for side in ("left", "right")}
"""Collar bones (3,) of the humanoid at rest, in metres."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A recording. features: its motion in ``root_sixd``. gaits: names of the gaits that it shows. as_recorded: whether
    it is played at its own rate only, as jumps and acts are."""

    features: Motion
    gaits: frozenset[str]
    as_recorded: bool = False


def held_level(features: Motion) -> Motion:
    """A recording with its feet held, on level ground, and with even collar bones."""
    return with_even_collars(levelled(named("root_sixd").planted(features)))


def parts_of(features: Motion, gaits: frozenset[str], as_recorded: bool) -> list[Recording]:
    """The recordings of gaits in features in ``root_sixd``: their usable parts that are long enough."""
    pieces = _jumps(features) if gaits == {"jump"} else _sound(features)
    shortest = SHORTEST_RECORDING * features.fps
    return [Recording(piece, gaits, as_recorded) for piece in pieces if len(piece) >= shortest]


def levelled(features: Motion) -> Motion:
    """A recording on level ground.

    Recorded floors rise and fall by centimetres, even within a step, and the lock does not hold feet that seem to
    float. The ground is the height of the soles' lowest point, averaged over frames in which it is slow and low.
    """
    soles = sole_points(*global_transforms(named("root_sixd").motion(features)))
    lowest = soles[..., 1].min(axis=1)
    lowest_point = soles[..., 1].argmin(axis=1)
    # weight frames in which that point is in contact
    speeds = np.take_along_axis(ground_speeds(soles, features.fps), lowest_point[1:, None], axis=1)[:, 0]
    heights = lowest[1:] - np.percentile(lowest, GROUND_PERCENT)
    stands = contacts(heights, speeds, LEVELLED)
    weights = np.append(stands[:1], stands) + 1e-6
    # subtract the weighted running mean
    deviation = LEVEL_FOR * features.fps
    ground = _running_mean(weights * lowest, deviation) / _running_mean(weights, deviation)
    values = features.values.copy()
    values[:, features.channels.index("root.height")] -= ground
    return replace(features, values=values)


def _running_mean(values: Array, deviation: float) -> Array:
    """Values (T,) weighted by a Gaussian window of a standard deviation in frames, mirrored at both ends."""
    reach = int(4 * deviation + 0.5)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / deviation) ** 2)
    padded = np.pad(values, reach, mode="symmetric")
    return np.convolve(padded, window / window.sum(), mode="valid")


def with_even_collars(features: Motion) -> Motion:
    """A recording whose collar bones slope by :data:`COLLAR_SLOPE` on average; the arms keep their directions.

    Marker sets give them slopes of 0 (CMU's) to 40 degrees (ACCAD's), with which other figures' shoulders droop.
    """
    local = joint_rotations(features)
    turns = {}
    for side, collar in COLLARS.items():
        turns[side] = sloping(side, rotated(local[f"{side}Shoulder"], collar).mean(axis=0))
    return with_turned_collars(features, turns)


def sloping(side: str, direction: Array) -> Array:
    """The rotation matrix (3, 3) that swings a collar bone from a direction (3,), seen from the chest, to the slope."""
    outwards = COLLARS[side][0]
    return swing(direction, np.array([outwards, -abs(outwards) * np.tan(np.radians(COLLAR_SLOPE)), 0.0]))


def with_turned_collars(features: Motion, turns: dict[str, Array]) -> Motion:
    """Features whose collar bones are turned by a matrix (3, 3) a side, seen from the chest; arms keep directions."""
    local = joint_rotations(features)
    values = features.values.copy()
    for side, turn in turns.items():
        collar = local[f"{side}Shoulder"]
        turned_collar = product(turn, collar)
        # the upper arm undoes that
        same_arm = product(product(inverse(turned_collar), collar), local[f"{side}UpperArm"])
        for bone, rotations in ((f"{side}Shoulder", turned_collar), (f"{side}UpperArm", same_arm)):
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
