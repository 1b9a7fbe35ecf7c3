"""From the rotations of joints in the world back to a motion."""

import numpy as np

from motet.motion.kinematics import AXES, euler_of
from motet.motion.motion import Motion
from motet.motion.products import inverse, product, rotated
from motet.motion.rotations import Array, frames_last
from motet.motion.skeleton import END_SUFFIX, Skeleton


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
    frames: all in "deg" and "length", with angles that do not leap."""
    names: list[str] = []
    values: list[Array] = []
    for i, joint in enumerate(skeleton.joints):
        if i in moved:
            names += [f"{joint.name}.t{axis}" for axis in AXES]
            values.append(moved[i])
        if skeleton.children[i] or not joint.name.endswith(END_SUFFIX):
            local = product(inverse(turned[:, joint.parent]), turned[:, i]) if i else turned[:, i]
            names += [f"{joint.name}.r{axis}" for axis in AXES]
            values.append(np.degrees(euler_of(local, joint)))
    units = tuple("deg" if name[-2] == "r" else "length" for name in names)
    return Motion(np.concatenate(values, axis=1), tuple(names), units, fps, skeleton)
