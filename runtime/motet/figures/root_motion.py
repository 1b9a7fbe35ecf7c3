"""The path over the ground: removed, moved to a root at the floor, or led on from the end of another motion."""

import logging
from contextlib import suppress
from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.figures.humanoid import (
    HUMANOID,
    Figure,
    JointMap,
    from_humanoid,
    map_of,
    on_humanoid,
)
from motet.motion.kinematics import (
    by_name,
    channels_of,
    continued,
    global_transforms,
    has_channels,
    local_rotations,
    local_translations,
    posed,
    positions,
    skeleton_of,
    with_channels,
)
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, axis_to_rotmat, inverse, product, rotated

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
    # from the root down, every joint that moves keeps its height alone, in the frame of the joint above
    for joint in reversed(skeleton.ancestors(carrier)):
        name = skeleton.names[joint]
        above = skeleton.joints[joint].parent
        if not set(channels_of(name, "t")).isdisjoint(motion.channels):
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
    # the root takes the path of the joint that carries the hips, and that joint loses it
    moves = local_translations(motion)[:, [0, joint]]
    rotations, places = global_transforms(motion)
    path = (places[:, joint] - places[:, 0]) * (1 - UP)
    moves[:, 0] += path
    moves[:, 1] -= rotated(inverse(rotations[:, skeleton.joints[joint].parent]), path)
    names = channels_of(skeleton.names[0], "t") + channels_of(skeleton.names[joint], "t")
    return with_channels(motion, names, moves.reshape(len(motion), 6), ("length",) * 6)


def to_figure_of(motion: Motion, like: Motion) -> Motion:
    """A motion at the frame rate, on the skeleton and in the channels of another.

    If needed, it is resampled and retargeted to the other figure through the humanoid; both are logged as warnings.
    MotionError, with the reason, for figures that are not human.
    """
    if motion.fps != like.fps:
        log.warning(
            "resampled the second motion from %g to %g fps, the rate of the first",
            motion.fps,
            like.fps,
        )
        motion = motion.continuous().resample(like.fps)
    skeleton = skeleton_of(like)
    if not skeleton_of(motion).is_like(skeleton, 1e-3, first=1):
        log.warning("retargeted the second motion to the figure of the first")
        motion = from_humanoid(on_humanoid(motion), like)
    elif set(motion.channels) == set(like.channels):
        return replace(motion.select(like.channels, like.units), skeleton=skeleton)
    rotations = by_name(skeleton, local_rotations(motion))
    return continued(like[-1:], rotations, by_name(skeleton, local_translations(motion)))


def placed_after(motion: Motion, before: Motion, seconds: float, turn: float) -> Motion | None:
    """A motion placed so that its first frame is ``seconds`` after the last one of another of the same figure.

    turn: its rotation about the vertical axis y, in radians. In between, the hips cross the ground at the mean of the
    velocities at the end of the first and, after turning, at the start of the second. None if the channels lack the
    position or rotation of the hips.
    """
    skeleton = skeleton_of(motion)
    # the first joint with a translation is the hips
    hips = next(
        (i for i, name in enumerate(skeleton.names) if has_channels(motion, name, "t")),
        None,
    )
    if hips is None or not has_channels(motion, skeleton.names[hips], "r"):
        return None
    rotations, places = global_transforms(motion)
    about = axis_to_rotmat("y", np.array(turn))

    # from there its path goes on as it did, turned
    x, _, z = _arrival(motion, before, hips, seconds, about)
    start = np.array([x, places[0, hips, 1], z])
    path = start + rotated(about, places[:, hips] - places[0, hips])

    # the other joints go with the hips
    turned = product(np.broadcast_to(about, (len(motion), 3, 3)), rotations[:, hips])
    return _with_joint(motion, hips, turned, path)


def _with_joint(motion: Motion, joint: int, turned: Array, path: Array) -> Motion:
    """The motion with a joint that has rotations (T, 3, 3) and places (T, 3) in the world."""
    skeleton = skeleton_of(motion)
    rotations, places = global_transforms(motion)
    above = skeleton.joints[joint].parent
    to_parent = inverse(rotations[:, above]) if joint else np.broadcast_to(np.eye(3), turned.shape)
    moved = rotated(to_parent, path - places[:, above] if joint else path)
    return posed(
        motion,
        {skeleton.names[joint]: product(to_parent, turned)},
        {skeleton.names[joint]: moved},
    )


def _arrival(motion: Motion, before: Motion, hips: int, seconds: float, about: Array) -> Array:
    """The place (3,) to which the mean velocity takes the hips of a motion, turned ``about`` (3, 3), ``seconds`` after
    another ends."""
    last = positions(before[-1])[0, hips]
    velocity = (_velocity(before, hips, to_end=True) + about @ _velocity(motion, hips)) / 2
    return np.asarray(last + seconds * velocity)


def _velocity(motion: Motion, joint: int, to_end: bool = False) -> Array:
    """Velocity (3,) of a joint, lengths per second, at the start or end of a motion; 0 for a single frame."""
    frames = max(1, round(0.2 * motion.fps)) + 1  # the mean over .2 s
    places = positions(motion[-frames:] if to_end else motion[:frames])[:, joint]
    return np.asarray((places[-1] - places[0]) * motion.fps / max(1, len(places) - 1))
