"""Forward kinematics: from the channels of a motion to rotations and positions of its joints."""

from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, euler_to_rotmat, rotmat_to_euler
from motet.motion.skeleton import Joint, Skeleton

AXES = ("x", "y", "z")


def skeleton_of(motion: Motion) -> Skeleton:
    """The motion's skeleton; MotionError if it has none."""
    if motion.skeleton is None:
        raise MotionError("this motion has no skeleton: positions and rotations of its joints are not defined")
    return motion.skeleton


def local_rotations(motion: Motion) -> Array:
    """Rotations (T, J, 3, 3) of every joint relative to its parent."""
    skeleton = skeleton_of(motion)
    angles = _angles(motion, skeleton)
    rotations = np.empty((len(motion), len(skeleton.joints), 3, 3))
    for i, joint in enumerate(skeleton.joints):
        columns = [AXES.index(axis) for axis in joint.order]
        rotations[:, i] = joint.frame @ euler_to_rotmat(angles[:, i, columns], joint.order) @ joint.frame.T
    return rotations


def local_translations(motion: Motion) -> Array:
    """Translations (T, J, 3) of every joint in its parent's frame: the channel where there is one, else the offset."""
    skeleton = skeleton_of(motion)
    translations = np.repeat(skeleton.offsets[None], len(motion), axis=0)
    for column, name in enumerate(motion.channels):
        joint, _, kind = name.rpartition(".")
        if kind in ("tx", "ty", "tz") and joint in skeleton.names:
            factor = 1.0 if motion.units[column] == "length" else 1 / skeleton.unit_factor(1.0)
            translations[:, skeleton.index(joint), AXES.index(kind[1])] = motion.values[:, column] * factor
    return translations


def global_transforms(motion: Motion) -> tuple[Array, Array]:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of every joint in the world, lengths in the skeleton's unit."""
    skeleton = skeleton_of(motion)
    rotations, positions = local_rotations(motion), local_translations(motion)
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        parent = rotations[:, joint.parent]
        positions[:, i] = positions[:, joint.parent] + (parent @ positions[:, i, :, None])[..., 0]
        rotations[:, i] = parent @ rotations[:, i]
    return rotations, positions


def positions(motion: Motion) -> Array:
    """Positions (T, J, 3) of every joint in the world, in the skeleton's length unit."""
    return global_transforms(motion)[1]


def euler_of(rotations: Array, joint: Joint) -> Array:
    """Local rotations (T, 3, 3) of one joint to its channels rx, ry, rz (T, 3) in radians: undoes C M C^T."""
    angles = rotmat_to_euler(joint.frame.T @ rotations @ joint.frame, joint.order)
    ordered: Array = angles[:, [joint.order.index(axis) for axis in AXES]]
    return ordered


def with_channels(motion: Motion, names: tuple[str, ...], values: Array, units: tuple[str, ...]) -> Motion:
    """The motion with channels (T, len(names)) replaced, or put in front where it has none of that name."""
    new = tuple(name for name in names if name not in motion.channels)
    added = [names.index(name) for name in new]
    everything = np.concatenate([values[:, added], motion.values], axis=1)
    channels, all_units = new + motion.channels, [units[i] for i in added] + list(motion.units)
    for i, name in enumerate(names):
        everything[:, channels.index(name)] = values[:, i]
        all_units[channels.index(name)] = units[i]
    return replace(motion, values=everything, channels=channels, units=tuple(all_units))


def _angles(motion: Motion, skeleton: Skeleton) -> Array:
    """Euler angles (T, J, 3) about x, y, z in radians; 0 where there is no channel."""
    angles = np.zeros((len(motion), len(skeleton.joints), 3))
    for joint, columns in motion.rotation_columns().items():
        if joint in skeleton.names:
            for column in columns:
                axis = AXES.index(motion.channels[column][-1])
                radians = motion.values[:, column] * (2 * np.pi / TURN[motion.units[column]])
                angles[:, skeleton.index(joint), axis] = radians
    return angles
