"""Forward kinematics: from the channels of a motion to rotations and positions of its joints."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import TURN, Motion
from motet.motion.products import inverse, product, rotated
from motet.motion.rotations import Array, euler_to_rotmat, frames_last, rotmats_to_euler
from motet.motion.skeleton import Joint, Skeleton

AXES = ("x", "y", "z")

K = TypeVar("K")


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
    rotations[:] = np.eye(3)
    named = [(place, skeleton.joints[index]) for place, index in enumerate(wanted)]
    for order, alike in _by_order((place, joint) for place, joint in named if joint.name in columns).items():
        places = [place for place, _ in alike]
        turns = euler_to_rotmat(_angles(motion, [(joint, columns[joint.name]) for _, joint in alike]), order)
        rotations[:, places] = turns
        for place, joint in alike:
            if any(joint.axis):
                rotations[:, place] = product(product(joint.frame, rotations[:, place]), inverse(joint.frame))
    return rotations


def _by_order(joints: Iterable[tuple[K, Joint]]) -> dict[str, list[tuple[K, Joint]]]:
    """Joints, each with something of its own, by the order of their angles: those of one order are turned at once."""
    found: dict[str, list[tuple[K, Joint]]] = {}
    for own, joint in joints:
        found.setdefault(joint.order, []).append((own, joint))
    return found


def _angles(motion: Motion, joints: Sequence[tuple[Joint, Sequence[int]]]) -> Array:
    """Angles (T, J, 3) in radians, each joint's in its order, from the columns of each; 0 where there is no channel."""
    angles = frames_last((len(motion), len(joints), 3))
    angles[:] = 0.0
    for place, (joint, columns) in enumerate(joints):
        for column in columns:
            axis = joint.order.index(motion.channels[column][-1])
            angles[:, place, axis] = motion.values[:, column] * (2 * np.pi / TURN[motion.units[column]])
    return angles


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
    return chained(skeleton_of(motion), local_rotations(motion), local_translations(motion))


def chained(skeleton: Skeleton, rotations: Array, translations: Array) -> tuple[Array, Array]:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) in the world, from those in each parent's frame, in place."""
    for level in skeleton.levels:
        parents = skeleton.parents[level]
        turned = rotations[:, parents]
        translations[:, level] = translations[:, parents] + rotated(turned, translations[:, level])
        rotations[:, level] = product(turned, rotations[:, level])
    return rotations, translations


def positions(motion: Motion) -> Array:
    """Positions (T, J, 3) of every joint in the world, in the skeleton's length unit."""
    return global_transforms(motion)[1]


def euler_of(rotations: Array, joint: Joint) -> Array:
    """Local rotations (T, 3, 3) of one joint to its channels rx, ry, rz (T, 3) in radians: undoes C M C^T.

    The angles do not leap from frame to frame; the first frame's middle angle is within a quarter turn.
    """
    found: Array = _eulers_of([(rotations, joint)], joint.order)[:, 0]
    return found


def _eulers_of(joints: Sequence[tuple[Array, Joint]], order: str) -> Array:
    """As :func:`euler_of` for joints of one order of angles, each with its rotations: (T, J, 3)."""
    plain = frames_last((len(joints[0][0]), len(joints), 3, 3))
    for place, (rotations, joint) in enumerate(joints):
        turned = any(joint.axis)
        plain[:, place] = product(product(inverse(joint.frame), rotations), joint.frame) if turned else rotations
    angles = rotmats_to_euler(plain, order)
    found: Array = angles[..., [order.index(axis) for axis in AXES]]
    return found


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
    columns = motion.rotation_columns()
    turned = ((name, skeleton.joints[skeleton.index(name)]) for name in columns if name in rotations)
    for order, alike in _by_order(turned).items():
        angles = _eulers_of([(rotations[name], joint) for name, joint in alike], order)
        for place, (name, _) in enumerate(alike):
            for column in columns[name]:
                axis = AXES.index(motion.channels[column][-1])
                values[:, column] = angles[:, place, axis] * TURN[motion.units[column]] / (2 * np.pi)
    for column, channel in enumerate(motion.channels):
        name, _, kind = channel.rpartition(".")
        if name in translations and kind in ("tx", "ty", "tz"):
            factor = 1.0 if motion.units[column] == "length" else skeleton.unit_factor(1.0)
            values[:, column] = translations[name][:, AXES.index(kind[1])] * factor
    return replace(motion, values=values)
