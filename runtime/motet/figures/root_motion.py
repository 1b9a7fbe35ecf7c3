"""The path over the ground: removed, moved to a root at the floor, or led on from the end of another motion."""

import logging
from contextlib import suppress
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.figures.humanoid import HUMANOID, Figure, JointMap, from_humanoid, map_of, on_humanoid
from motet.motion.kinematics import (
    AXES,
    continued,
    global_transforms,
    local_rotations,
    local_translations,
    posed,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, axis_to_rotmat, inverse, product, rotated
from motet.motion.skeleton import Skeleton

log = logging.getLogger(__name__)


def in_place(motion: Motion) -> Motion:
    """The motion in place: the root stays over the origin; its height and rotation are kept.

    If another joint than the root carries legs and back, such as a pelvis below a root at the floor, it too stays over
    the origin. Up is y, or the axis along which a human figure stands. A motion without translations is returned
    unchanged. MotionError for one without skeleton.
    """
    skeleton = skeleton_of(motion)
    # of the humanoid, or of a figure that is not human
    carrier = 0
    up = UP
    if skeleton != HUMANOID:
        with suppress(MotionError):
            figure = Figure.of(motion)
            carrier = figure.fitted.joint_map.carrier(skeleton)
            up = figure.turn.T @ UP
    for joint in reversed(skeleton.ancestors(carrier)):
        name = skeleton.names[joint]
        above = skeleton.joints[joint].parent
        if any(f"{name}.t{axis}" in motion.channels for axis in AXES):
            rotations, places = global_transforms(motion)
            moved = np.outer(places[:, joint] @ up, up)
            moved = rotated(inverse(rotations[:, above]), moved - places[:, above]) if joint else moved
            motion = posed(motion, {}, {name: moved})
    return motion


def travel_on_root(motion: Motion, joint_map: JointMap | None = None) -> Motion:
    """The motion with its path over the ground moved to the root, if that rests at the floor and carries the hips.

    Unreal and Godot then use it as root motion; rotation stays with the hips. Any other motion is returned unchanged.
    MotionError for a figure that is not human.
    """
    skeleton = skeleton_of(motion)
    joint = (joint_map or map_of(motion)).carrier(skeleton)
    # a root this far below the joint that carries legs and back, in heights, rests at the floor
    if float(np.linalg.norm(skeleton.rest_positions[joint])) < 0.3 * skeleton.height:
        return motion
    moves = local_translations(motion)[:, [0, joint]]
    rotations, places = global_transforms(motion)
    way = (places[:, joint] - places[:, 0]) * (1 - UP)
    moves[:, 0] += way
    moves[:, 1] -= rotated(inverse(rotations[:, skeleton.joints[joint].parent]), way)
    names = tuple(f"{skeleton.names[i]}.t{axis}" for i in (0, joint) for axis in AXES)
    return with_channels(motion, names, moves.reshape(len(motion), 6), ("length",) * 6)


def to_figure_of(motion: Motion, like: Motion) -> Motion:
    """A motion at the frame rate, on the skeleton and in the channels of another.

    If needed, it is resampled and retargeted to the other figure through the humanoid; both are logged as warnings.
    MotionError, with the reason, for figures that are not human.
    """
    if motion.fps != like.fps:
        log.warning("resampled the second motion from %g to %g fps, the rate of the first", motion.fps, like.fps)
        motion = motion.continuous().resample(like.fps)
    skeleton = skeleton_of(like)
    if not _same_figure(skeleton_of(motion), skeleton):
        log.warning("retargeted the second motion to the figure of the first")
        motion = from_humanoid(on_humanoid(motion), like)
    elif set(motion.channels) == set(like.channels):
        return replace(motion.select(like.channels, like.units), skeleton=skeleton)
    rotations = local_rotations(motion)
    translations = local_translations(motion)
    rotations_by_name = {name: rotations[:, i] for i, name in enumerate(skeleton.names)}
    translations_by_name = {name: translations[:, i] for i, name in enumerate(skeleton.names)}
    return continued(like[-1:], rotations_by_name, translations_by_name)


def _same_figure(skeleton: Skeleton, other: Skeleton) -> bool:
    """Whether two skeletons have the same joints and unit, and offsets within a thousandth of the height."""
    if len(skeleton.joints) != len(other.joints) or skeleton.metres_per_unit != other.metres_per_unit:
        return False
    for joint, like in zip(skeleton.joints, other.joints, strict=True):
        if replace(joint, offset=like.offset) != like:
            return False
    return bool(np.abs(skeleton.offsets[1:] - other.offsets[1:]).max(initial=0) <= 1e-3 * other.height)


def placed_after(motion: Motion, before: Motion, seconds: float, turn: float) -> Motion | None:
    """A motion placed so that its first frame is ``seconds`` after the last one of another of the same figure.

    turn: its rotation about the vertical axis y, in radians. In between, the hips cross the ground at the mean of the
    velocities at the end of the first and, after turning, at the start of the second. None if the channels lack the
    position or rotation of the hips.
    """
    skeleton = skeleton_of(motion)
    hips = _moving_joint(motion)
    if hips is None or not _has_channels(motion, skeleton.names[hips], "r"):
        return None
    name = skeleton.names[hips]
    rotations, places = global_transforms(motion)
    about = axis_to_rotmat("y", np.array(turn))

    # the hips arrive where the mean velocity takes them, at their own height
    last = global_transforms(before[-1])[1][0, hips]
    velocity = (_velocity(before, hips, to_end=True) + about @ _velocity(motion, hips)) / 2
    arrival = last + seconds * velocity
    start = np.array([arrival[0], places[0, hips, 1], arrival[2]])
    path = start + rotated(about, places[:, hips] - places[0, hips])

    # in the frame of the joint above
    above = skeleton.joints[hips].parent
    to_parent = np.broadcast_to(np.eye(3), (len(motion), 3, 3))
    origin = np.zeros((len(motion), 3))
    if above >= 0:
        to_parent = inverse(rotations[:, above])
        origin = places[:, above]
    turned = product(np.broadcast_to(about, to_parent.shape), rotations[:, hips])
    return posed(motion, {name: product(to_parent, turned)}, {name: rotated(to_parent, path - origin)})


def _moving_joint(motion: Motion) -> int | None:
    """The first joint with a translation, which the hips are."""
    for i, name in enumerate(skeleton_of(motion).names):
        if _has_channels(motion, name, "t"):
            return i
    return None


def _has_channels(motion: Motion, joint: str, letter: str) -> bool:
    """Whether a motion has all three channels of a joint's translation ("t") or rotation ("r")."""
    return {f"{joint}.{letter}{axis}" for axis in AXES} <= set(motion.channels)


def _velocity(motion: Motion, joint: int, to_end: bool = False) -> Array:
    """Velocity (3,) of a joint, lengths per second, at the start or end of a motion; 0 for a single frame."""
    frames = max(1, round(0.2 * motion.fps)) + 1  # the mean over .2 s
    places = global_transforms(motion[-frames:] if to_end else motion[:frames])[1][:, joint]
    velocity: Array = (places[-1] - places[0]) * motion.fps / max(1, len(places) - 1)
    return velocity
