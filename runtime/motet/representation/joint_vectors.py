"""A figure in channels that suit a predictor: the root block, and each joint's rotation as an exponential map.

Whatever Euler order, axes or missing channels a file's joints have, the rotation relative to the parent joint is the
same, so an AMC file and the BVH file that was made from it give equal frames. Channels are the six of
:mod:`motet.representation.root_block`, here in radians too, then JOINT.ex, JOINT.ey, JOINT.ez for every other joint.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.heading import heading
from motet.motion.kinematics import AXES, euler_of, local_rotations, local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, axis_to_rotmat, rotmat_to_rotvec, rotvec_to_rotmat
from motet.motion.skeleton import END_SUFFIX
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, from_root_block, to_root_block

KINDS = ("ex", "ey", "ez")

ROOT_UNITS = tuple(unit.replace("deg", "rad") for unit in ROOT_BLOCK_UNITS)
RADIANS = np.array([np.pi / 180 if unit.startswith("deg") else 1.0 for unit in ROOT_BLOCK_UNITS])
"""Of one unit of each channel of the root block."""


def joints_of(channels: Sequence[str]) -> tuple[str, ...]:
    """The joints whose exponential maps are among the channels."""
    return tuple(name.rpartition(".")[0] for name in channels if name.endswith(".ex"))


def to_joint_vectors(motion: Motion, joints: Sequence[str] | None = None) -> Motion:
    """The motion with the root block and with exponential maps of ``joints`` (all but the root) as its channels.

    Each exponential map is at most half a turn, so it can leap between frames: :func:`continuous_vectors` mends that.
    MotionError where a joint, the root's translation or rotation is missing, or a skeleton that knows its unit of
    length.
    """
    skeleton = skeleton_of(motion)
    if joints is None:
        joints = tuple(name for name in skeleton.names[1:] if not name.endswith(END_SUFFIX))
    lacking = [name for name in joints if name not in skeleton.names]
    if lacking:
        raise MotionError(f"the model's figure has joints that this motion lacks: {', '.join(lacking)}")
    block = to_root_block(motion).select(ROOT_BLOCK, ROOT_BLOCK_UNITS)
    rotations = local_rotations(motion)[:, [skeleton.index(name) for name in joints]]
    vectors = rotmat_to_rotvec(rotations).reshape(len(motion), -1)
    channels = (*ROOT_BLOCK, *(f"{name}.{kind}" for name in joints for kind in KINDS))
    units = (*ROOT_UNITS, *["rad"] * (3 * len(joints)))
    values = np.concatenate([block.values * RADIANS, vectors], axis=1)
    return replace(motion, values=values, channels=channels, units=units)


def continuous_vectors(figure: Motion) -> Motion:
    """The same rotations as exponential maps that do not leap from frame to frame; the last frame stays."""
    values = np.array(figure.values)
    columns = [figure.channels.index(f"{name}.{kind}") for name in joints_of(figure.channels) for kind in KINDS]
    vectors = values[:, columns].reshape(len(values), -1, 3)
    for t in range(len(vectors) - 2, -1, -1):
        now, after = vectors[t], vectors[t + 1]
        angle, other = (np.linalg.norm(vector, axis=-1, keepdims=True) for vector in (now, after))
        # without an angle of its own, a rotation has the axis of the frame after it
        axis = np.where(angle > 1e-3, now / np.maximum(angle, 1e-9), after / np.maximum(other, 1e-9))
        # a turn by a about an axis is one by a - 2 pi too; the nearer one to the frame after it is taken
        turns = np.round(((after * axis).sum(-1, keepdims=True) - angle) / (2 * np.pi))
        vectors[t] = now + axis * turns * 2 * np.pi
    values[:, columns] = vectors.reshape(len(values), -1)
    return replace(figure, values=values)


def carry_on(motion: Motion, figure: Motion) -> Motion:
    """Frames of :func:`to_joint_vectors` that follow a motion, as that motion's own channels, units and skeleton.

    They start where the motion ends and face as it does there; both have the same frame rate. Channels of which the
    figure knows nothing stay as they are in the motion's last frame.
    """
    skeleton = skeleton_of(motion)
    root, places = _root_in_world(motion, figure)
    rotations = {skeleton.names[0]: root, **_rotations(figure)}
    values = np.repeat(motion.values[-1:], len(figure) + 1, axis=0)
    for name, columns in motion.rotation_columns().items():
        if name in rotations:
            angles = euler_of(rotations[name], skeleton.joints[skeleton.index(name)])
            for column in columns:
                axis = AXES.index(motion.channels[column][-1])
                values[1:, column] = angles[:, axis] * TURN[motion.units[column]] / (2 * np.pi)
    for column, name in enumerate(motion.channels):
        if name.startswith(f"{skeleton.names[0]}.t"):
            factor = 1.0 if motion.units[column] == "length" else skeleton.unit_factor(1.0)
            values[1:, column] = places[:, AXES.index(name[-1])] * factor
    return replace(motion, values=values).continuous()[1:]


def _rotations(figure: Motion) -> dict[str, Array]:
    """Local rotations (T, 3, 3) by joint."""
    joints = joints_of(figure.channels)
    vectors = figure.select(tuple(f"{name}.{kind}" for name in joints for kind in KINDS)).values
    matrices = rotvec_to_rotmat(vectors.reshape(len(figure), -1, 3))
    return {name: matrices[:, n] for n, name in enumerate(joints)}


def _root_in_world(motion: Motion, figure: Motion) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) of the root and its places (T, 3), in the skeleton's length unit."""
    path = _path(motion, figure)
    turned = axis_to_rotmat("y", heading(motion[-1:]))[0]
    start = local_translations(motion[-1:])[0, 0] * [1, 0, 1]
    places: Array = local_translations(path)[1:, 0] @ turned.T + start
    return turned @ local_rotations(path)[1:, 0], places


def _path(motion: Motion, figure: Motion) -> Motion:
    """The root's path and rotation, from the origin and facing z, the frame before the first one included."""
    block = figure.select(ROOT_BLOCK, ROOT_UNITS)
    values = np.concatenate([block.values[:1], block.values]) / RADIANS
    return from_root_block(replace(block, values=values, units=ROOT_BLOCK_UNITS, skeleton=skeleton_of(motion)))
