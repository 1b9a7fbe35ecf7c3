"""The humanoid: the one figure through which motions of every skeleton are retargeted.

Its bones have the names of the VRM 1.0 humanoid. At rest (every angle 0) it stands in a T-pose: y up, facing +z, the
left at +x, palms down, soles at y = 0 where the root is at its offset; lengths are metres. Every joint's frame is that
of the world at rest, so a joint's rotation says the same on every figure.

Proportions: an adult of 1.70 m. Heights of knee, hip, shoulder and chin are the fractions of stature of Drillis and
Contini (1966), as in Winter, "Biomechanics and Motor Control of Human Movement", figure 4.1, rounded to centimetres;
the joint of the upper arm lies inside the shoulder's width, the ankle at the height of the joint's centre.
"""

import numpy as np

from motet.motion.rotations import Array, rotated
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

LEFT_RIGHT = ("left", "right")

SPINE = ("spine", "chest", "upperChest")
NECK = ("neck", "head")
LEG = ("UpperLeg", "LowerLeg", "Foot", "Toes")
ARM = ("Shoulder", "UpperArm", "LowerArm", "Hand")

TRUNK_PLACES = {
    "hips": ("", (0.0, 0.98, 0.0), "yzx"),
    "spine": ("hips", (0.0, 0.09, 0.0), "yzx"),
    "chest": ("spine", (0.0, 0.12, 0.0), "yzx"),
    "upperChest": ("chest", (0.0, 0.12, 0.0), "yzx"),
    "neck": ("upperChest", (0.0, 0.15, 0.0), "yzx"),
    "head": ("neck", (0.0, 0.09, 0.0), "yzx"),
    "head" + END_SUFFIX: ("head", (0.0, 0.15, 0.0), "zyx"),
}
"""Joint -> parent, offset in metres and Euler order. The order's middle axis is the one that the joint turns least
about, which keeps poses away from gimbal locks."""

SIDE_PLACES = {
    "UpperLeg": ("hips", (0.09, -0.06, 0.0), "xzy"),
    "LowerLeg": ("UpperLeg", (0.0, -0.42, 0.0), "xzy"),
    "Foot": ("LowerLeg", (0.0, -0.42, 0.0), "xzy"),
    "Toes": ("Foot", (0.0, -0.06, 0.13), "xzy"),
    "Toes" + END_SUFFIX: ("Toes", (0.0, -0.02, 0.07), "zyx"),
    "Shoulder": ("upperChest", (0.03, 0.09, 0.0), "zyx"),
    "UpperArm": ("Shoulder", (0.14, 0.0, 0.0), "zyx"),
    "LowerArm": ("UpperArm", (0.28, 0.0, 0.0), "yzx"),
    "Hand": ("LowerArm", (0.25, 0.0, 0.0), "zyx"),
    "Hand" + END_SUFFIX: ("Hand", (0.18, 0.0, 0.0), "zyx"),
}
"""The same for the joints of the left side, without ``left``; those of the right side mirror them."""


def sided(side: str, part: str) -> str:
    """The name of a joint on one side: ``sided("left", "UpperArm")`` is "leftUpperArm"."""
    return side + part


def _joints() -> list[Joint]:
    places = dict(TRUNK_PLACES)
    for side, sign in zip(LEFT_RIGHT, (1.0, -1.0), strict=True):
        for part, (parent, (x, y, z), order) in SIDE_PLACES.items():
            carrier = sided(side, parent) if parent in SIDE_PLACES else parent
            places[sided(side, part)] = (carrier, (sign * x, y, z), order)
    names = list(places)
    return [
        Joint(name, names.index(parent) if parent else -1, offset, order)
        for name, (parent, offset, order) in places.items()
    ]


HUMANOID = Skeleton(tuple(_joints()), metres_per_unit=1.0)
"""The humanoid's skeleton: 22 bones and the tips of head, hands and toes."""

BONES = tuple(name for name in HUMANOID.names if not name.endswith(END_SUFFIX))
"""The bones of the humanoid: all joints but the tips, each after its parent."""

REQUIRED = tuple(
    name
    for name in BONES
    if name in ("hips", "spine", "head") or name.removeprefix("left").removeprefix("right") in (*LEG[:3], *ARM[1:])
)
"""The bones required by VRM; the others stay at rest if a figure lacks them."""

PARENTS = {name: HUMANOID.names[max(0, HUMANOID.joints[HUMANOID.index(name)].parent)] for name in BONES[1:]}
"""For each bone but the hips its parent."""

T_POSE = HUMANOID.rest_positions + HUMANOID.offsets[0]
"""Positions (J, 3) of the humanoid's joints in the T-pose, with the soles at y = 0."""

SOLE = {"Foot": ((0.0, -0.08, -0.05), (0.0, -0.08, 0.13)), "Toes": ((0.0, -0.02, 0.07),)}
"""Points of the sole in the frames of the foot (heel, ball) and of the toes (tip)."""


def leg_length() -> float:
    """Length of the humanoid's thigh and shin together, in metres: the measure by which figures are scaled."""
    return float(sum(np.linalg.norm(HUMANOID.offsets[HUMANOID.index(sided("left", part))]) for part in LEG[1:3]))


def sole_points(rotations: Array, positions: Array) -> Array:
    """Points (T, 6, 3) of both soles, from the joints' world rotations (T, J, 3, 3) and positions (T, J, 3)."""
    points = []
    for side in LEFT_RIGHT:
        for part, places in SOLE.items():
            joint = HUMANOID.index(sided(side, part))
            points += [positions[:, joint] + rotated(rotations[:, joint], np.array(place)) for place in places]
    return np.stack(points, axis=1)


def ground_under(soles: Array) -> float:
    """The height of the ground under points (T, P, 3) of the soles: the lowest is deeper in 5 % of the frames; 0 for
    no frames."""
    return float(np.percentile(soles[..., 1].min(axis=1), 5)) if len(soles) else 0.0
