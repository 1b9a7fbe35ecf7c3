"""Recorded legs go another way, and with other strides.

Orientation warping: hips and legs are turned towards where a figure goes, and the spine is turned back. So a recorded
walk straight ahead goes aside, its feet pointing there and standing as they were recorded, while shoulders, arms and
head stay as they are. Stride warping: feet are led nearer to the body, or farther from it. Letters in
shapes: B figures, J bones.
"""

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.figures.humanoid import BONES, HUMANOID, LEG, SOLE, SPINE
from motet.figures.legs import joints_of, limbs, reached_by, with_legs
from motet.motion.rotations import Array
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    computed,
    inverse,
    joined,
    parts,
    plus,
    product,
    rotated,
    rotated_axis,
    single,
    times,
    yawed,
)

BACK = [BONES.index(name) for name in SPINE]
"""Which bones turn back, each by the same share."""

LEAST = 1e-4
"""Radians below which nothing is turned."""


def warped(rotations: Floats, angles: Array) -> Floats:
    """Local quaternions (B, J, 4) with hips and legs turned to the left by angles (B,) in radians; all that the
    spine carries stays as it is."""
    who = _those(np.abs(angles) > LEAST)
    if who is None:
        return rotations
    found, half = rotations.copy("K"), single(angles[who] / 2)
    above: Quaternion = parts(rotations[who, 0])
    found[who, 0] = joined(yawed(above, computed(np.sin, half), computed(np.cos, half)))
    back = half / -len(BACK)
    sine, cosine = computed(np.sin, back), computed(np.cos, back)
    for bone in BACK:
        own: Quaternion = parts(rotations[who, bone])
        up = rotated_axis(inverse(above), 1)  # as the parent has it
        found[who, bone] = joined(product((*times(up, sine), cosine), own))
        above = product(above, own)
    return found


BALL = SOLE[LEG[2]][-1]
"""Of the sole, in the frame of the foot."""

UNDER = HUMANOID.rest_positions[HUMANOID.index("leftFoot"), 2] + BALL[2]
"""How far in front of the hips the balls of a standing figure's feet are."""


def strided(rotations: Floats, contacts: Floats, strides: Array) -> Floats:
    """Local quaternions (B, J, 4) with the balls of the feet led so far that strides are these times (B,) as long, in
    whichever direction they go: one that changed with the row that is played would make feet leap."""
    who = _those(np.abs(strides - 1) > LEAST)
    if who is None:
        return rotations
    hips: Quaternion = parts(rotations[who, 0])
    by: Part = single(strides[who] - 1)
    legs = []
    for limb in limbs(rotations[who], contacts[who]):
        turned, places = joints_of(limb, hips, (0.0, 0.0, 0.0))
        x, _, z = plus(places[2], rotated(turned[2], BALL))
        led = ((x - limb.offsets[0][0]) * by, 0.0, (z - UNDER) * by)
        legs.append(reached_by(hips, turned, places, plus(places[2], led)))
    found = rotations.copy("K")
    found[who] = with_legs(rotations[who], legs)
    return found


def _those(which: NDArray[np.bool_]) -> NDArray[np.intp] | slice | None:
    """Those (B,) for which it holds, for indices; None for none."""
    (found,) = which.nonzero()
    return None if not len(found) else slice(None) if len(found) == len(which) else found
