"""Checks before writing a file of Euler angles."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.motion.kinematics import local_translations, skeleton_of
from motet.motion.motion import TURN, Motion
from motet.motion.skeleton import Skeleton

ANGLE_KINDS, TRANSLATION_KINDS = ("rx", "ry", "rz"), ("tx", "ty", "tz")


def with_still_offsets(path: str | Path, motion: Motion) -> tuple[Motion, tuple[str, ...]]:
    """The motion with constant translations turned into offsets of the skeleton, and the joints that still translate.

    The root keeps its translation and is not among those joints; all translations are in "length".
    MotionError for a motion without skeleton; FormatError names channels that are neither an Euler angle nor a
    translation of one of its joints.
    """
    skeleton = skeleton_of(motion)
    _check(path, motion, skeleton)
    translations = local_translations(motion)
    joints, moving = list(skeleton.joints), []
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        if not any(f"{joint.name}.{kind}" in motion.channels for kind in TRANSLATION_KINDS):
            continue
        if len(motion) and np.ptp(translations[:, i], axis=0).max() > 1e-9 * skeleton.height:
            moving.append(joint.name)
        elif len(motion):
            x, y, z = translations[0, i].tolist()
            joints[i] = replace(joint, offset=(x, y, z))
    kept = tuple(name for name in motion.channels if _is_kept(name, (skeleton.names[0], *moving)))
    units = tuple("length" if unit == "m" else unit for unit in motion.select(kept).units)
    still = replace(motion.select(kept, units), skeleton=Skeleton(tuple(joints), skeleton.metres_per_unit))
    return still, tuple(moving)


def with_names(motion: Motion, names: list[str]) -> Motion:
    """The motion with its skeleton's joints renamed, one name for each."""
    skeleton = skeleton_of(motion)
    new = dict(zip(skeleton.names, names, strict=True))
    joints = tuple(replace(joint, name=new[joint.name]) for joint in skeleton.joints)
    parts = (channel.rpartition(".") for channel in motion.channels)
    channels = tuple(f"{new.get(joint, joint)}.{kind}" for joint, _, kind in parts)
    return replace(motion, channels=channels, skeleton=Skeleton(joints, skeleton.metres_per_unit))


def _is_kept(channel: str, translated: tuple[str, ...]) -> bool:
    joint, _, kind = channel.rpartition(".")
    return kind in ANGLE_KINDS or joint in translated


def _check(path: str | Path, motion: Motion, skeleton: Skeleton) -> None:
    bad = []
    for name, unit in zip(motion.channels, motion.units, strict=True):
        joint, _, kind = name.rpartition(".")
        allowed = tuple(TURN) if kind in ANGLE_KINDS else ("length", "m") if kind in TRANSLATION_KINDS else ()
        if joint not in skeleton.names or unit not in allowed:
            bad.append(f"{name} [{unit}]")
    if bad:
        raise FormatError(path, f"holds only Euler angles and translations of joints, not {', '.join(bad)}")
