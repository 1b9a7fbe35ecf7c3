"""Motions in place: without the way over the ground, as engines want clips of figures that their code moves."""

import numpy as np

from motet.errors import MotionError
from motet.motion.fitting import fit, upright
from motet.motion.kinematics import AXES, global_transforms, posed, skeleton_of
from motet.motion.motion import Motion
from motet.motion.products import inverse, rotated
from motet.motion.retarget import map_of
from motet.motion.rotations import Array

Y = np.array([0.0, 1.0, 0.0])


def in_place(motion: Motion) -> Motion:
    """The motion with the root over the origin in every frame: its way over the ground goes, height and turns stay.

    Where another joint than the root carries legs and back, such as a pelvis below a root at the floor, it stays over
    the origin, too. Up is y, or the axis along which a human figure stands. A motion without translations comes back
    as it is. MotionError for one without skeleton.
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


def _over_origin(motion: Motion, joint: int, up: Array) -> Motion:
    """The motion with the translation of one joint that leaves only its height."""
    skeleton = skeleton_of(motion)
    rotations, places = global_transforms(motion)
    moved = np.outer(places[:, joint] @ up, up)
    if joint:
        above = skeleton.joints[joint].parent
        moved = rotated(inverse(rotations[:, above]), moved - places[:, above])
    return posed(motion, {}, {skeleton.names[joint]: moved})


def _carrier(motion: Motion) -> tuple[int, Array]:
    """The joint that carries legs and back and where up is (3,); of what is no human figure the root, and y."""
    skeleton = skeleton_of(motion)
    try:
        joint_map, transforms = map_of(motion), global_transforms(motion)
        turn = upright(fit(skeleton, joint_map, *transforms), transforms[1])
    except MotionError:
        return 0, Y
    return joint_map.carrier(skeleton), turn.T @ Y
