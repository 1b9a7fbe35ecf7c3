"""Orientation warping: hips and legs are turned towards where a figure goes, and the spine is turned back.

So a recorded walk straight ahead goes aside, its feet pointing there and standing as they were recorded, while
shoulders, arms and head stay as they are. Letters in shapes: B figures, J bones.
"""

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.humanoid import BONES, SPINE
from motet.motion.parts import Part, Quaternion, inverse, parts, product, rotated
from motet.motion.rotations import Array

BACK = [BONES.index(name) for name in SPINE]
"""Which bones turn back, each by the same share."""

LEAST = 1e-4
"""Radians below which nothing is turned."""


def warped(rotations: Floats, angles: Array) -> Floats:
    """Local quaternions (B, J, 4) with hips and legs turned to the left by angles (B,) in radians; all that the
    spine carries stays as it is."""
    who = np.flatnonzero(np.abs(angles) > LEAST)
    if not len(who):
        return rotations
    found, half = rotations.copy(), parts(angles[who, None] / 2)[0]
    above: Quaternion = parts(rotations[who, 0])
    found[who, 0] = np.array(product(_about((0.0, 1.0, 0.0), half), above)).T
    for bone in BACK:
        own: Quaternion = parts(rotations[who, bone])
        # about the vertical, as the parent has it
        back = _about(rotated(inverse(above), (0.0, 1.0, 0.0)), -half / len(BACK))
        found[who, bone] = np.array(product(back, own)).T
        above = product(above, own)
    return found


def _about(axis: tuple[Part, Part, Part], half: Part) -> Quaternion:
    """The turn about a unit axis by twice an angle."""
    sine, (x, y, z) = np.sin(half), axis
    return x * sine, y * sine, z * sine, np.cos(half)
