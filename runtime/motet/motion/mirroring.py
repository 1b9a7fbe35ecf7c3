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

Channels = tuple[tuple[str, ...], Array, tuple[str, ...]]
"""Names, values (T, D) and units."""


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
    gap = rest[partners] * _signs(axis) - rest
    if np.abs(gap).max() > 0.2 * skeleton.height:
        raise MotionError("left and right of the rest pose are not mirror images across a coordinate plane")
    return axis


def _signs(axis: int) -> Array:
    signs = np.ones(3)
    signs[axis] = -1.0
    return signs


def mirror(motion: Motion) -> Motion:
    """The motion with left and right swapped, on the same skeleton and with the same channels.

    Channels are prepended only if a joint lacks one that its mirrored rotation or translation needs. Mirroring twice
    gives the motion itself. MotionError for a motion without skeleton or without paired joints, and for channels other
    than Euler angles and translations of joints.
    """
    skeleton = skeleton_of(motion)
    _refuse_other_channels(motion, skeleton)
    partners, axis = partners_of(skeleton.names), lateral_axis(skeleton)
    values, harder = np.array(motion.values), []
    for i, joint in enumerate(skeleton.joints):
        other = skeleton.joints[partners[i]]
        for letter in "rt":
            kinds = _kinds(motion, joint, letter)
            if kinds != _kinds(motion, other, letter) or (letter == "r" and not _alike(joint, other, axis)):
                harder.append((i, letter))
                continue
            for kind in kinds:
                column = motion.channels.index(f"{other.name}.{kind}")
                values[:, motion.channels.index(f"{joint.name}.{kind}")] = _sign(kind, axis) * motion.values[:, column]
    result = replace(motion, values=values)
    for i, letter in harder:
        compute = _mirrored_rotation if letter == "r" else _mirrored_translation
        result = with_channels(result, *compute(motion, skeleton.joints[i], partners[i], axis))
    return result


def _refuse_other_channels(motion: Motion, skeleton: Skeleton) -> None:
    parts = [(name, *name.rpartition(".")[::2]) for name in motion.channels]
    bad = [name for name, joint, kind in parts if joint not in skeleton.names or not re.fullmatch("[rt][xyz]", kind)]
    if bad:
        raise MotionError(f"only Euler angles and translations of joints can be mirrored, not {', '.join(bad)}")


def _kinds(motion: Motion, joint: Joint, letter: str) -> dict[str, str]:
    """The joint's channels, as "rx" or "tx", each with its unit."""
    names = {f"{joint.name}.{letter}{axis}": f"{letter}{axis}" for axis in AXES}
    return {names[name]: unit for name, unit in zip(motion.channels, motion.units, strict=True) if name in names}


def _alike(joint: Joint, other: Joint, axis: int) -> bool:
    signs = _signs(axis)
    mirrored = signs[:, None] * other.frame * signs
    return joint.order == other.order and bool(np.allclose(mirrored, joint.frame, rtol=0, atol=1e-6))


def _sign(kind: str, axis: int) -> float:
    """A translation along the lateral axis changes its sign, and so do the turns about the other two axes."""
    return -1.0 if (kind[0] == "t") == (AXES.index(kind[1]) == axis) else 1.0


def _mirrored_rotation(motion: Motion, joint: Joint, partner: int, axis: int) -> Channels:
    signs = _signs(axis)
    rotations = signs[:, None] * local_rotations(motion, [partner])[:, 0] * signs
    angles = euler_of(rotations, joint)
    own = _kinds(motion, joint, "r")
    units = [own.get(f"r{letter}", next(iter(own.values()), "deg")) for letter in AXES]
    factors = [TURN[unit] / (2 * np.pi) for unit in units]
    return _needed(joint, own, "r", angles * factors, units)


def _mirrored_translation(motion: Motion, joint: Joint, partner: int, axis: int) -> Channels:
    translations = local_translations(motion)[:, partner] * _signs(axis)
    return _needed(joint, _kinds(motion, joint, "t"), "t", translations, ["length"] * 3)


def _needed(joint: Joint, own: dict[str, str], letter: str, values: Array, units: list[str]) -> Channels:
    """The joint's existing channels, and others that would leave their rest value."""
    rest = (0.0, 0.0, 0.0) if letter == "r" else joint.offset
    moved = [bool((np.abs(values[:, n] - rest[n]) > 1e-9).any()) for n in range(3)]
    needed = [n for n, axis in enumerate(AXES) if moved[n] or f"{letter}{axis}" in own]
    names = tuple(f"{joint.name}.{letter}{AXES[n]}" for n in needed)
    return names, values[:, needed], tuple(units[n] for n in needed)
