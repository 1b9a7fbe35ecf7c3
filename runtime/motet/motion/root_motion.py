"""The path over the ground: removed, for figures moved by an engine's code, or moved to a root at the floor."""

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid import Figure, JointMap, map_of
from motet.motion.kinematics import AXES, global_transforms, local_translations, posed, skeleton_of, with_channels
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, inverse, rotated


def in_place(motion: Motion) -> Motion:
    """The motion in place: the root stays over the origin; its height and rotation are kept.

    If another joint than the root carries legs and back, such as a pelvis below a root at the floor, it too stays over
    the origin. Up is y, or the axis along which a human figure stands. A motion without translations is returned
    unchanged. MotionError for one without skeleton.
    """
    skeleton = skeleton_of(motion)
    carrier, up = _carrier(motion)
    chain = [carrier]
    while chain[0] > 0:
        chain.insert(0, skeleton.joints[chain[0]].parent)
    for joint in chain:
        if any(f"{skeleton.names[joint]}.t{axis}" in motion.channels for axis in AXES):
            motion = _over_origin(motion, joint, up)
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


def _over_origin(motion: Motion, joint: int, up: Array) -> Motion:
    """The motion with the translation of one joint reduced to its height."""
    skeleton = skeleton_of(motion)
    rotations, places = global_transforms(motion)
    moved = np.outer(places[:, joint] @ up, up)
    if joint:
        above = skeleton.joints[joint].parent
        moved = rotated(inverse(rotations[:, above]), moved - places[:, above])
    return posed(motion, {}, {skeleton.names[joint]: moved})


def _carrier(motion: Motion) -> tuple[int, Array]:
    """The joint that carries legs and back, and up (3,); for a figure that is not human, the root and y."""
    skeleton = skeleton_of(motion)
    try:
        figure = Figure.of(motion)
    except MotionError:
        return 0, UP
    return figure.fitted.joint_map.carrier(skeleton), figure.turn.T @ UP
