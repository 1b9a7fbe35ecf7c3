"""The figure that angles of MMM files (KIT) turn: their files have no skeleton, and one channel for each angle.

The Master Motor Map's reference body is made of segments whose lengths are Winter's fractions of the body's height; it
rests with arms down, and a joint turns about its three axes one after the other. Axes here are those of motet: y up,
the figure faces z.
"""

from dataclasses import replace

import numpy as np

from motet.motion.motion import Motion
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

MMM_HEIGHT = 1.7
"""Metres of the body, which the angles do not tell."""

MMM_TRUNK = (
    ("root", "", (0.0, 0.0, 0.0)),
    ("BP", "root", (0.0, 0.08, 0.0)),
    ("BT", "BP", (0.0, 0.12, 0.0)),
    ("BLN", "BT", (0.0, 0.232, 0.0)),
    ("BUN", "BLN", (0.0, 0.03, 0.0)),
    ("BUN" + END_SUFFIX, "BUN", (0.0, 0.13, 0.0)),
)

MMM_SIDE = (
    ("H", "root", (0.052, 0.0, 0.0)),
    ("K", "H", (0.0, -0.245, 0.0)),
    ("A", "K", (0.0, -0.246, 0.0)),
    ("F", "A", (0.0, -0.033, 0.075)),
    ("F" + END_SUFFIX, "F", (0.0, -0.006, 0.04)),
    ("SC", "BT", (0.087, 0.188, 0.0)),
    ("S", "SC", (0.11, 0.0, 0.0)),
    ("E", "S", (0.0, -0.188, 0.0)),
    ("W", "E", (0.0, -0.145, 0.0)),
    ("W" + END_SUFFIX, "W", (0.0, -0.108, 0.0)),
)
"""Joints with parents and offsets in heights; those of a side without its L or R, for the left."""

MMM_AXES = {"x": ("rx", -1.0), "y": ("rz", 1.0), "z": ("ry", 1.0)}
"""An angle of MMM, whose x points right, y forward and z up -> the channel here, and its sign."""


def _skeleton() -> Skeleton:
    places = list(MMM_TRUNK)
    for side, sign in (("L", 1.0), ("R", -1.0)):
        parts = [name for name, _, _ in MMM_SIDE]
        for name, parent, (x, y, z) in MMM_SIDE:
            places.append((side + name, side + parent if parent in parts else parent, (sign * x, y, z)))
    names = [name for name, _, _ in places]
    joints = [
        Joint(name, names.index(parent) if parent else -1, (MMM_HEIGHT * x, MMM_HEIGHT * y, MMM_HEIGHT * z), "xyz")
        for name, parent, (x, y, z) in places
    ]
    return Skeleton((replace(joints[0], order="yzx"), *joints[1:]), metres_per_unit=1.0)


MMM_SKELETON = _skeleton()
"""The figure, 1.7 m tall, in metres."""


def is_mmm(motion: Motion) -> bool:
    """Whether the channels are those of an MMM file."""
    return motion.skeleton is None and {"root.rx", "LHx_joint", "RHx_joint"} <= set(motion.channels)


def with_figure(motion: Motion) -> Motion:
    """The motion of an MMM file on its figure; angles of joints that the figure lacks are left out."""
    names, columns = [], []
    for i, channel in enumerate(motion.channels):
        joint, axis = channel.removesuffix("_joint")[:-1], channel.removesuffix("_joint")[-1]
        if channel.startswith("root."):
            names.append(channel)
            columns.append(motion.values[:, i])
        elif axis in MMM_AXES and joint in MMM_SKELETON.names:
            kind, sign = MMM_AXES[axis]
            names.append(f"{joint}.{kind}")
            columns.append(sign * motion.values[:, i])
    units = tuple("m" if name[-2] == "t" else "rad" for name in names)
    return Motion(np.stack(columns, axis=1), tuple(names), units, motion.fps, MMM_SKELETON)
