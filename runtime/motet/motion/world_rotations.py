"""From the rotations of joints in the world back to a motion."""

import numpy as np

from motet.motion.kinematics import AXES
from motet.motion.motion import Motion
from motet.motion.rotations import Array, rotmat_to_euler
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
    angles = np.degrees(_euler(skeleton, local))
    names: list[str] = []
    values: list[Array] = []
    for i, joint in enumerate(skeleton.joints):
        if i in moved:
            names += [f"{joint.name}.t{axis}" for axis in AXES]
            values.append(moved[i])
        if skeleton.children[i] or not joint.name.endswith(END_SUFFIX):
            names += [f"{joint.name}.r{axis}" for axis in AXES]
            values.append(angles[:, i])
    units = tuple("deg" if name[-2] == "r" else "length" for name in names)
    return Motion(np.concatenate(values, axis=1), tuple(names), units, fps, skeleton).continuous()


def _euler(skeleton: Skeleton, local: Array) -> Array:
    """Angles (T, J, 3) in radians about x, y, z of local rotations (T, J, 3, 3), each joint in its order and frame."""
    framed = [i for i, joint in enumerate(skeleton.joints) if any(joint.axis)]
    if framed:
        frames = np.stack([skeleton.joints[i].frame for i in framed])
        local[:, framed] = np.swapaxes(frames, -1, -2) @ local[:, framed] @ frames
    angles = np.empty(local.shape[:-1])
    for order in {joint.order for joint in skeleton.joints}:
        joints = [i for i, joint in enumerate(skeleton.joints) if joint.order == order]
        turned = rotmat_to_euler(local[:, joints], order)
        angles[:, joints] = turned[..., [order.index(axis) for axis in AXES]]
    return angles
