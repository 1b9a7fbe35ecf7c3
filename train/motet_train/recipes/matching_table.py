"""What motion matching is trained from: the table of rows, and the principal components of their poses."""

import numpy as np
import torch

from motet.models.steer import FEATURE_STEPS
from motet.motion.rotations import Array
from motet_train.data.matching_rows import MatchingRows, mirrored_poses, scaling
from motet_train.models.kinematics import Tree
from motet_train.models.matching import Matching

SHORTEST = 0.05
"""Metres: how far a bone that carries nothing counts as reaching."""

MOST = 4000
"""Poses that the components are found from."""


@torch.no_grad()
def take(net: Matching, rows: MatchingRows) -> None:
    """Fill a net with rows: their table, and codes that are the principal components of poses and mirrored poses."""
    mean, scale = (part.round(6) for part in scaling(rows.features))
    columns, signs = mirrored_poses()
    mean_pose = rows.poses.mean(axis=0)
    pose_mean = (mean_pose + mean_pose[columns] * signs) / 2
    weights, off = _reach(net.config.tree), rows.poses - pose_mean
    halves = [(off + sign * off[:, columns] * signs) / 2 * weights for sign in (1, -1)]
    axes = np.concatenate([_axes(half, n) for half, n in zip(halves, (net.config.even, net.config.odd), strict=True)])
    values = {
        "codes": off * weights @ axes.T,
        "moves": np.column_stack([rows.moves, rows.speed, rows.contacts]),
        "features": np.clip(np.round((rows.features - mean) * scale * FEATURE_STEPS), -127, 127),
        "shows": rows.gaits,
        "left": rows.left,
        "feature_mean": mean,
        "feature_scale": scale,
        "pose_mean": pose_mean,
        "pose_basis": axes / weights,
    }
    for name, value in values.items():
        getattr(net, name).copy_(torch.from_numpy(value))


def _axes(poses: Array, count: int) -> Array:
    """The first principal axes (count, P) of poses (N, P) about 0."""
    _, _, axes = np.linalg.svd(poses[:: max(1, len(poses) // MOST)], full_matrices=False)
    found: Array = axes[:count]
    return found


def _reach(tree: Tree) -> Array:
    """How far each bone carries others, metres: by so much the numbers (P,) of its quaternion count."""
    places = np.zeros((len(tree.parents), 3))
    for joint, parent in enumerate(tree.parents):
        if parent >= 0:
            places[joint] = places[parent] + tree.offsets[joint]
    far = [np.linalg.norm(places[_carried(tree, bone)] - places[bone], axis=1).max() for bone in tree.bones]
    return np.append(np.repeat(np.maximum(far, SHORTEST), 4), 1.0)


def _carried(tree: Tree, bone: int) -> list[int]:
    """A bone and all joints that it carries."""
    found = [bone]
    for joint, parent in enumerate(tree.parents):
        if parent in found:
            found.append(joint)
    return found
