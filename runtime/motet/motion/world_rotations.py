"""From the rotations of joints in the world back to a motion."""

import numpy as np

from motet.motion.kinematics import AXES, euler_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import END_SUFFIX, Skeleton


def places_of(skeleton: Skeleton, turned: Array) -> Array:
    """Positions (T, J, 3) of joints with the root at the origin, from rotations in the world (T, J, 3, 3)."""
    places = np.zeros(turned.shape[:-1])
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        places[:, i] = places[:, joint.parent] + turned[:, joint.parent] @ joint.offset
    return places


def motion_of(skeleton: Skeleton, turned: Array, moved: dict[int, Array], fps: float) -> Motion:
    """The motion of rotations in the world (T, J, 3, 3) and of translations (T, 3) of some joints in their parents'
    frames: all in "deg" and "length", with angles that do not leap."""
    local = np.swapaxes(turned[:, [joint.parent for joint in skeleton.joints]], -1, -2) @ turned
    local[:, 0] = turned[:, 0]
    names: list[str] = []
    values: list[Array] = []
    for i, joint in enumerate(skeleton.joints):
        if i in moved:
            names += [f"{joint.name}.t{axis}" for axis in AXES]
            values.append(moved[i])
        if skeleton.children[i] or not joint.name.endswith(END_SUFFIX):
            names += [f"{joint.name}.r{axis}" for axis in AXES]
            values.append(np.degrees(euler_of(local[:, i], joint)))
    units = tuple("deg" if name[-2] == "r" else "length" for name in names)
    return Motion(np.concatenate(values, axis=1), tuple(names), units, fps, skeleton).continuous()
