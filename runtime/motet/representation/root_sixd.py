"""``root_sixd``: how the root moves over the ground, and every joint's rotation as two axes of its frame.

Two axes are the continuous representation in six numbers of Zhou et al., "On the Continuity of Rotation Representations
in Neural Networks" (2019): where the joint's x axis and its y axis point in the parent's frame; for the root's joint,
in the frame of the facing. A model may give any six numbers: they are made orthogonal again.

The facing is the turn of the root about the vertical axis, smoothed over time. It counts the less, the more the root is
tilted, so it stays calm in cartwheels and where a figure lies.
"""

from dataclasses import replace

import numpy as np

from motet.figures.feet.hold import hold_feet
from motet.figures.humanoid import HUMANOID
from motet.motion.kinematics import continued, local_rotations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, axis_to_rotmat, product, rotmat_to_quat
from motet.motion.skeleton import END_SUFFIX
from motet.representation.base import (
    FrameMirror,
    Representation,
    at_rest,
    joint_channels,
    joints_with,
    mirror_by_joints,
    root_places,
)
from motet.representation.root_block import ground_velocities, last_place, way

ROOT_SIXD = ("root.forward", "root.left", "root.turn", "root.height")
ROOT_SIXD_UNITS = ("m/s", "m/s", "rad/s", "m")
"""As in :mod:`motet.representation.root_block`, but for the facing and for radians."""

SIXD_SIGNS = {"xx": 1.0, "xy": -1.0, "xz": -1.0, "yx": -1.0, "yy": 1.0, "yz": 1.0}
"""Where the x axis and where the y axis points, and what a mirror image in the plane x = 0 makes of that."""

SIXD_KINDS = tuple(SIXD_SIGNS)


FACING_SPREAD = 4 / 30
"""Seconds, the standard deviation of the window that smooths the facing: hips sway by a stride, 0.5 s."""


class RootSixd(Representation):
    """How the root moves over the ground, its height, and two axes of every joint."""

    required = ROOT_SIXD

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """Root and two axes of the joints of ``like``, or of all that are no tips."""
        if not set(ROOT_SIXD) <= set(motion.channels):
            motion = to_root_sixd(motion)
        return motion if like is None else motion.select(like.channels, like.units)

    def planted(self, features: Motion) -> Motion:
        """The features with feet that stay where they stand (:func:`motet.figures.feet.hold.hold_feet`)."""
        if features.skeleton != HUMANOID or len(features) < 2:
            return features
        return self.features(hold_feet(self.motion(features)), features)

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """In Euler angles of the skeleton: from the origin, or in the channels of ``after`` where that motion ends."""
        return in_world(features, after)[0]

    def mirror(self, features: Motion) -> FrameMirror:
        """The axes of each joint's partner, mirrored."""
        return mirror_by_joints(features, SIXD_SIGNS)


def to_root_sixd(motion: Motion) -> Motion:
    """The motion in channels of ``root_sixd``: root, and two axes of all joints that are no tips. MotionError where the
    root's translation is missing, or a skeleton that knows its unit of length."""
    skeleton = skeleton_of(motion)
    joints = [i for i, name in enumerate(skeleton.names) if not name.endswith(END_SUFFIX)]
    # the root's rotation is seen from the facing, all others from their parents
    rotations = np.ascontiguousarray(local_rotations(motion, joints))
    angles = facing(motion)
    rotations[:, 0] = product(axis_to_rotmat("y", -angles), rotations[:, 0])
    axes = rotmat_to_sixd(rotations).reshape(len(motion), -1)

    # the path is how the root moves over the ground, and its height
    places = root_places(motion)
    values = np.column_stack([ground_velocities(places, angles, motion.fps), places[:, 1], axes])
    names = joint_channels([skeleton.names[joint] for joint in joints], SIXD_KINDS)
    units = ROOT_SIXD_UNITS + ("1",) * len(names)
    return replace(motion, values=values, channels=ROOT_SIXD + names, units=units)


