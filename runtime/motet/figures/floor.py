"""Bodies that lie, kneel or crawl on the floor instead of in it: the body is lifted, and limbs are turned upwards."""

from dataclasses import replace

import numpy as np

from motet.figures.feet.hold import lift
from motet.figures.humanoid import HUMANOID
from motet.motion.kinematics import global_transforms, motion_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, product, rotated, swing

THICKNESS = {
    "hips": 0.07,
    "spine": 0.07,
    "chest": 0.07,
    "upperChest": 0.07,
    "neck": 0.05,
    "head": 0.05,
    "LowerLeg": 0.04,
}
"""Metres from a joint to the skin, less than most people's: nobody who touches the floor is to float over it."""

LIMB_ENDS = ("LowerArm", "Hand", "Foot", "Toes", "Hand_end", "Toes_end")
"""Ends of the names of joints that are turned upwards about the joint before; the rest is lifted as a whole."""

TOLERATED = 0.015
"""Metres that a wrist, an elbow or an ankle may be under the floor: to lift the wrist of an arm that stands on it bends
the arm."""


def above_floor(motion: Motion) -> Motion:
    """A motion of the humanoid, on a ground at height 0, with nothing under the floor.

    First the whole body is lifted until its trunk, head and knees are above the floor, as thick as they are; then each
    forearm, hand, foot and toe still under it is turned upwards about the joint before it, with all that hangs on it.
    Nothing changes where nothing is under the floor. Recordings need it where hands and toes have no joint of
    their own, or the performer was larger than the skeleton.
    """
    rotations, places = global_transforms(motion)
    turned = np.array(rotations)
    places = np.array(places)
    # what is under the floor leaves and returns in a tenth of a second before and after
    reach = 0.1 * motion.fps
    thickness = _thickness()
    limbs = [joint for joint, name in enumerate(HUMANOID.names) if name.endswith(LIMB_ENDS)]

    # the whole body rises until all but the limbs is above the floor
    body = np.setdiff1d(np.arange(len(thickness)), limbs)
    depth = (thickness[body] - places[:, body, 1]).max(axis=1)
    places[..., 1] += lift(depth, reach)[:, None]

    # then each limb that is still under it turns upwards
    for joint in limbs:
        height = lift(thickness[joint] - places[:, joint, 1], reach)
        _raise_limb(joint, height, turned, places)
    lifted = motion_of(HUMANOID, turned, {0: places[:, 0]}, motion.fps)
    return replace(motion, values=lifted.select(motion.channels, motion.units).values)


def _thickness() -> Array:
    """Metres (J,) from each of the humanoid's joints to the skin, less what may be under the floor."""
    thickness = []
    for name in HUMANOID.names:
        skin = THICKNESS.get(name.removeprefix("left").removeprefix("right"), 0.0)
        thickness.append(skin - TOLERATED if name.endswith(LIMB_ENDS[:4]) else skin)
    return np.array(thickness)


def _raise_limb(joint: int, height: Array, turned: Array, places: Array) -> None:
    """Raise a joint by heights (T,): turn the bone to it, with all that hangs on that, in rotations (T, J, 3, 3) and
    positions (T, J, 3) of all joints."""
    parent = HUMANOID.joints[joint].parent
    bone = places[:, joint] - places[:, parent]
    # straight down, a shin goes forward, a hand or foot the way its back faces
    side = turned[:, parent, :, 2 if HUMANOID.names[joint].endswith("Foot") else 1]
    turn = swing(bone, _raised(bone, side, height))[:, None]
    hanging = HUMANOID.below(parent)
    places[:, hanging] = places[:, [parent]] + rotated(turn, places[:, hanging] - places[:, [parent]])
    turned[:, hanging] = product(turn, turned[:, hanging])


def _raised(bone: Array, side: Array, height: Array) -> Array:
    """Vectors (T, 3) of the same lengths whose ends are higher by ``height`` (T,), or upright.

    side: directions (T, 3); the more is missing, the more a bone that points straight down bends that way.
    """
    # as much higher as is wanted, and as much shorter over the ground as the length then leaves
    length = np.linalg.norm(bone, axis=-1, keepdims=True)
    rise = np.minimum(bone[:, 1:2] + height[:, None], 0.999 * length)
    flat = bone[:, [0, 2]] + height[:, None] * side[:, [0, 2]]
    flat *= np.sqrt(length**2 - rise**2) / np.maximum(np.linalg.norm(flat, axis=-1, keepdims=True), 1e-9)
    return np.concatenate([flat[:, :1], rise, flat[:, 1:]], axis=-1)
