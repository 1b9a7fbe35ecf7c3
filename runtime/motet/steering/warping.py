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

TURNING_BONES = [BONES.index(name) for name in SPINE]
"""Bones that turn back, each by the same share."""

LEAST_CHANGE = 1e-4
"""Radians, and shares of a stride, below which nothing is changed."""


def warped(rotations: Floats, angles: Array) -> Floats:
    """Local quaternions (B, J, 4) with hips and legs turned to the left by angles (B,) in radians; all that the
    spine carries stays as it is."""
    figures = _indices(np.abs(angles) > LEAST_CHANGE)
    if figures is None:
        return rotations
    # the hips, and the legs with them
    turned = rotations.copy("K")
    half_angle = single(angles[figures] / 2)
    above: Quaternion = parts(rotations[figures, 0])
    turned[figures, 0] = joined(yawed(above, computed(np.sin, half_angle), computed(np.cos, half_angle)))
    # the spine turns back, about the vertical as each parent has it
    back = half_angle / -len(TURNING_BONES)
    sine = computed(np.sin, back)
    cosine = computed(np.cos, back)
    for bone in TURNING_BONES:
        local: Quaternion = parts(rotations[figures, bone])
        vertical = rotated_axis(inverse(above), 1)
        turned[figures, bone] = joined(product((*times(vertical, sine), cosine), local))
        above = product(above, local)
    return turned


BALL = SOLE[LEG[2]][-1]
"""Of the sole, in the frame of the foot."""

UNDER = HUMANOID.rest_positions[HUMANOID.index("leftFoot"), 2] + BALL[2]
"""How far in front of the hips the balls of a standing figure's feet are."""


def strided(rotations: Floats, contacts: Floats, strides: Array) -> Floats:
    """Local quaternions (B, J, 4) with strides relative to the recorded ones (B,), made by leading the balls of the
    feet in all directions alike: a direction that changed with the row that is played would make feet leap."""
    figures = _indices(np.abs(strides - 1) > LEAST_CHANGE)
    if figures is None:
        return rotations
    hips: Quaternion = parts(rotations[figures, 0])
    longer: Part = single(strides[figures] - 1)
    legs = []
    for limb in limbs(rotations[figures], contacts[figures]):
        turned, places = joints_of(limb, hips, (0.0, 0.0, 0.0))
        # the ball of the foot, from where it is under the hip
        x, _, z = plus(places[2], rotated(turned[2], BALL))
        foot_offset = ((x - limb.offsets[0][0]) * longer, 0.0, (z - UNDER) * longer)
        legs.append(reached_by(hips, turned, places, plus(places[2], foot_offset)))
    strided_rotations = rotations.copy("K")
    strided_rotations[figures] = with_legs(rotations[figures], legs)
    return strided_rotations


def _indices(chosen: NDArray[np.bool_]) -> NDArray[np.intp] | slice | None:
    """An index for the chosen figures (B,), None for none."""
    (indices,) = chosen.nonzero()
    if not len(indices):
        return None
    return slice(None) if len(indices) == len(chosen) else indices
