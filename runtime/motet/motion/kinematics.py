"""Forward kinematics: from the channels of a motion to rotations and positions of its joints, and back."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import TURN, Motion
from motet.motion.rotations import (
    Array,
    angle_of,
    axis_to_rotmat,
    euler_to_rotmat,
    frames_last,
    inverse,
    product,
    rotated,
    rotmats_to_euler,
)
from motet.motion.skeleton import END_SUFFIX, Joint, Names, Skeleton

AXES = ("x", "y", "z")

Transforms = tuple[Array, Array]
"""Rotations (T, J, 3, 3) and positions (T, J, 3) of joints."""


def channels_of(joint: str, letter: str) -> Names:
    """The channels of a joint's translation ("t"), Euler angles ("r") or exponential map ("e"), along x, y and z."""
    return tuple(f"{joint}.{letter}{axis}" for axis in AXES)


def has_channels(motion: Motion, joint: str, letter: str) -> bool:
    """Whether a motion has all three channels of a joint, as :func:`channels_of` names them."""
    return set(channels_of(joint, letter)) <= set(motion.channels)


def skeleton_of(motion: Motion) -> Skeleton:
    """The motion's skeleton; MotionError if it has none."""
    if motion.skeleton is None:
        raise MotionError("this motion has no skeleton, so its joints have no positions or rotations")
    return motion.skeleton


def local_rotations(motion: Motion, joints: Sequence[int] | None = None) -> Array:
    """Rotations (T, J, 3, 3) relative to the parent of every joint, or of the joints with the given indices."""
    skeleton = skeleton_of(motion)
    wanted = skeleton.joints if joints is None else [skeleton.joints[i] for i in joints]
    rotations = frames_last((len(motion), len(wanted), 3, 3))
    rotations[:] = np.eye(3)
    # joints with channels, those of one Euler order together
    for order, places in _by_order(wanted, motion.rotation_columns()).items():
        turning = [wanted[place] for place in places]
        rotations[:, places] = _about_axes(euler_to_rotmat(_angles(motion, turning, order), order), turning)
    return rotations


def _angles(motion: Motion, joints: Sequence[Joint], order: str) -> Array:
    """Angles (T, J, 3) in radians of joints of one Euler order, in this order, 0 without a channel."""
    joint_of_angle, columns, turns = _angle_columns(motion, [joint.name for joint in joints])
    axes = [order.index(motion.channels[column][-1]) for column in columns]
    angles = frames_last((len(motion), len(joints), 3))
    angles[:] = 0.0
    angles[:, joint_of_angle, axes] = motion.values[:, columns] * (2 * np.pi / turns)
    return angles


def _angle_columns(motion: Motion, joints: Sequence[str]) -> tuple[list[int], list[int], Array]:
    """The Euler angles of joints, one after the other: the place of each one's joint in the list, its column, and a
    whole turn in its unit."""
    columns_of = motion.rotation_columns()
    joint_of_angle = []
    columns = []
    for place, name in enumerate(joints):
        joint_of_angle += [place] * len(columns_of[name])
        columns += columns_of[name]
    return (
        joint_of_angle,
        columns,
        np.array([TURN[motion.units[column]] for column in columns]),
    )


def _by_order(joints: Sequence[Joint], names: Container[str] | None = None) -> dict[str, list[int]]:
    """The places in a list of joints, of these names, by Euler order: joints of one order are processed together."""
    places: dict[str, list[int]] = {}
    for place, joint in enumerate(joints):
        if names is None or joint.name in names:
            places.setdefault(joint.order, []).append(place)
    return places


def local_translations(motion: Motion) -> Array:
    """Translations (T, J, 3) of every joint in its parent's frame: the channel if there is one, else the offset."""
    skeleton = skeleton_of(motion)
    # offsets, replaced where a joint has a channel, in the skeleton's unit
    translations = frames_last((len(motion), len(skeleton.joints), 3))
    translations[:] = skeleton.offsets
    for column, name in enumerate(motion.channels):
        joint, _, kind = name.rpartition(".")
        if kind in ("tx", "ty", "tz") and joint in skeleton.places:
            factor = 1.0 if motion.units[column] == "length" else 1 / skeleton.unit_factor(1.0)
            translations[:, skeleton.places[joint], AXES.index(kind[1])] = motion.values[:, column] * factor
    return translations


def global_transforms(motion: Motion) -> Transforms:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) of every joint in the world, lengths in the skeleton's unit."""
    return chained(skeleton_of(motion), local_rotations(motion), local_translations(motion))


