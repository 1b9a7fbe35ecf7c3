"""The heading of a figure: the direction it faces on the ground, and taking it out of a motion."""

import numpy as np

from motet.motion.kinematics import AXES, euler_of, local_rotations, skeleton_of, with_channels
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import Array, angle_of, axis_to_rotmat


def heading(motion: Motion) -> Array:
    """Angle (T,) in radians about the vertical y axis that the root faces, unwrapped over time; 0 is along z."""
    forward = local_rotations(motion, [0])[:, 0, :, 2]
    return np.unwrap(angle_of(forward[:, 0], forward[:, 2]))


def without_heading(motion: Motion) -> Motion:
    """The motion turned to face z: a straight line fitted to the heading is removed from the root's rotation.

    This keeps the sway of the hips within a stride and removes any constant heading or turning rate. A motion without
    root rotation is returned unchanged. The root's translation is not changed.
    """
    joint = skeleton_of(motion).joints[0]
    names = tuple(f"{joint.name}.r{axis}" for axis in AXES)
    if not set(names) <= set(motion.channels) or not len(motion):
        return motion
    time, angle = np.arange(len(motion)), heading(motion)
    line: Array = np.polyval(np.polyfit(time, angle, min(1, len(motion) - 1)), time).astype(np.float64)
    levelled = axis_to_rotmat("y", -line) @ local_rotations(motion, [0])[:, 0]
    units = tuple(motion.units[motion.channels.index(name)] for name in names)
    turns = np.array([TURN[unit] for unit in units])
    angles = euler_of(levelled, joint) * turns / (2 * np.pi)
    return with_channels(motion, names, angles, units).continuous()
