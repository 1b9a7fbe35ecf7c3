"""``angles`` and ``root_angles``: Euler angles of joints, without and with a root block in the root's place.

``root_vectors``: the root block in radians, and each joint's rotation as an exponential map. Whatever Euler order, axes
or missing channels a file's joints have, the rotation relative to the parent joint is the same, so an AMC file and the
BVH file made from it give equal frames. Channels are those of the block, then JOINT.ex, JOINT.ey, JOINT.ez.

The root block is six channels that say how a figure moves over the ground, wherever it is and whichever way it faces.
The facing is the heading of :mod:`motet.motion.kinematics`, the angle about the vertical y axis; the rest of the root's
rotation is pitch and roll: R = Ry(heading) Rx(pitch) Rz(roll). Displacements are those since the previous frame, in the
facing frame of the previous frame, so that adding them up gives the path exactly, at the frame rate they were computed
at.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import MotionError, listed
from motet.figures.feet.contacts import (
    feet_of,
    ground_of,
    has_feet,
    lay_root_path,
    led_along,
    velocity_by_feet,
)
from motet.figures.feet.hold import hold_feet
from motet.motion.kinematics import (
    channels_of,
    continued,
    euler_of,
    heading,
    local_rotations,
    local_translations,
    positions,
    skeleton_of,
    with_channels,
)
from motet.motion.mirroring import mirror
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import (
    Array,
    euler_to_rotmat,
    rotmat_to_rotvec,
    rotmats_to_euler,
    rotvec_to_rotmat,
)
from motet.motion.skeleton import END_SUFFIX, Names
from motet.representation.base import (
    FrameMirror,
    Representation,
    at_rest,
    in_units,
    joint_channels,
    joints_with,
    lateral_x,
    mirror_by_joints,
    root_places,
    root_signs,
)


class Angles(Representation):
    """Euler angles of joints, and whatever other channels a model has, as they are in motions.

    They do not say where a figure goes: its path is laid by what its feet do, and what then still slides is held.
    """

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """The channels of ``like``, or all but the root's."""
        if like is not None:
            return motion.select(like.channels, like.units)
        root = "root" if motion.skeleton is None else motion.skeleton.names[0]
        kept = tuple(name for name in motion.channels if name.rpartition(".")[0] != root)
        return in_units(motion.select(kept), str)

    def planted(self, features: Motion) -> Motion:
        """With the root's translation, found from the feet's contact with the ground; a human's feet stay there."""
        if features.skeleton is None or not has_feet(features.skeleton):
            return features
        # feet say where the root goes, and then they are held
        laid = lay_root_path(features, tremble=0.06)
        try:
            return hold_feet(laid, trembling=True)
        except MotionError:  # not a human: what its legs are is not known
            return laid

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """The features themselves: what they do not tell is not taken from another motion either."""
        return features

    def mirror(self, features: Motion) -> FrameMirror:
        """By :mod:`motet.motion.mirroring`."""
        # each column of a probe frame holds its own number: where mirroring puts it, and with which sign, can be read
        count = len(features.channels)
        probe = Motion(
            np.arange(1.0, count + 1)[None],
            features.channels,
            features.units,
            1.0,
            features.skeleton,
        )
        mirrored = mirror(probe)
        sources = np.abs(mirrored.values[0])
        if mirrored.channels != probe.channels or not np.array_equal(np.sort(sources), probe.values[0]):
            raise MotionError("left and right joints turn about different axes: frames cannot be mirrored by columns")
        return FrameMirror(sources.astype(np.intp) - 1, np.sign(mirrored.values[0]).astype(np.float32))


ROOT_BLOCK = (
    "root.forward",
    "root.left",
    "root.turn",
    "root.height",
    "root.pitch",
    "root.roll",
)
ROOT_BLOCK_UNITS = ("m/s", "m/s", "deg/s", "m", "deg", "deg")
"""Forward, to the left, turning to the left (counterclockwise seen from above), above y = 0, and what remains."""


def to_root_block(motion: Motion) -> Motion:
    """The motion with the root block first, instead of the root's translation and rotation.

    Frame 0 has no previous frame and repeats the velocities of frame 1; those of a lone frame are 0. Pitch and roll
    are continuous in time. Other channels are untouched. MotionError where the root's translation or rotation is
    missing, or a skeleton that knows its unit of length.
    """
    names = _root_channels(motion)
    missing = [name for name in names if name not in motion.channels]
    if missing:
        raise MotionError(f"the root's path and rotation are needed, but this motion lacks {', '.join(missing)}")
    # R = Ry(heading) Rx(pitch) Rz(roll)
    angles = rotmats_to_euler(local_rotations(motion, [0])[:, 0], "yxz")
    places = root_places(motion)
    velocities = ground_velocities(places, angles[:, 0], motion.fps)
    velocities[:, 2] = np.degrees(velocities[:, 2])
    block = np.column_stack([velocities, places[:, 1], np.degrees(angles[:, 1:])])

    # the block stands before all other channels
    rest = motion.select(tuple(name for name in motion.channels if name not in names))
    return with_channels(rest, ROOT_BLOCK, block, ROOT_BLOCK_UNITS)


