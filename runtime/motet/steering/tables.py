"""The tables of a steered figure's bundle, made of rows: features in 8 bits, and poses in few codes.

Letters in shapes: N rows, F features, G gaits, K codes, and P = 4 J + 1 numbers of a pose of J bones.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import HUMANOID
from motet.motion.rotations import Array
from motet.steering.matching import LEAST_PACE, is_faster, stride_velocities
from motet.steering.pose import BONE_JOINTS
from motet.steering.rows import MatchingRows, mirrored_poses, scaling
from motet.steering.settings import SteeringSettings

FEATURE_STEPS = 16
"""Steps of a scaled unit of a feature in a table, whose features have 8 bits."""

Speeds = tuple[float, float, float, float, float]
"""Of a gait in m/s: the slowest, the usual one, and the fastest forward, sideways and backwards; 0 where it does not go
that way."""

DTYPE_OF_TABLE = {
    "codes": np.float16,
    "moves": np.float32,
    "features": np.int8,
    "shows": np.uint8,
    "left": np.int32,
    "feature_mean": np.float32,
    "feature_scale": np.float32,
    "pose_mean": np.float32,
    "pose_basis": np.float16,
}
"""Of the tables of a bundle, by name: :class:`motet.steering.model.SteerModel`."""


def tables_of(rows: MatchingRows, even: int, odd: int) -> dict[str, NDArray[Any]]:
    """The tables, not yet in their dtypes, with the principal components of poses and mirrored poses as codes: so many
    that a mirror image has alike, and with the other sign."""
    mean, scale = (part.round(6) for part in scaling(rows.features))
    return {
        **_pose_codes(rows.poses, even, odd),
        "moves": np.column_stack([rows.moves, rows.speed, rows.contacts]),
        "features": np.clip(np.round((rows.features - mean) * scale * FEATURE_STEPS), -127, 127),
        "shows": rows.gaits,
        "left": rows.left,
        "feature_mean": mean,
        "feature_scale": scale,
    }


def _pose_codes(poses: Array, even: int, odd: int) -> dict[str, Array]:
    """Codes of poses (N, P), and the mean and the basis from which they are decoded; how many a mirror image has alike,
    and with the other sign."""
    # relative to the mean of all poses and their mirror images, weighted by reach
    columns, signs = mirrored_poses()
    mean_pose = poses.mean(axis=0)
    pose_mean = (mean_pose + mean_pose[columns] * signs) / 2
    offsets = poses - pose_mean
    weights = _reach()

    # components that a mirror image has alike, and with the other sign
    mirrored = offsets[:, columns] * signs
    alike = _components((offsets + mirrored) / 2 * weights, even)
    opposite = _components((offsets - mirrored) / 2 * weights, odd)
    basis = np.concatenate([alike, opposite])
    return {"codes": offsets * weights @ basis.T, "pose_mean": pose_mean, "pose_basis": basis / weights}


def _components(offsets: Array, count: int) -> Array:
    """The first ``count`` principal components (count, P) of offsets (N, P), by about 4,000 of them."""
    every = max(1, len(offsets) // 4000)
    _, _, components = np.linalg.svd(offsets[::every], full_matrices=False)
    first: Array = components[:count]
    return first


def _reach() -> Array:
    """The weight (P,) of each number of a pose: for a bone's quaternion the metres to the farthest joint that it
    carries, at least 5 cm."""
    # places of joints at rest
    places = np.zeros((len(HUMANOID.names), 3))
    for joint, parent in enumerate(HUMANOID.parents.tolist()):
        if parent >= 0:
            places[joint] = places[parent] + HUMANOID.offsets[joint]
    # the farthest joint that each bone carries
    reach = []
    for bone in BONE_JOINTS:
        carried = [bone, *HUMANOID.below(bone)]
        reach.append(np.linalg.norm(places[carried] - places[bone], axis=1).max())
    return np.append(np.repeat(np.maximum(reach, 0.05), 4), 1.0)


def speeds_of(rows: MatchingRows, settings: SteeringSettings) -> tuple[Speeds, ...]:
    """The speeds of each gait (:func:`_speeds`)."""
    return tuple(_speeds(rows, in_gait, settings) for in_gait in rows.gaits.T)


def _speeds(rows: MatchingRows, in_gait: NDArray[np.bool_], settings: SteeringSettings) -> Speeds:
    """The speeds that a gait allows, as its rows can be played slower and faster; all 0 if it has no moving rows.

    The lowest is the 30th percentile of its moving rows, with shorter strides, or the slowest pace if that is a creep.
    The highest in each direction is the 90th percentile of its rows, or, if that is less, as for side steps, of means
    over a stride, with the longest strides; 0 for directions with at most a second of rows.
    """
    speed = rows.speed[in_gait]
    moving = speed > settings.idle
    if not moving.any():
        return (0.0,) * 5

    # rows, and means over a stride, by their direction: ahead, aside or back
    sectors = _sectors(rows.moves[in_gait], settings, right=True)
    strides = stride_velocities(rows.moves[:, :2], rows.left)[in_gait]
    stride_speeds = np.hypot(*strides.T)
    stride_moving = stride_speeds > settings.idle
    stride_sectors = _sectors(strides, settings, right=False)
    fastest = []
    for sector in range(3):
        row_speeds = speed[moving & (sectors == sector)]
        long_speeds = stride_speeds[stride_moving & (stride_sectors == sector)]
        fastest.append(_fastest(row_speeds, long_speeds, settings))
    ahead, aside, back = fastest
    return _slowest(speed, moving, settings), _median(speed[moving & (sectors == 0)]), ahead, aside, back


def _median(speeds: Array) -> float:
    """The median of speeds, m/s."""
    return round(float(np.median(speeds)), 2)


def _sectors(velocities: Array, settings: SteeringSettings, right: bool) -> NDArray[np.intp]:
    """The direction (N,) of velocities (N, 2 or more), forward and left: 0 ahead, 1 aside, 2 back. right: whether an
    angle on a bound counts as the smaller one."""
    angles = np.abs(np.arctan2(velocities[:, 1], velocities[:, 0]))
    return np.digitize(angles, (settings.aside, settings.back), right=right)


def _slowest(speed: Array, moving: NDArray[np.bool_], settings: SteeringSettings) -> float:
    """The lowest speed of a gait by the speeds of its rows, m/s."""
    slowest = round(float(np.percentile(speed[moving], 30.0)) * settings.slowest * settings.shortest, 2)
    return LEAST_PACE if slowest <= settings.creep and is_faster(speed, settings) else slowest


def _fastest(row_speeds: Array, stride_speeds: Array, settings: SteeringSettings) -> float:
    """The highest speed of a direction by the speeds of its rows and strides, m/s; 0 for too few."""
    if len(row_speeds) <= 30 or not len(stride_speeds):
        return 0.0
    by_strides = np.percentile(stride_speeds, 90.0) * settings.longest
    return round(float(min(np.percentile(row_speeds, 90.0), by_strides) * settings.fastest), 2)
