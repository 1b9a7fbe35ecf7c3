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
from motet.motion.kinematics import AXES, euler_of, local_rotations, local_translations, skeleton_of, with_channels
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
    bad = [name for name in motion.channels if not _is_mirrored(name, skeleton)]
    if bad:
        raise MotionError(f"only Euler angles and translations of joints can be mirrored, not {', '.join(bad)}")
    signs = np.where(np.arange(3) == lateral_axis(skeleton), -1.0, 1.0)
    values = np.array(motion.values)

    # channels are swapped where the partner has the same ones and its axes are the mirror image
    harder = []
    for i, partner in enumerate(partners_of(skeleton.names)):
        for letter in "rt":
            channels = _same_channels(motion, i, partner, letter)
            is_same = letter == "t" or _turns_alike(skeleton.joints[i], skeleton.joints[partner], signs)
            if channels is None or not is_same:
                harder.append((i, partner, letter))
                continue
            # a translation along the lateral axis changes its sign, and so do the turns about the other two axes
            factors = signs if letter == "t" else -signs
            for axis, column, partner_column in channels:
                values[:, column] = factors[axis] * motion.values[:, partner_column]

    # all others go by rotations and translations
    result = replace(motion, values=values)
    for i, partner, letter in harder:
        result = _with_mirrored(result, motion, i, partner, letter, signs)
    return result


def _is_mirrored(channel: str, skeleton: Skeleton) -> bool:
    """Whether a channel is an Euler angle or a translation of a joint."""
    joint, _, kind = channel.rpartition(".")
    return joint in skeleton.names and re.fullmatch("[rt][xyz]", kind) is not None


def _turns_alike(joint: Joint, partner: Joint, signs: Array) -> bool:
    """Whether the axes of a joint's partner are the mirror image of its own, with signs (3,) of the axes."""
    mirrored = signs[:, None] * partner.frame * signs
    return joint.order == partner.order and np.allclose(mirrored, joint.frame, rtol=0, atol=1e-6)


def _same_channels(motion: Motion, i: int, partner: int, letter: str) -> list[tuple[int, int, int]] | None:
    """The axis, column and partner's column of each channel of joint i's rotation ("r") or translation ("t"); None if
    its partner has other channels or units."""
    names = skeleton_of(motion).names
    columns = {name: column for column, name in enumerate(motion.channels)}
    channels = []
    for axis, axis_name in enumerate(AXES):
        column = columns.get(f"{names[i]}.{letter}{axis_name}")
        partner_column = columns.get(f"{names[partner]}.{letter}{axis_name}")
        if column is None and partner_column is None:
            continue
        if column is None or partner_column is None or motion.units[column] != motion.units[partner_column]:
            return None
        channels.append((axis, column, partner_column))
    return channels


def _with_mirrored(result: Motion, motion: Motion, i: int, partner: int, letter: str, signs: Array) -> Motion:
    """The result with joint i's rotation ("r") or translation ("t") mirrored from its partner's in the motion: in the
    channels that it has, and in others that would leave their rest value."""
    joint = skeleton_of(motion).joints[i]
    names = [f"{joint.name}.{letter}{axis}" for axis in AXES]
    known = dict(zip(motion.channels, motion.units, strict=True))
    rest = (0.0, 0.0, 0.0)
    units = ["length"] * 3
    if letter == "r":
        usual = next((known[name] for name in names if name in known), "deg")
        units = [known.get(name, usual) for name in names]
        rotations = signs[:, None] * local_rotations(motion, [partner])[:, 0] * signs
        values = euler_of(rotations, joint) * [TURN[unit] / (2 * np.pi) for unit in units]
    else:
        rest = joint.offset
        values = local_translations(motion)[:, partner] * signs
    needed = [axis for axis in range(3) if names[axis] in known or _leaves(values[:, axis], rest[axis])]
    channels = tuple(names[axis] for axis in needed)
    return with_channels(result, channels, values[:, needed], tuple(units[axis] for axis in needed))


def _leaves(values: Array, rest: float) -> bool:
    """Whether any of the values (T,) differs from a rest value by more than rounding."""
    return bool((np.abs(values - rest) > 1e-9).any())
