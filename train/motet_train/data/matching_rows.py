"""The rows of motion matching: what a loop needs to know of each recorded frame (:mod:`motet.decode.matching`)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.decode.matching import HORIZONS, SteeringSettings, horizons, mirrored_features, speed_feature
from motet.motion.feet.contacts import contacts_of
from motet.motion.humanoid import BONES, HUMANOID, LEFT_RIGHT, ground_under, sided, sole_points
from motet.motion.kinematics import global_transforms
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_quat
from motet.motion.skeleton import partners_of
from motet.representation.contract import named
from motet.representation.root_sixd import ROOT_SIXD, joint_rotations
from motet_train.data.locomotion import Recording
from motet_train.data.sixd_windows import poses_of

WEIGHTS = {
    "places": 1.0,
    "facings": 1.5,
    "speed": 2.5,
    "feet": 0.75,
    "feet_speeds": 1.0,
    "hips_speed": 1.0,
    "hands": 0.5,
}
"""How much each group of features counts; most as in Holden's "Learned Motion Matching" (2020)."""

LENGTHS = (2 * HORIZONS, 2 * HORIZONS, 1, 6, 6, 3, 6)
"""Of the groups."""

AS_RECORDED = frozenset({"jump"})
"""Gaits that are played neither faster nor slower: what flies falls as it does."""

STEADY = 0.5
"""Seconds over which the speed of a row is the mean."""

TRACKED = ("hips", *(sided(side, part) for part in ("Toes", "Hand") for side in LEFT_RIGHT))


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
    """The rows of recordings on the humanoid; quaternions of a bone lie on one half of their sphere, where they can.

    Those of gaits in ``AS_RECORDED`` have no speed: they are played as they are.
    """
    parts = [_rows(one.features, how) for one in found]
    poses, moves, speed, contacts, features = (np.concatenate(column) for column in zip(*parts, strict=True))
    lengths = [len(one.features) for one in found]
    shown = np.repeat([[gait in one.gaits for gait in gaits] for one in found], lengths, axis=0)
    speed = np.where(np.repeat([one.gaits <= AS_RECORDED for one in found], lengths), 0.0, speed)
    left = np.concatenate([np.arange(length)[::-1] for length in lengths])
    return MatchingRows(_aligned(poses), moves, speed, contacts, features, shown, left)


def _rows(features: Motion, how: SteeringSettings) -> tuple[Array, Array, Array, Array, Array]:
    turned, places = global_transforms(named("root_sixd").motion(features))
    block = features.select(ROOT_SIXD).values
    way = poses_of(block, features.fps)  # x, z, facing
    soles = sole_points(turned, places)
    soles[..., 1] -= ground_under(soles)
    touch = contacts_of(soles, features.fps).reshape(-1, 2, 3).max(axis=2)
    contacts = np.concatenate([touch[:1], touch])
    speed = _mean(np.hypot(block[:, 0], block[:, 1]), round(STEADY * features.fps))
    local = joint_rotations(features)
    quats = np.stack([rotmat_to_quat(local[bone]) for bone in BONES], axis=1)
    poses = np.column_stack([quats.reshape(len(features), -1), block[:, 3]])
    points = places[:, [HUMANOID.index(joint) for joint in TRACKED]]
    times = horizons(how)
    soon = speed[np.minimum(np.arange(len(speed)) + round(times[1] * features.fps), len(speed) - 1)]
    known = [_trajectory(way, times, features.fps), speed_feature(soon, how)[:, None], _now(points, way, features.fps)]
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


def seen(vectors: Array, facing: Array) -> Array:
    """Vectors (T, 2) over the ground, x and z, as left and forward (T, 2) of a facing (T,)."""
    cos, sin = np.cos(facing), np.sin(facing)
    return np.stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]], axis=1)


def _now(points: Array, way: Array, fps: float) -> Array:
    """The features (T, 21) of points (T, 5, 3) in the world, of hips, feet and hands."""
    speeds = np.gradient(points, axis=0) * fps
    from_root = points - np.insert(way[:, None, :2], 1, 0.0, axis=2)
    groups = (from_root[:, 1:3], speeds[:, 1:3], speeds[:, :1], from_root[:, 3:])
    turned = [_turned(values, way[:, 2]) for values in groups]
    return np.concatenate([values.reshape(len(points), -1) for values in turned], axis=1)


def _turned(points: Array, facing: Array) -> Array:
    found = np.array(points)
    for joint in range(points.shape[1]):
        found[:, joint, [0, 2]] = seen(points[:, joint][:, [0, 2]], facing)
    return found


def _mean(values: Array, count: int) -> Array:
    """The mean over so many values around each."""
    window = np.ones(min(count, len(values)))
    found: Array = np.convolve(values, window, "same") / np.convolve(np.ones(len(values)), window, "same")
    return found


def _aligned(poses: Array) -> Array:
    """Quaternions with the signs that are nearest to their bone's mean one; the mirror image keeps to the same."""
    quats = poses[:, :-1].reshape(len(poses), -1, 4)
    mean = quats[0]
    for _ in range(3):
        quats = np.where((quats * mean).sum(axis=-1, keepdims=True) < 0, -quats, quats)
        mean = quats.mean(axis=0)
    return np.column_stack([quats.reshape(len(poses), -1), poses[:, -1]])


def mirrored_poses() -> tuple[NDArray[np.intp], Array]:
    """Of which columns (P,), with which signs (P,), the pose of a mirror image is made."""
    partners = np.array(partners_of(BONES))
    columns = (4 * partners[:, None] + np.arange(4)).ravel()
    signs = np.tile([1.0, -1.0, -1.0, 1.0], len(BONES))
    return np.append(columns, len(columns)), np.append(signs, 1.0)


def scaling(features: Array) -> tuple[Array, Array]:
    """Mean and scale (F,) that weigh groups of features; a mirror image is scaled alike."""
    columns, signs = mirrored_features()
    both = np.concatenate([features, features[:, columns] * signs])
    groups = np.split(both.var(axis=0), np.cumsum(LENGTHS)[:-1])
    scale = [weight / np.sqrt(group.mean()) for weight, group in zip(WEIGHTS.values(), groups, strict=True)]
    return both.mean(axis=0), np.repeat(scale, LENGTHS)
