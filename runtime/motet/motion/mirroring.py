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
from motet.motion.skeleton import Skeleton, partners_of


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
    units = dict(zip(motion.channels, motion.units, strict=True))
    parts = [(name, *name.rpartition(".")[::2]) for name in motion.channels]
    bad = [name for name, joint, kind in parts if joint not in skeleton.names or not re.fullmatch("[rt][xyz]", kind)]
    if bad:
        raise MotionError(f"only Euler angles and translations of joints can be mirrored, not {', '.join(bad)}")
    axis = lateral_axis(skeleton)
    signs = np.where(np.arange(3) == axis, -1.0, 1.0)
    values = np.array(motion.values)
    harder = []
    for i, partner in enumerate(partners_of(skeleton.names)):
        joint = skeleton.joints[i]
        other = skeleton.joints[partner]
        same = signs[:, None] * other.frame * signs
        alike = joint.order == other.order and np.allclose(same, joint.frame, rtol=0, atol=1e-6)
        for letter in "rt":
            own, its = ([units.get(f"{j.name}.{letter}{axis}") for axis in AXES] for j in (joint, other))
            if own != its or (letter == "r" and not alike):
                harder.append((i, partner, letter))
                continue
            # a translation along the lateral axis changes its sign, and so do the turns about the other two axes
            factors = signs if letter == "t" else -signs
            for kind, unit, factor in zip(AXES, own, factors, strict=True):
                if unit is not None:
                    column = motion.channels.index(f"{other.name}.{letter}{kind}")
                    place = motion.channels.index(f"{joint.name}.{letter}{kind}")
                    values[:, place] = factor * motion.values[:, column]
    result = replace(motion, values=values)
    for i, partner, letter in harder:
        result = _with_mirrored(result, motion, i, partner, letter, signs)
    return result


def _with_mirrored(result: Motion, motion: Motion, i: int, partner: int, letter: str, signs: Array) -> Motion:
    """The result with rotation ("r") or translation ("t") of joint i that of its partner in the motion, mirrored: in
    the channels that it has, and in others that would leave their rest value."""
    joint = skeleton_of(motion).joints[i]
    units = dict(zip(motion.channels, motion.units, strict=True))
    names = [f"{joint.name}.{letter}{axis}" for axis in AXES]
    usual = next((units[name] for name in names if name in units), "deg") if letter == "r" else "length"
    own = [units.get(name, usual) if letter == "r" else usual for name in names]
    if letter == "r":
        rotations = signs[:, None] * local_rotations(motion, [partner])[:, 0] * signs
        rest = (0.0, 0.0, 0.0)
        values = euler_of(rotations, joint) * [TURN[unit] / (2 * np.pi) for unit in own]
    else:
        rest = joint.offset
        values = local_translations(motion)[:, partner] * signs
    needed = [n for n in range(3) if names[n] in units or (np.abs(values[:, n] - rest[n]) > 1e-9).any()]
    return with_channels(result, tuple(names[n] for n in needed), values[:, needed], tuple(own[n] for n in needed))
