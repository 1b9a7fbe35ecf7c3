"""``root_vectors``: the root block in radians, and each joint's rotation as an exponential map.

Whatever Euler order, axes or missing channels a file's joints have, the rotation relative to the parent joint is the
same, so an AMC file and the BVH file that was made from it give equal frames. Channels are the six of
:mod:`motet.representation.root_block`, then JOINT.ex, JOINT.ey, JOINT.ez for every other joint.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from motet.errors import MotionError, listed
from motet.motion.kinematics import continued, local_rotations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import rotmat_to_rotvec, rotvec_to_rotmat
from motet.motion.skeleton import END_SUFFIX
from motet.representation.base import FrameMirror, Representation, at_rest, joints_with, mirror_by_joints
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, root_in_world, to_root_block

VECTOR_KINDS = ("ex", "ey", "ez")


class RootVectors(Representation):
    """The root block in radians, and exponential maps; a prediction's path continues a recorded one, unplanted."""

    required = ROOT_BLOCK

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """Exponential maps that do not leap, of the joints of ``like`` or of all but the root."""
        if like is None:
            return to_joint_vectors(motion).continuous()
        if not set(like.channels) <= set(motion.channels):
            motion = to_joint_vectors(motion, joints_of(like.channels))
        return motion.select(like.channels, like.units).continuous()

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """In the channels of ``after``, which may be features too; from the origin in Euler angles of the skeleton."""
        if after is not None and set(features.channels) <= set(after.channels):
            return features
        return carry_on(after, features)

    def mirror(self, features: Motion) -> FrameMirror:
        """As :func:`motet.motion.mirroring.mirror` does it, for exponential maps in the parent joint's axes."""
        return mirror_by_joints(features, dict(zip(VECTOR_KINDS, (1, -1, -1), strict=True)))


def joints_of(channels: Sequence[str]) -> tuple[str, ...]:
    """The joints whose exponential maps are among the channels."""
    return joints_with(channels, "ex")


def to_joint_vectors(motion: Motion, joints: Sequence[str] | None = None) -> Motion:
    """The motion with the root block and with exponential maps of ``joints`` (all but the root) as its channels.

    Each exponential map is at most half a turn, so it can leap between frames: :meth:`Motion.continuous` repairs that.
    MotionError where a joint, the root's translation or rotation is missing, or a skeleton that knows its unit of
    length.
    """
    skeleton = skeleton_of(motion)
    if joints is None:
        joints = tuple(name for name in skeleton.names[1:] if not name.endswith(END_SUFFIX))
    lacking = [name for name in joints if name not in skeleton.places]
    if lacking:
        raise MotionError(f"this motion lacks joints of the model's figure: {listed(lacking)}")
    root_units = tuple(unit.replace("deg", "rad") for unit in ROOT_BLOCK_UNITS)
    block = to_root_block(motion).select(ROOT_BLOCK, root_units)
    vectors = rotmat_to_rotvec(local_rotations(motion, [skeleton.places[name] for name in joints]))
    channels = (*ROOT_BLOCK, *(f"{name}.{kind}" for name in joints for kind in VECTOR_KINDS))
    units = (*root_units, *["rad"] * (3 * len(joints)))
    values = np.concatenate([block.values, vectors.reshape(len(motion), 3 * len(joints))], axis=1)
    return replace(motion, values=values, channels=channels, units=units)


def carry_on(after: Motion | None, features: Motion) -> Motion:
    """Features that follow a motion, as that motion's own channels, units and skeleton; None: from the origin.

    They start where the motion ends and face as it does there; both have the same frame rate. Channels of which the
    features know nothing stay as they are in the motion's last frame.
    """
    name, joints = skeleton_of(features if after is None else after).names[0], joints_of(features.channels)
    last = at_rest(features, (name, *joints)) if after is None else after[-1]
    root, places = root_in_world(features, after)
    vectors = features.select(tuple(f"{joint}.{kind}" for joint in joints for kind in VECTOR_KINDS)).values
    matrices = rotvec_to_rotmat(vectors.reshape(len(features), len(joints), 3))
    rotations = {joint: matrices[:, n] for n, joint in enumerate(joints)}
    return continued(last, {name: root, **rotations}, {name: places / skeleton_of(last).unit_factor(1.0)})