def in_world(features: Motion, after: Motion | None = None, pose: Array | None = None) -> tuple[Motion, Array]:
    """Features as a motion that can be played, and the pose (x, z, facing) of its last frame.

    From the origin; or after a motion, in its channels, from its last pose or from a ``pose`` that is known better.
    """
    last = at_rest(features, joints_with(features.channels, "xx")) if after is None else after[-1]
    skeleton = skeleton_of(last)
    root = skeleton.names[0]
    facings, places = _way(features, after, pose)

    # the root's rotation is turned from the facing to the world
    rotations = joint_rotations(features)
    rotations[root] = product(axis_to_rotmat("y", facings), rotations[root])
    motion = continued(last, rotations, {root: places / skeleton.unit_factor(1.0)})
    return motion, np.array([places[-1, 0], places[-1, 2], facings[-1]])


def _way(features: Motion, after: Motion | None, pose: Array | None) -> tuple[Array, Array]:
    """Facings (T,) in radians and places (T, 3) in metres of the root, from a pose as :func:`in_world` takes it."""
    # the root's steps add up to its path; a first step from nowhere is none
    steps = features.select(ROOT_SIXD[:3]).values / features.fps
    if after is None:
        steps[:1] = 0
        pose = np.zeros(3)
    elif pose is None:
        # where the root is over the ground and how it faces in the last frame
        place = last_place(after)
        pose = np.array([place[0], place[2], facing(after)[-1]])
    facings, x, z = way(steps, (pose[0], 0.0, pose[1]), pose[2])
    return facings, np.column_stack([x, features.select(ROOT_SIXD[3:]).values, z])


def facing(motion: Motion) -> Array:
    """The angle (T,) in radians about the vertical axis that the root faces, calm and unwrapped; 0 is along z.

    The root's rotation is a turn about y after a tilt; as complex numbers, twice the half turn of the quaternion's y
    and w, these add up with weights that vanish where the root is upside down.
    """
    quat = rotmat_to_quat(local_rotations(motion, [0])[:, 0])
    half = quat[:, 3] + 1j * quat[:, 1]
    # smoothed by a Gaussian window, and only then made an angle
    spread = FACING_SPREAD * motion.fps
    reach = max(1, round(4 * spread))
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / spread) ** 2)
    smooth = np.convolve(half * half, window)[reach : reach + len(motion)]
    return np.unwrap(np.angle(smooth))


def joint_rotations(features: Motion) -> dict[str, Array]:
    """Local rotations (T, 3, 3) by joint; the root's is seen from the facing."""
    joints = joints_with(features.channels, "xx")
    values = features.select(joint_channels(joints, SIXD_KINDS)).values
    matrices = sixd_to_rotmat(values.reshape(len(features), len(joints), 6))
    return {joint: matrices[:, place] for place, joint in enumerate(joints)}


def sixd_to_rotmat(sixd: Array) -> Array:
    """Two axes (..., 6), of any length and not quite orthogonal, to matrices (..., 3, 3) by Gram and Schmidt."""
    # x as it is, and what of y is square to it
    x = sixd[..., :3]
    y = sixd[..., 3:]
    x = _of_length_1(x)
    y = _of_length_1(y - (x * y).sum(axis=-1, keepdims=True) * x)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def _of_length_1(vectors: Array) -> Array:
    """Vectors (..., 3) of length 1, but for those that are next to nothing."""
    lengths = np.linalg.norm(vectors, axis=-1, keepdims=True)
    scaled: Array = vectors / np.maximum(lengths, 1e-9)
    return scaled


def rotmat_to_sixd(matrices: Array) -> Array:
    """Matrices (..., 3, 3) to two axes (..., 6): :func:`sixd_to_rotmat` undone."""
    axes: Array = np.swapaxes(matrices[..., :2], -1, -2)
    return axes.reshape(*matrices.shape[:-2], 6)