def ground_velocities(places: Array, heading: Array, fps: float) -> Array:
    """Forward, left (m/s) and turn (rad/s): (T, 3) from places (T, 3) in metres and headings (T,) in radians."""
    if len(places) < 2:
        return np.zeros((len(places), 3))
    # displacements are seen from the facing before them
    x, z = np.diff(places[:, [0, 2]], axis=0).T
    sin = np.sin(heading[:-1])
    cos = np.cos(heading[:-1])
    velocities = np.column_stack([x * sin + z * cos, x * cos - z * sin, np.diff(heading)]) * fps
    return np.concatenate([velocities[:1], velocities])


def from_root_block(motion: Motion, after: Motion | None = None) -> Motion:
    """The inverse: the root's translation ("length") and rotation ("deg") in front, instead of the root block.

    The figure starts at x = z = 0 and faces z, and the velocities of frame 0 are not used; or it goes on where another
    motion ends (``after``), facing as it does there. MotionError where a channel of the block is missing, or a skeleton
    that knows its unit of length.
    """
    skeleton = skeleton_of(motion)
    # the root's own Euler angles, in its joint's order
    rotations, places = root_in_world(motion, after)
    angles = np.degrees(euler_of(rotations, skeleton.joints[0]))
    rest = motion.select(tuple(name for name in motion.channels if name not in ROOT_BLOCK))
    values = np.column_stack([places / skeleton.unit_factor(1.0), angles])
    return with_channels(rest, _root_channels(motion), values, ("length",) * 3 + ("deg",) * 3)


def root_in_world(motion: Motion, after: Motion | None = None) -> tuple[Array, Array]:
    """Rotations (T, 3, 3) and places (T, 3) in metres of the root whose block a motion has, from the origin or on."""
    # steps of a frame each, in metres and radians
    block = motion.select(ROOT_BLOCK, ROOT_BLOCK_UNITS).values
    steps = block[:, :3] * (1, 1, np.pi / 180) / motion.fps
    if after is None:
        steps[:1] = 0
        facing, x, z = way(steps)
    else:
        facing, x, z = way(steps, last_place(after), heading(after[-1])[0])
    rotations = euler_to_rotmat(np.column_stack([facing, np.radians(block[:, 4:])]), "yxz")
    return rotations, np.column_stack([x, block[:, 3], z])


def way(steps: Array, start: ArrayLike = (0.0, 0.0, 0.0), facing: float = 0.0) -> tuple[Array, Array, Array]:
    """Facing (T,) in radians, x and z (T,) in metres, after each of the steps (T, 3).

    steps: forward and to the left in metres, turn in radians. start: the place (3,) of which x and z are those before
    the first step. facing: before it.
    """
    origin = np.asarray(start, dtype=np.float64)
    # summed from the start on: a way that is continued later is the same to the bit
    facings = np.cumsum(np.append(facing, steps[:, 2]))
    # each step is taken in the facing before it
    sin = np.sin(facings[:-1])
    cos = np.cos(facings[:-1])
    x = np.cumsum(np.append(origin[0], steps[:, 0] * sin + steps[:, 1] * cos))
    z = np.cumsum(np.append(origin[2], steps[:, 0] * cos - steps[:, 1] * sin))
    return facings[1:], x[1:], z[1:]


def poses_of(frames: Array, fps: float) -> Array:
    """Where the root is and faces (T, 3) in frames (T, D) that begin with its velocities: x and z in metres, and facing
    in radians; the first is at the origin."""
    steps = frames[:, :3] / fps
    steps[:1] = 0
    facing, x, z = way(steps)
    return np.stack([x, z, facing], axis=-1)


def last_place(motion: Motion) -> Array:
    """The root's place (3,) in a motion's last frame, in metres."""
    return np.asarray(local_translations(motion[-1])[0, 0] * skeleton_of(motion).unit_factor(1.0))


