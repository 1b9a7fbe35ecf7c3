"""A motion of a figure whose joints turn about other axes than a model's: the same rotations in the model's angles."""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import AXES, euler_of, local_rotations, with_channels
from motet.motion.motion import TURN, Motion
from motet.motion.skeleton import Skeleton

ALIKE = 1e-3
"""Entries of a rotation matrix of two joints' axes differ by less where they are the same axes, written differently."""

APART = 45.0
"""Degrees: bones of one name that lie further apart at rest do not mean the same by their angles. The bones of 16 of
CMU's subjects, measured one by one, lie up to 24 degrees apart."""


def in_joints_of(motion: Motion, skeleton: Skeleton | None) -> Motion:
    """The motion with Euler angles in the order and axes that joints of the same name have in another skeleton.

    Joints that have them already keep their angles to the bit; without a skeleton of its own or another the motion
    comes back as it is. MotionError where a bone points elsewhere at rest.
    """
    if motion.skeleton is None or skeleton is None:
        return motion
    for name in _other_joints(motion.skeleton, skeleton):
        columns = motion.rotation_columns().get(name)
        own = motion.skeleton
        if own is None or columns is None:
            continue
        place, joint = own.places[name], skeleton.joints[skeleton.places[name]]
        unit = motion.units[columns[0]]
        angles = euler_of(local_rotations(motion, [place])[:, 0], joint) * TURN[unit] / (2 * np.pi)
        turned = replace(own.joints[place], order=joint.order, axis=joint.axis)
        joints = (*own.joints[:place], turned, *own.joints[place + 1 :])
        motion = with_channels(motion, tuple(f"{name}.r{axis}" for axis in AXES), angles, (unit,) * 3)
        motion = replace(motion, skeleton=replace(own, joints=joints))
    return motion


@lru_cache(maxsize=256)
def _other_joints(own: Skeleton, other: Skeleton) -> tuple[str, ...]:
    """Names of the joints of both skeletons that turn about other axes; MotionError for other bones."""
    found = []
    for name in own.names:
        if name not in other.places:
            continue
        if reason := other_bone(own, other, name):
            raise MotionError(reason)
        one, two = own.joints[own.places[name]], other.joints[other.places[name]]
        if one.order != two.order or not np.allclose(one.frame, two.frame, rtol=0, atol=ALIKE):
            found.append(name)
    return tuple(found)


@lru_cache(maxsize=256)
def other_bones(own: Skeleton, other: Skeleton) -> str | None:
    """Why the angles of any joint mean other poses in another skeleton, see :func:`other_bone`; None if none does."""
    return next((reason for name in own.names if (reason := other_bone(own, other, name))), None)


def other_bone(own: Skeleton, other: Skeleton, name: str) -> str | None:
    """Why a joint's angles mean other poses in another skeleton: its bone points elsewhere; None if they do not."""
    if name not in other.places:
        return None
    parent = other.joints[other.places[name]].parent
    if parent < 0 or other.names[parent] not in own.places:
        return None
    bones = [
        skeleton.rest_positions[skeleton.places[name]] - skeleton.rest_positions[skeleton.places[other.names[parent]]]
        for skeleton in (own, other)
    ]
    lengths = [float(np.linalg.norm(bone)) for bone in bones]
    if min(lengths) < 1e-6:
        return None
    apart = np.degrees(np.arccos(np.clip(bones[0] @ bones[1] / (lengths[0] * lengths[1]), -1, 1)))
    if apart <= APART:
        return None
    return (
        f"the bone to {name!r} points {apart:.0f} degrees away from where it does in the model's figure at rest: "
        "the same angles mean other poses"
    )
