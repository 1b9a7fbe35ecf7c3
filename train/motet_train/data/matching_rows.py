"""The rows of motion matching: what its loop needs to know of each recorded frame (:mod:`motet.steering.matching`).

Letters in shapes: T frames, N rows, J bones, F features, G gaits.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.figures.feet.contacts import ContactSettings
from motet.figures.humanoid import BONES
from motet.motion.kinematics import global_transforms
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.motion.skeleton import partners_of
from motet.representation.contract import named
from motet.representation.root_sixd import ROOT_SIXD, joint_rotations
from motet.steering.acts import foot_contacts, pose_features, seen
from motet.steering.matching import HORIZONS, horizons, mirrored_features, speed_feature
from motet.steering.settings import SteeringSettings
from motet_train.data.recorded import Recording
from motet_train.data.sixd_windows import poses_of

GROUPS = {
    "places": (2 * HORIZONS, 1.0),
    "facings": (2 * HORIZONS, 1.5),
    "speed": (1, 2.5),
    "feet": (6, 0.94),
    "feet_speeds": (6, 1.25),
    "hips_speed": (3, 1.0),
    "hands": (6, 0.5),
}
"""Groups of features, the length of each and its weight; most as in Holden's "Learned Motion Matching" (2020), but of
feet a quarter more, so that fewer feet that swing are to stand at once."""


STANDS = ContactSettings(heights=(0.03, 0.06), speeds=(0.2, 0.6))
"""Of soles of recordings on level ground: a foot that turns on its ball is not let go, one that lands is not held."""

LEAP, AROUND = 0.4, 0.3
"""Seconds of a flight that is no running step, and before and after it that belong to it."""


@dataclass(frozen=True, eq=False)
class MatchingRows:
    """N rows, recording after recording.

    poses: (N, 4 J + 1) quaternions (x, y, z, w) of the bones, the hips' seen from the facing, and the hips' height.
    moves: (N, 3) forward and left in m/s, turn in rad/s, since the frame before. speed: (N,). contacts: (N, 2) from 0
    to 1. features: (N, F), not scaled. gaits: (N, G) bool. left: (N,) rows that follow in the same recording.
    """

    poses: Array
    moves: Array
    speed: Array
    contacts: Array
    features: Array
    gaits: NDArray[np.bool_]
    left: NDArray[np.int64]

    def __len__(self) -> int:
        """N."""
        return len(self.poses)


def rows_of(found: list[Recording], gaits: tuple[str, ...], how: SteeringSettings) -> MatchingRows:
    """The rows of recordings on the humanoid, quaternions of a bone on one half of their sphere where they can be.

    Jumps have no speed, as they are played neither faster nor slower: who flies falls at a rate of its own. Leaps
    within other gaits show none: nobody is told to go where they lead.
    """
    parts = [_rows(one.features, how) for one in found]
    poses, moves, speed, contacts, features = (np.concatenate(column) for column in zip(*parts, strict=True))
    lengths = [len(one.features) for one in found]
    shown = np.repeat([[gait in one.gaits for gait in gaits] for one in found], lengths, axis=0)
    jumps = np.repeat([one.gaits <= {"jump"} for one in found], lengths)
    shown[~jumps & _leaps(contacts.max(axis=1) < how.stands, found[0].features.fps)] = False
    speed = np.where(jumps, 0.0, speed)
    left = np.concatenate([np.arange(length)[::-1] for length in lengths])
    return MatchingRows(_aligned(poses), moves, speed, contacts, features, shown, left)


def _leaps(flies: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """The rows (N,) of flights of :data:`LEAP` seconds and more, and of :data:`AROUND` seconds before and after."""
    from scipy.ndimage import binary_dilation, binary_opening  # for this alone, as above

    shortest, around = (np.ones(2 * round(of * fps / 2) + 1, dtype=bool) for of in (LEAP, 2 * AROUND))
    found: NDArray[np.bool_] = binary_dilation(binary_opening(flies, shortest), around)
    return found


def _rows(features: Motion, how: SteeringSettings) -> tuple[Array, Array, Array, Array, Array]:
    turned, places = global_transforms(named("root_sixd").motion(features))
    block = features.select(ROOT_SIXD).values
    way = poses_of(block, features.fps)  # x, z, facing
    contacts = foot_contacts(turned, places, features.fps, STANDS)
    speed = np.hypot(block[:, 0], block[:, 1])
    window = np.ones(min(round(0.5 * features.fps), len(speed)))  # half a second
    speed = np.convolve(speed, window, "same") / np.convolve(np.ones(len(speed)), window, "same")
    local = joint_rotations(features)
    quats = np.stack([rotmat_to_quat(local[bone]) for bone in BONES], axis=1)
    poses = np.column_stack([quats.reshape(len(features), -1), block[:, 3]])
    times = horizons(how)
    soon = speed[np.minimum(np.arange(len(speed)) + round(times[1] * features.fps), len(speed) - 1)]
    now = pose_features(places, way, features.fps)
    known = [_trajectory(way, times, features.fps), speed_feature(soon, how)[:, None], now]
    return poses, block[:, :3], speed, contacts, np.concatenate(known, axis=1)


def _trajectory(way: Array, times: list[float], fps: float) -> Array:
    """Where rows go (T, 12), so many seconds later; after the last one straight on, as fast as at the end."""
    last = len(way) - 1
    end = (way[last] - way[max(0, last - round(fps / 10))]) * fps / max(1, min(last, round(fps / 10)))
    found = []
    for time in times:
        at = np.arange(len(way)) + round(time * fps)
        beyond = np.maximum(at - last, 0)[:, None] / fps
        found.append(way[np.minimum(at, last)] - way + beyond * end * (1, 1, 0))
    places = [seen(step[:, :2], way[:, 2]) for step in found]
    facings = [np.stack([np.sin(step[:, 2]), np.cos(step[:, 2])], axis=1) for step in found]
    return np.concatenate(places + facings, axis=1)


def _aligned(poses: Array) -> Array:
    """Poses with the signs of quaternions that are nearest to their bone's mean one, also for the mirror image."""
    quats = poses[:, :-1].reshape(len(poses), -1, 4)
    mean = quats[0]
    for _ in range(3):
        quats = np.where((quats * mean).sum(axis=-1, keepdims=True) < 0, -quats, quats)
        mean = quats.mean(axis=0)
    return np.column_stack([quats.reshape(len(poses), -1), poses[:, -1]])


def mirrored_poses() -> tuple[NDArray[np.intp], Array]:
    """The columns (P,) and signs (P,) that make the pose of the mirror image."""
    partners = np.array(partners_of(BONES))
    columns = (4 * partners[:, None] + np.arange(4)).ravel()
    signs = np.tile([1.0, -1.0, -1.0, 1.0], len(BONES))
    return np.append(columns, len(columns)), np.append(signs, 1.0)


def scaling(features: Array) -> tuple[Array, Array]:
    """Mean and scale (F,) that weigh groups of features, the same for a mirror image."""
    columns, signs = mirrored_features()
    both = np.concatenate([features, features[:, columns] * signs])
    lengths, weights = zip(*GROUPS.values(), strict=True)
    groups = np.split(both.var(axis=0), np.cumsum(lengths)[:-1])
    scale = [weight / np.sqrt(group.mean()) for weight, group in zip(weights, groups, strict=True)]
    return both.mean(axis=0), np.repeat(scale, lengths)