def plant_feet(motion: Motion) -> Motion:
    """A motion with the root block whose figure goes where its feet take it, wherever they are on the ground.

    root.forward and root.left change, nothing else. What they were is one more vote for the velocity, of weight 0.1, as
    a point on the ground has 1: it decides in flight, and where hands or a seat carry the figure. The ground is where
    the feet are at their lowest. MotionError for a motion without the root block, or without a skeleton with feet and a
    unit of length.
    """
    skeleton = skeleton_of(motion)
    placed = from_root_block(motion)
    joints = feet_of(skeleton)
    metres = skeleton.unit_factor(1.0)
    if len(motion) < 2:
        return motion
    # where the feet are, from the root and over the ground
    places = positions(placed) * metres
    root = places[:, 0]
    feet = places[:, joints]
    above = feet[..., 1] - ground_of(feet[..., 1])

    # the root moves against the feet that stand; how it moved before is one more vote
    was = np.diff(root[:, [0, 2]], axis=0) * motion.fps
    velocity = velocity_by_feet((feet - root[:, None])[..., [0, 2]], above, motion.fps, was, trust=0.1)
    block = to_root_block(led_along(placed, velocity, root[:, 1], metres)).select(ROOT_BLOCK[:2])
    return with_channels(motion, ROOT_BLOCK[:2], block.values, ROOT_BLOCK_UNITS[:2])


def _root_channels(motion: Motion) -> Names:
    root = skeleton_of(motion).names[0]
    return channels_of(root, "t") + channels_of(root, "r")


class RootAngles(Representation):
    """Euler angles of joints in degrees, and the root block."""

    required = ROOT_BLOCK

    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """The root block, and the joints' channels of ``like`` or all there are, angles in degrees."""
        if not set(ROOT_BLOCK) <= set(motion.channels):
            motion = to_root_block(motion)
        if like is not None:
            return motion.select(like.channels, like.units)
        return in_units(motion, lambda unit: "deg" if unit in TURN else unit)

    def planted(self, features: Motion) -> Motion:
        """By :func:`plant_feet`, of a figure that has feet and knows its unit of length."""
        skeleton = features.skeleton
        can_be = skeleton is not None and skeleton.metres_per_unit is not None and has_feet(skeleton)
        return plant_feet(features) if can_be else features

    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """With the root's translation and rotation instead of the block, where there is a skeleton to move."""
        return features if features.skeleton is None else from_root_block(features, after)

    def mirror(self, features: Motion) -> FrameMirror:
        """The joints as :class:`motet.representation.root_block.Angles` does it."""
        lateral_x(features)
        # joints mirror as without the block, whose channels stay in place
        joints = np.flatnonzero([name not in ROOT_BLOCK for name in features.channels])
        by_joints = Angles().mirror(features.select(tuple(features.channels[d] for d in joints)))
        columns = np.arange(len(features.channels))
        signs = root_signs(features.channels)
        columns[joints] = joints[by_joints.columns]
        signs[joints] = by_joints.signs
        return FrameMirror(columns, signs)


VECTOR_SIGNS = {"ex": 1, "ey": -1, "ez": -1}
"""Kinds of channels of exponential maps, and what a mirror image in the plane x = 0 makes of them."""

VECTOR_KINDS = tuple(VECTOR_SIGNS)


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
        """In the channels of ``after``, which may be features too; from the origin in Euler angles of the skeleton.

        Channels of which the features know nothing stay as they are in the last frame of ``after``.
        """
        if after is not None and set(features.channels) <= set(after.channels):
            return features
        name = skeleton_of(features if after is None else after).names[0]
        joints = joints_of(features.channels)
        last = at_rest(features, (name, *joints)) if after is None else after[-1]
        # the root by its block, all other joints by their exponential maps
        root, places = root_in_world(features, after)
        vectors = features.select(joint_channels(joints, VECTOR_KINDS)).values
        matrices = rotvec_to_rotmat(vectors.reshape(len(features), len(joints), 3))
        rotations = {joint: matrices[:, n] for n, joint in enumerate(joints)}
        return continued(
            last,
            {name: root, **rotations},
            {name: places / skeleton_of(last).unit_factor(1.0)},
        )

    def mirror(self, features: Motion) -> FrameMirror:
        """As :func:`motet.motion.mirroring.mirror` does it, for exponential maps in the parent joint's axes."""
        return mirror_by_joints(features, VECTOR_SIGNS)


def joints_of(channels: Sequence[str]) -> Names:
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
    # the root in radians, joints as rotation vectors
    root_units = tuple(unit.replace("deg", "rad") for unit in ROOT_BLOCK_UNITS)
    block = to_root_block(motion).select(ROOT_BLOCK, root_units)
    vectors = rotmat_to_rotvec(local_rotations(motion, [skeleton.places[name] for name in joints]))
    channels = joint_channels(joints, VECTOR_KINDS)
    return replace(
        motion,
        values=np.concatenate([block.values, vectors.reshape(len(motion), len(channels))], axis=1),
        channels=ROOT_BLOCK + channels,
        units=root_units + ("rad",) * len(channels),
    )
