"""From the rotations of joints in the world back to a motion."""

import numpy as np

from motet.motion.kinematics import AXES, eulers_of
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


def local_of(skeleton: Skeleton, turned: Array) -> Array:
    """Rotations (T, J, 3, 3) of joints in their parents' frames, from those in the world."""
    local = turned.copy(order="K")
    local[:, 1:] = product(inverse(turned[:, skeleton.parents[1:]]), turned[:, 1:])
    return local


def motion_of(skeleton: Skeleton, turned: Array, moved: dict[int, Array], fps: float) -> Motion:
    """The motion of rotations in the world (T, J, 3, 3) and of translations (T, 3) of some joints in their parents'
    frames: all in "deg" and "length", with angles that do not leap."""
    kept = [i for i, j in enumerate(skeleton.joints) if skeleton.children[i] or not j.name.endswith(END_SUFFIX)]
    angles = np.degrees(eulers_of(local_of(skeleton, turned)[:, kept], [skeleton.joints[i] for i in kept]))
    columns = dict(zip(kept, np.moveaxis(angles, 1, 0), strict=True))
    names: list[str] = []
    values: list[Array] = []
    for i, joint in enumerate(skeleton.joints):
        if i in moved:
            names += [f"{joint.name}.t{axis}" for axis in AXES]
            values.append(moved[i])
        if i in columns:
            names += [f"{joint.name}.r{axis}" for axis in AXES]
            values.append(columns[i])
    units = tuple("deg" if name[-2] == "r" else "length" for name in names)
    return Motion(np.concatenate(values, axis=1), tuple(names), units, fps, skeleton)
