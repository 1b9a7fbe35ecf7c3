"""Recorded legs go another way, and with other strides.

Orientation warping: hips and legs are turned towards where a figure goes, and the spine is turned back. So a recorded
walk straight ahead goes aside, its feet pointing there and standing as they were recorded, while shoulders, arms and
head stay as they are. Stride warping: feet are led nearer to the body, or farther from it, along the way. Letters in
shapes: B figures, J bones.
"""

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.feet.lock import joints_of, limbs, reached_by, with_legs
from motet.motion.humanoid import BONES, HUMANOID, LEG, SOLE, SPINE
from motet.motion.parts import Part, Quaternion, inverse, parts, plus, product, rotated
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


BALL = SOLE[LEG[2]][-1]
"""Of the sole, in the frame of the foot."""

UNDER = HUMANOID.rest_positions[HUMANOID.index("leftFoot"), 2] + BALL[2]
"""How far in front of the hips the balls of a standing figure's feet are."""


def strided(rotations: Floats, contacts: Floats, ways: Array, strides: Array) -> Floats:
    """Local quaternions (B, J, 4) with the balls of the feet led so far along ways (B,), in radians from the facing,
    that strides are these times (B,) as long."""
    who = np.flatnonzero(np.abs(strides - 1) > LEAST)
    if not len(who):
        return rotations
    sin, cos, by = parts(np.stack([np.sin(ways[who]), np.cos(ways[who]), strides[who] - 1], axis=1))
    hips: Quaternion = parts(rotations[who, 0])
    legs = []
    for limb in limbs(rotations[who], contacts[who]):
        turned, places = joints_of(limb, hips, (0.0, 0.0, 0.0))
        x, _, z = plus(places[2], rotated(turned[2], BALL))
        far = ((x - limb.offsets[0][0]) * sin + (z - UNDER) * cos) * by
        legs.append(reached_by(hips, turned, places, plus(places[2], (far * sin, 0.0, far * cos))))
    found = rotations.copy()
    found[who] = with_legs(rotations[who], legs)
    return found


def _about(axis: tuple[Part, Part, Part], half: Part) -> Quaternion:
    """The turn about a unit axis by twice an angle."""
    sine, (x, y, z) = np.sin(half), axis
    return x * sine, y * sine, z * sine, np.cos(half)
