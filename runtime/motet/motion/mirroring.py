"""Left-right mirroring of a motion on its own skeleton.

With S the reflection across the plane between the paired joints of the rest pose, the local rotation of a joint
becomes S R S of its partner's, a translation S t. Where the partner's axes are the mirror image of the joint's own,
as in CMU's skeletons and in BVH, this only swaps channels and changes signs, so mirroring twice gives back the motion
bit for bit. Otherwise the rotation is converted to the joint's own Euler angles.
"""

import re
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import (
    channels_of,
    euler_of,
    local_rotations,
    local_translations,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Joint, Skeleton, partners_of


def lateral_axis(skeleton: Skeleton) -> int:
    """0, 1 or 2: the axis along which paired joints lie apart at rest.

    MotionError if no joints are paired, or their positions do not mirror each other across a coordinate plane.
    """
    partners = np.array(partners_of(skeleton.names))
    rest = skeleton.rest_positions
    apart = np.abs(rest - rest[partners])
    if not apart.any():
        raise MotionError(
            "no left-right pairs of joints: expected names such as LeftArm and RightArm, lfemur and rfemur"
        )
    axis = int(np.argmax(apart.sum(axis=0)))
    gap = rest[partners] * np.where(np.arange(3) == axis, -1.0, 1.0) - rest
    if np.abs(gap).max() > 0.2 * skeleton.height:
        raise MotionError("left and right of the rest pose are not mirror images across a coordinate plane")
    return axis


def mirror(motion: Motion) -> Motion:
    """The motion with left and right swapped, on the same skeleton and with the same channels.

    Channels are prepended only if a joint lacks one that its mirrored rotation or translation needs. Mirroring twice
    gives the motion itself. MotionError for a motion without skeleton or without paired joints, and for channels other
    than Euler angles and translations of joints.
    """
    skeleton = skeleton_of(motion)
    bad = _other_channels(motion)
    if bad:
        raise MotionError(f"only Euler angles and translations of joints can be mirrored, not {', '.join(bad)}")
    signs = np.where(np.arange(3) == lateral_axis(skeleton), -1.0, 1.0)
    # a translation along the lateral axis changes its sign, and so do the turns about the other two axes
    factors = {"r": -signs, "t": signs}

    # channels are swapped where the partner has the same ones and its axes are the mirror image
    values = np.array(motion.values)
    harder = []
    for i, partner in enumerate(partners_of(skeleton.names)):
        for letter in "rt":
            channels = _same_channels(motion, i, partner, letter, signs)
            if channels is None:
                harder.append((skeleton.joints[i], partner, letter))
            for axis, column, partner_column in channels or []:
                values[:, column] = factors[letter][axis] * motion.values[:, partner_column]

    # all others go by rotations and translations
    result = replace(motion, values=values)
    for joint, partner, letter in harder:
        result = _with_mirrored(result, motion, joint, partner, letter, signs)
    return result


def _other_channels(motion: Motion) -> list[str]:
    """The channels that are no Euler angle and no translation of a joint."""
    skeleton = skeleton_of(motion)
    others = []
    for channel in motion.channels:
        joint, _, kind = channel.rpartition(".")
        if joint not in skeleton.names or not re.fullmatch("[rt][xyz]", kind):
            others.append(channel)
    return others


def _turns_alike(joint: Joint, partner: Joint, signs: Array) -> bool:
    """Whether the axes of a joint's partner are the mirror image of its own, with signs (3,) of the axes."""
    mirrored = signs[:, None] * partner.frame * signs
    return joint.order == partner.order and np.allclose(mirrored, joint.frame, rtol=0, atol=1e-6)


def _same_channels(
    motion: Motion, i: int, partner: int, letter: str, signs: Array
) -> list[tuple[int, int, int]] | None:
    """The axis, column and partner's column of each channel of joint i's rotation ("r") or translation ("t"); None if
    its partner has other channels or units, or turns about other axes than those mirrored with signs (3,)."""
    joint = skeleton_of(motion).joints[i]
    other = skeleton_of(motion).joints[partner]
    if letter == "r" and not _turns_alike(joint, other, signs):
        return None
    # each channel needs the partner's of the same unit, or neither exists
    columns = {name: column for column, name in enumerate(motion.channels)}
    names = zip(channels_of(joint.name, letter), channels_of(other.name, letter), strict=True)
    channels = []
    for axis, (name, partner_name) in enumerate(names):
        column = columns.get(name)
        partner_column = columns.get(partner_name)
        if column is None and partner_column is None:
            continue
        if column is None or partner_column is None or motion.units[column] != motion.units[partner_column]:
            return None
        channels.append((axis, column, partner_column))
    return channels


def _with_mirrored(
    result: Motion,
    motion: Motion,
    joint: Joint,
    partner: int,
    letter: str,
    signs: Array,
) -> Motion:
    """The result with a joint's rotation ("r") or translation ("t") mirrored from its partner's in the motion: in the
    channels that it has, and in others that would leave their rest value."""
    names = channels_of(joint.name, letter)
    known = dict(zip(motion.channels, motion.units, strict=True))
    usual = next((known[name] for name in names if name in known), "deg")
    units = [known.get(name, usual) if letter == "r" else "length" for name in names]
    values = _mirrored_values(motion, joint, partner, units, signs)

    # a channel is added only where it leaves its rest value by more than rounding
    rest = (0.0, 0.0, 0.0) if letter == "r" else joint.offset
    leaves = np.any(np.abs(values - rest) > 1e-9, axis=0)
    needed = [axis for axis in range(3) if names[axis] in known or leaves[axis]]
    channels = tuple(names[axis] for axis in needed)
    return with_channels(result, channels, values[:, needed], tuple(units[axis] for axis in needed))


def _mirrored_values(motion: Motion, joint: Joint, partner: int, units: list[str], signs: Array) -> Array:
    """Channels (T, 3) of a joint in three units of angles or of lengths, mirrored from its partner's."""
    if units[0] == "length":
        return local_translations(motion)[:, partner] * signs
    rotations = signs[:, None] * local_rotations(motion, [partner])[:, 0] * signs
    return euler_of(rotations, joint) * [TURN[unit] / (2 * np.pi) for unit in units]
