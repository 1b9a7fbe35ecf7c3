"""The root block: six channels that say how a figure moves over the ground, wherever it is and whichever way it faces.

The facing is the heading of :mod:`motet.motion.heading`, the angle about the vertical y axis; the rest of the root's
rotation is pitch and roll: R = Ry(heading) Rx(pitch) Rz(roll). Displacements are those since the previous frame, in the
facing frame of the previous frame, so that adding them up gives the path exactly, at the frame rate they were computed
at.
"""

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import AXES, euler_of, local_rotations, local_translations, skeleton_of, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import Array, continuous_euler, euler_to_rotmat, rotmat_to_euler

ROOT_BLOCK = ("root.forward", "root.left", "root.turn", "root.height", "root.pitch", "root.roll")
ROOT_BLOCK_UNITS = ("m/s", "m/s", "deg/s", "m", "deg", "deg")
"""Forward, to the left, turning to the left (counterclockwise seen from above), above y = 0, and what remains."""

ORDER = "yxz"


def to_root_block(motion: Motion) -> Motion:
    """The motion with the root block in front, instead of the root's translation and rotation.

    Frame 0 has no previous frame and repeats the velocities of frame 1; those of a lone frame are 0. Pitch and roll
    are continuous in time. Other channels are untouched. MotionError where the root's translation or rotation is
    missing, or a skeleton that knows its unit of length.
    """
    skeleton = skeleton_of(motion)
    names = _root_channels(motion)
    missing = [name for name in names if name not in motion.channels]
    if missing:
        raise MotionError(f"the root's path and rotation are needed, and this motion lacks {', '.join(missing)}")
    angles = continuous_euler(rotmat_to_euler(local_rotations(motion)[:, 0], ORDER))
    places = local_translations(motion)[:, 0] * skeleton.unit_factor(1.0)
    velocities = _velocities(places, angles[:, 0], motion.fps)
    block = np.column_stack([velocities, places[:, 1], np.degrees(angles[:, 1:])])
    rest = motion.select(tuple(name for name in motion.channels if name not in names))
    return with_channels(rest, ROOT_BLOCK, block, ROOT_BLOCK_UNITS)


def _velocities(places: Array, heading: Array, fps: float) -> Array:
    """Forward, left (m/s) and turn (deg/s): (T, 3) from places (T, 3) in metres and headings (T,) in radians."""
    if len(places) < 2:
        return np.zeros((len(places), 3))
    x, z = np.diff(places[:, [0, 2]], axis=0).T
    sin, cos = np.sin(heading[:-1]), np.cos(heading[:-1])
    found = np.column_stack([x * sin + z * cos, x * cos - z * sin, np.degrees(np.diff(heading))]) * fps
    return np.concatenate([found[:1], found])


def from_root_block(motion: Motion) -> Motion:
    """The inverse: the root's translation ("length") and rotation ("deg") in front, instead of the root block.

    The figure starts at x = z = 0 and faces z; the velocities of frame 0 are not used. MotionError where a channel of
    the block is missing, or a skeleton that knows its unit of length.
    """
    skeleton = skeleton_of(motion)
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    steps = np.concatenate([np.zeros((1, 3)), block[1:, :3] / motion.fps])[: len(block)]
    heading = np.cumsum(np.radians(steps[:, 2]))
    sin, cos = np.sin(heading - np.radians(steps[:, 2])), np.cos(heading - np.radians(steps[:, 2]))
    forward, left = steps[:, 0], steps[:, 1]
    x, z = np.cumsum(forward * sin + left * cos), np.cumsum(forward * cos - left * sin)
    places = np.column_stack([x, block[:, 3], z]) / skeleton.unit_factor(1.0)
    rotations = euler_to_rotmat(np.column_stack([heading, np.radians(block[:, 4:])]), ORDER)
    angles = np.degrees(_continuous(euler_of(rotations, skeleton.joints[0]), skeleton.joints[0].order))
    rest = motion.select(tuple(name for name in motion.channels if name not in ROOT_BLOCK))
    units = ("length",) * 3 + ("deg",) * 3
    return with_channels(rest, _root_channels(motion), np.column_stack([places, angles]), units)


def _root_channels(motion: Motion) -> tuple[str, ...]:
    root = skeleton_of(motion).names[0]
    return tuple(f"{root}.{kind}{axis}" for kind in "tr" for axis in AXES)


def _continuous(angles: Array, order: str) -> Array:
    columns = [AXES.index(axis) for axis in order]
    result = np.empty_like(angles)
    result[:, columns] = continuous_euler(angles[:, columns])
    return result