def chained(skeleton: Skeleton, rotations: Array, translations: Array) -> Transforms:
    """Rotations (T, J, 3, 3) and positions (T, J, 3) in the world, from those in each parent's frame, in place."""
    # level by level, so that all joints of one depth are computed at once, after their parents
    for level in skeleton.levels:
        parents = skeleton.parents[level]
        turned = rotations[:, parents]
        translations[:, level] = translations[:, parents] + rotated(turned, translations[:, level])
        rotations[:, level] = product(turned, rotations[:, level])
    return rotations, translations


def positions(motion: Motion) -> Array:
    """Positions (T, J, 3) of every joint in the world, in the skeleton's length unit."""
    return global_transforms(motion)[1]


def euler_of(rotations: Array, joint: Joint) -> Array:
    """Local rotations (T, 3, 3) of one joint to its channels rx, ry, rz (T, 3) in radians: undoes C M C^T.

    The angles are continuous over time; the first frame's middle angle is within a quarter turn.
    """
    return eulers_of(rotations[:, None], [joint])[:, 0]


def eulers_of(rotations: Array, joints: Sequence[Joint], leaps: bool = False) -> Array:
    """Like :func:`euler_of` for several joints with their local rotations (T, J, 3, 3): (T, J, 3). leaps: may leap."""
    angles = frames_last(rotations.shape[:-1])
    for order, places in _by_order(joints).items():
        # M from C M C^T, then its angles in the order x, y, z of the channels
        plain = _about_axes(rotations[:, places], [joints[place] for place in places], back=True)
        angles[:, places] = rotmats_to_euler(plain, order, leaps)[..., [order.index(axis) for axis in AXES]]
    return angles


def _about_axes(turns: Array, joints: Sequence[Joint], back: bool = False) -> Array:
    """C M C^T (T, J, 3, 3) of each joint's turns M, or M of these."""
    # only ASF files have joints with axes of their own
    with_axis = [place for place, joint in enumerate(joints) if any(joint.axis)]
    if with_axis:
        frames = np.array([joints[place].frame.T if back else joints[place].frame for place in with_axis])
        turns[:, with_axis] = product(product(frames, turns[:, with_axis]), inverse(frames))
    return turns


def by_name(skeleton: Skeleton, values: Array) -> dict[str, Array]:
    """Rotations (T, J, 3, 3) or translations (T, J, 3) of all joints as (T, 3, 3) or (T, 3) by the joint's name."""
    return dict(zip(skeleton.names, np.moveaxis(values, 1, 0), strict=True))


def side_by_side(rotations: Sequence[Array], frames: int) -> Array:
    """Rotations (T, J, 3, 3) of joints from those of each (T, 3, 3)."""
    stacked = frames_last((frames, len(rotations), 3, 3))
    for joint, of_joint in enumerate(rotations):
        stacked[:, joint] = of_joint
    return stacked


def with_channels(motion: Motion, names: Names, values: Array, units: Names) -> Motion:
    """The motion with channels (T, len(names)) replaced, or prepended if it has none of that name."""
    # new channels stand before all others
    new = tuple(name for name in names if name not in motion.channels)
    added = [names.index(name) for name in new]
    everything = np.concatenate([values[:, added], motion.values], axis=1)
    channels = new + motion.channels
    all_units = [units[i] for i in added] + list(motion.units)
    for i, name in enumerate(names):
        everything[:, channels.index(name)] = values[:, i]
        all_units[channels.index(name)] = units[i]
    return replace(motion, values=everything, channels=channels, units=tuple(all_units))


def continued(last: Motion, rotations: Mapping[str, Array], translations: Mapping[str, Array]) -> Motion:
    """The frames after a motion's last, in its channels: local rotations (T, 3, 3) and translations (T, 3) of joints.

    Lengths are in the skeleton's unit. Joints without channels are left out; channels of other joints keep their
    values.
    """
    # the last frame is repeated, and then posed anew
    last = last[-1:]
    count = len(next(iter(rotations.values())))
    after = posed(
        replace(last, values=np.repeat(last.values, count, axis=0)),
        rotations,
        translations,
        leaps=True,
    )
    # the frame before the first one decides which of two equivalent angles is nearer
    return replace(last, values=np.concatenate([last.values, after.values])).continuous()[1:]


