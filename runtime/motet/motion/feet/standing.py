"""The feet: which joints they are, and where the ground is under them."""

import numpy as np

from motet.errors import MotionError
from motet.motion.rotations import Array
from motet.motion.sides import partners_of
from motet.motion.skeleton import Skeleton

LOW = 10
"""Per cent of the frames whose lowest point of the feet is under what counts as the ground."""

FEET = 0.1
"""Of the figure's height: joints in pairs that lie no higher than this above the lowest of them are the feet."""


def feet_of(skeleton: Skeleton) -> list[int]:
    """Indices of the joints of both feet, those that lie low at rest; MotionError where no joints are in pairs."""
    paired, height = _paired(skeleton), skeleton.rest_positions[:, 1]
    if not paired:
        raise MotionError("no joints in pairs, left and right, to find the feet by: name the joints of the feet")
    limit = height[paired].min() + FEET * skeleton.height
    return [i for i in paired if height[i] <= limit]


def has_feet(skeleton: Skeleton) -> bool:
    """Whether there are joints in pairs, left and right, to find the feet among."""
    return bool(_paired(skeleton))


def ground_of(heights: Array) -> float:
    """The height of the ground under feet that are at ``heights`` (T, K)."""
    return float(np.percentile(heights.min(axis=1), LOW))


def _paired(skeleton: Skeleton) -> list[int]:
    return [i for i, partner in enumerate(partners_of(skeleton.names)) if partner != i]
