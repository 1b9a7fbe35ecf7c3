"""Forward kinematics: from the channels of a motion to rotations and positions of its joints."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import TURN, Motion
from motet.motion.products import inverse, product, rotated
from motet.motion.rotations import Array, euler_to_rotmat, frames_last, rotmats_to_euler
from motet.motion.skeleton import Joint, Skeleton

AXES = ("x", "y", "z")


def skeleton_of(motion: Motion) -> Skeleton:
    """The motion's skeleton; MotionError if it has none."""
    if motion.skeleton is None:
        raise MotionError("this motion has no skeleton: positions and rotations of its joints are not defined")
    return motion.skeleton


def local_rotations(motion: Motion, joints: Sequence[int] | None = None) -> Array:
    """Rotations (T, J, 3, 3) relative to the parent of every joint, or of the joints with the given indices."""
    skeleton = skeleton_of(motion)
    wanted = range(len(skeleton.joints)) if joints is None else joints
    columns = motion.rotation_columns()
    rotations = frames_last((len(motion), len(wanted), 3, 3))
    for place, joint in enumerate(skeleton.joints[index] for index in wanted):
        rotations[:, place] = _rotations_of(motion, joint, columns.get(joint.name, ()))
    return rotations


def _rotations_of(motion: Motion, joint: Joint, columns: Sequence[int]) -> Array:
    """Local rotations (T, 3, 3) of one joint from the columns of its angles, (3, 3) where it has none."""
    if not columns:
        return np.eye(3)
    angles = frames_last((len(motion), 3))
    angles[:] = 0.0
    for column in columns:
        axis = joint.order.index(motion.channels[column][-1])
        angles[:, axis] = motion.values[:, column] * (2 * np.pi / TURN[motion.units[column]])
    turns = euler_to_rotmat(angles, joint.order)
    return product(product(joint.frame, turns), inverse(joint.frame)) if any(joint.axis) else turns


def local_translations(motion: Motion) -> Array:
    """Translations (T, J, 3) of every joint in its parent's frame: the channel where there is one, else the offset."""
    skeleton = skeleton_of(motion)
    translations = frames_last((len(motion), len(skeleton.joints), 3))
    translations[:] = skeleton.offsets
    for column, name in enumerate(motion.channels):
        joint, _, kind = name.rpartition(".")
        if kind in ("tx", "ty", "tz") and joint in skeleton.places:
            factor = 1.0 if motion.units[column] == "length" else 1 / skeleton.unit_factor(1.0)
            translations[:, skeleton.places[joint], AXES.index(kind[1])] = motion.values[:, column] * factor
    return translations


def global_transforms(motion: Motion) -> tuple[Array, Array]:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of every joint in the world, lengths in the skeleton's unit."""
    skeleton = skeleton_of(motion)
    rotations, positions = local_rotations(motion), local_translations(motion)
    for level in skeleton.levels:
        parents = skeleton.parents[level]
        turned = rotations[:, parents]
        positions[:, level] = positions[:, parents] + rotated(turned, positions[:, level])
        rotations[:, level] = product(turned, rotations[:, level])
    return rotations, positions


def positions(motion: Motion) -> Array:
    """Positions (T, J, 3) of every joint in the world, in the skeleton's length unit."""
    return global_transforms(motion)[1]


def euler_of(rotations: Array, joint: Joint) -> Array:
    """Local rotations (T, 3, 3) of one joint to its channels rx, ry, rz (T, 3) in radians: undoes C M C^T.

    The angles do not leap from frame to frame; the first frame's middle angle is within a quarter turn.
    """
    if any(joint.axis):
        rotations = product(product(inverse(joint.frame), rotations), joint.frame)
    angles = rotmats_to_euler(rotations, joint.order)
    ordered: Array = angles[:, [joint.order.index(axis) for axis in AXES]]
    return ordered


def with_channels(motion: Motion, names: tuple[str, ...], values: Array, units: tuple[str, ...]) -> Motion:
    """The motion with channels (T, len(names)) replaced, or prepended where it has none of that name."""
    new = tuple(name for name in names if name not in motion.channels)
    added = [names.index(name) for name in new]
    everything = np.concatenate([values[:, added], motion.values], axis=1)
    channels, all_units = new + motion.channels, [units[i] for i in added] + list(motion.units)
    for i, name in enumerate(names):
        everything[:, channels.index(name)] = values[:, i]
        all_units[channels.index(name)] = units[i]
    return replace(motion, values=everything, channels=channels, units=tuple(all_units))


def continued(last: Motion, rotations: Mapping[str, Array], translations: Mapping[str, Array]) -> Motion:
    """What follows a motion's last frame, in its channels: local rotations (T, 3, 3) and translations (T, 3) of joints.

    Lengths are in the skeleton's unit. What the channels do not have is left out, and channels of other joints stay as
    they are.
    """
    last = last[-1:]
    count = len(next(iter(rotations.values())))
    after = posed(replace(last, values=np.repeat(last.values, count, axis=0)), rotations, translations)
    # the frame before the first one says which of two equal angles is the nearer one
    return replace(last, values=np.concatenate([last.values, after.values])).continuous()[1:]


def posed(motion: Motion, rotations: Mapping[str, Array], translations: Mapping[str, Array]) -> Motion:
    """The motion in its channels with other local rotations (T, 3, 3) and translations (T, 3) of some joints, as
    :func:`continued` takes them."""
    skeleton, values = skeleton_of(motion), np.array(motion.values)
    for name, columns in motion.rotation_columns().items():
        if name in rotations:
            angles = euler_of(rotations[name], skeleton.joints[skeleton.index(name)])
            for column in columns:
                axis = AXES.index(motion.channels[column][-1])
                values[:, column] = angles[:, axis] * TURN[motion.units[column]] / (2 * np.pi)
    for column, channel in enumerate(motion.channels):
        name, _, kind = channel.rpartition(".")
        if name in translations and kind in ("tx", "ty", "tz"):
            factor = 1.0 if motion.units[column] == "length" else skeleton.unit_factor(1.0)
            values[:, column] = translations[name][:, AXES.index(kind[1])] * factor
    return replace(motion, values=values)