def posed(
    motion: Motion,
    rotations: Mapping[str, Array],
    translations: Mapping[str, Array],
    leaps: bool = False,
) -> Motion:
    """The motion in its channels with other local rotations (T, 3, 3) and translations (T, 3) of some joints, as
    :func:`continued` takes them. leaps: their angles may leap from frame to frame."""
    skeleton = skeleton_of(motion)
    # angles first, then translations, in the units of their channels
    values = np.array(motion.values)
    _set_angles(values, motion, rotations, leaps)
    for column, channel in enumerate(motion.channels):
        name, _, kind = channel.rpartition(".")
        if name in translations and kind in ("tx", "ty", "tz"):
            factor = 1.0 if motion.units[column] == "length" else skeleton.unit_factor(1.0)
            values[:, column] = translations[name][:, AXES.index(kind[1])] * factor
    return replace(motion, values=values)


def _set_angles(values: Array, motion: Motion, rotations: Mapping[str, Array], leaps: bool) -> None:
    """Set the angles in values (T, D) of a motion's channels to local rotations (T, 3, 3) of joints."""
    skeleton = skeleton_of(motion)
    names = [name for name in motion.rotation_columns() if name in rotations]
    joints = [skeleton.joints[skeleton.index(name)] for name in names]
    angles = eulers_of(side_by_side([rotations[name] for name in names], len(motion)), joints, leaps)
    # each angle in its channel's unit
    joint_of_angle, columns, turns = _angle_columns(motion, names)
    axes = [AXES.index(motion.channels[column][-1]) for column in columns]
    values[:, columns] = angles[:, joint_of_angle, axes] * turns / (2 * np.pi)


def places_of(skeleton: Skeleton, turned: Array) -> Array:
    """Positions (T, J, 3) of joints with the root at the origin, from rotations in the world (T, J, 3, 3)."""
    places = frames_last(turned.shape[:-1])
    places[:, 0] = 0.0
    for level in skeleton.levels:
        parents = skeleton.parents[level]
        places[:, level] = places[:, parents] + rotated(turned[:, parents], skeleton.offsets[level])
    return places


def motion_of(skeleton: Skeleton, turned: Array, moved: dict[int, Array], fps: float) -> Motion:
    """The motion of rotations in the world (T, J, 3, 3) and of translations (T, 3) of some joints in their parents'
    frames: all in "deg" and "length", with continuous angles."""
    # tips have no rotation
    turning = [i for i, name in enumerate(skeleton.names) if skeleton.children[i] or not name.endswith(END_SUFFIX)]
    local = _in_parents(skeleton, turned)[:, turning]
    angles = np.degrees(eulers_of(local, [skeleton.joints[i] for i in turning]))

    # of each joint first the translation, then the angles
    units: dict[str, str] = {}
    columns = []
    for i, name in enumerate(skeleton.names):
        if i in moved:
            units |= dict.fromkeys(channels_of(name, "t"), "length")
            columns.append(moved[i])
        if i in turning:
            units |= dict.fromkeys(channels_of(name, "r"), "deg")
            columns.append(angles[:, turning.index(i)])
    return Motion(
        np.concatenate(columns, axis=1),
        tuple(units),
        tuple(units.values()),
        fps,
        skeleton,
    )


def _in_parents(skeleton: Skeleton, turned: Array) -> Array:
    """Rotations (T, J, 3, 3) in each parent's frame, from those in the world."""
    local = turned.copy(order="K")
    local[:, 1:] = product(inverse(turned[:, skeleton.parents[1:]]), turned[:, 1:])
    return local


def heading(motion: Motion) -> Array:
    """Angle (T,) in radians about the vertical y axis that the root faces, unwrapped over time; 0 is along z."""
    forward = local_rotations(motion, [0])[:, 0, :, 2]
    return np.unwrap(angle_of(forward[:, 0], forward[:, 2]))


def without_heading(motion: Motion) -> Motion:
    """The motion turned to face z: a straight line fitted to the heading is removed from the root's rotation.

    This keeps the sway of the hips within a stride and removes any constant heading or turning rate. A motion without
    root rotation is returned unchanged. The root's translation is not changed.
    """
    root = skeleton_of(motion).names[0]
    if not has_channels(motion, root, "r") or not len(motion):
        return motion
    # a line through the heading: where it starts and how fast it turns
    time = np.arange(len(motion))
    line: Array = np.polyval(np.polyfit(time, heading(motion), min(1, len(motion) - 1)), time).astype(np.float64)
    levelled = axis_to_rotmat("y", -line) @ local_rotations(motion, [0])[:, 0]
    return posed(motion, {root: levelled}, {}).continuous()
