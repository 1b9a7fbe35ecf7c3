"""A small motion of a made-up person, for tests that draw or write figures."""

from importlib.util import find_spec

import numpy as np

from motet.formats import WRITABLE
from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton

WRITTEN = [extension for extension in WRITABLE if extension != ".gif" or find_spec("PIL")]
"""The formats that can be written here."""

JOINTS = (
    Joint("hips", -1, (0.0, 0.0, 0.0), "xyz"),
    Joint("left_leg", 0, (0.1, -0.05, 0.0), axis=(0.0, 0.0, 20.0)),
    Joint("left_shin", 1, (0.0, -0.42, 0.0)),
    Joint("left_shin_end", 2, (0.0, -0.45, 0.0)),
    Joint("right_leg", 0, (-0.1, -0.05, 0.0), axis=(0.0, 0.0, -20.0)),
    Joint("right_shin", 4, (0.0, -0.42, 0.0)),
    Joint("right_shin_end", 5, (0.0, -0.45, 0.0)),
    Joint("spine", 0, (0.0, 0.25, 0.0), "yzx"),
    Joint("left_arm", 7, (0.18, 0.2, 0.0)),
    Joint("left_arm_end", 8, (0.6, 0.0, 0.0)),
    Joint("right_arm", 7, (-0.18, 0.2, 0.0)),
    Joint("right_arm_end", 10, (-0.6, 0.0, 0.0)),
    Joint("head", 7, (0.0, 0.35, 0.0)),
    Joint("head_end", 12, (0.0, 0.18, 0.02)),
)

TURNS = ("hips", "left_leg", "right_leg", "spine", "left_arm", "right_arm", "head")


def walker(frames: int = 40, fps: float = 40.0, metres_per_unit: float | None = 1.0, scale: float = 1.0) -> Motion:
    """A person that walks along +z, swings its limbs and turns by more than half a turn while it does."""
    time = np.arange(frames) / fps
    root = np.stack([0.05 * np.sin(6 * time), 0.93 + 0.02 * np.cos(12 * time), 1.2 * time], axis=1) * scale
    swings = [30 * np.sin(6 * time + phase) for phase in np.arange(3 * len(TURNS))]
    swings[1] = 200 * time
    channels = [f"hips.t{axis}" for axis in "xyz"] + [f"{joint}.r{axis}" for joint in TURNS for axis in "xyz"]
    joints = tuple(
        Joint(j.name, j.parent, (j.offset[0] * scale, j.offset[1] * scale, j.offset[2] * scale), j.order, j.axis)
        for j in JOINTS
    )
    values = np.column_stack([root, *swings])
    units = ["length"] * 3 + ["deg"] * len(swings)
    return Motion(values, tuple(channels), tuple(units), fps, Skeleton(joints, metres_per_unit))
