"""The inverse kinematics of the humanoid's legs: an ankle brought to a place, of one figure or of many at once."""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, HUMANOID, LEG, limb_of
from motet.figures.two_bones import TwoBones
from motet.motion.scalar_or_batch import (
    Part,
    Quaternion,
    Vector,
    inverse,
    plus,
    product,
    rotated,
    rotated_axis,
)

Floats = NDArray[np.float32]


_LEG_NAMES = limb_of("left", LEG) + limb_of("right", LEG)

LEG_BONES = np.array([BONES.index(name) for name in _LEG_NAMES]).reshape(2, 4)
"""Bones (2, 4) of both legs among the humanoid's."""

LEG_OFFSETS: NDArray[Any] = HUMANOID.offsets[[HUMANOID.index(name) for name in _LEG_NAMES]].reshape(2, 4, 3)
"""Where they begin in their parents' frames (2, 4, 3), the hips' for the first."""


class Limb(NamedTuple):
    """What is played of a leg: rotations of its joints, where they begin, both in their parents' frames, and how much
    its foot stands."""

    local: list[Quaternion]
    offsets: list[Vector]
    contact: Part


def limbs(rotations: Floats, contacts: Floats) -> Iterator[Limb]:
    """The left and the right leg of one character, or the legs of all as one; of poses' rotations and contacts."""
    if len(rotations) == 1:
        for bones, offsets, contact in zip(LEG_BONES, LEG_OFFSETS.tolist(), contacts[0].tolist(), strict=True):
            yield Limb(rotations[0, bones].tolist(), offsets, contact)
    else:
        yield limbs_as_arrays(rotations, contacts)


def limbs_as_arrays(rotations: Floats, contacts: Floats) -> Limb:
    """The legs of characters as one: each part is an array (2, B) of left and right legs."""
    local = np.array(
        rotations.transpose(1, 2, 0)[LEG_BONES].transpose(1, 2, 0, 3),
        dtype=np.float64,
        order="C",
    )
    offsets = LEG_OFFSETS.transpose(1, 2, 0)[..., None]
    return Limb([tuple(quats) for quats in local], [tuple(offset) for offset in offsets], contacts.T)


def with_legs(rotations: Floats, legs: list[list[Quaternion]]) -> Floats:
    """Rotations of poses with others of thighs, shins and feet, of legs as :func:`limbs` gives them."""
    # of one character its sides, their joints and the joints' parts; of many the joints, their parts and both sides
    turned: NDArray[Any] = np.array(legs)
    by_side = turned[..., None] if len(legs) == 2 else turned[0].transpose(2, 0, 1, 3)
    posed = rotations.copy("K")
    posed.transpose(1, 2, 0)[LEG_BONES[:, :3]] = by_side
    return posed


def joints_of(limb: Limb, hips: Quaternion, place: Vector) -> tuple[list[Quaternion], list[Vector]]:
    """Rotations and places of a leg's joints where the hips are."""
    turned = []
    places = []
    above = hips
    # down the leg, each joint is where the one above it takes its offset
    for local, offset in zip(limb.local, limb.offsets, strict=True):
        place = plus(place, rotated(above, offset))
        above = product(above, local)
        turned.append(above)
        places.append(place)
    return turned, places


def reached_by(hips: Quaternion, turned: list[Quaternion], places: list[Vector], target: Vector) -> list[Quaternion]:
    """Rotations of thigh, shin and foot in their parents' frames, of a leg with its ankle at a target; the foot stays
    as it is in the world."""
    # the knee is a hinge about the shin's x axis
    thigh, shin, foot = turned[:3]
    leg = TwoBones(places[0], places[1], places[2], rotated_axis(shin, 0))
    turn_thigh, turn_shin = leg.turns(leg.eased(target))

    # thigh and shin turn in the world, then each is seen from the joint above it
    thigh = product(turn_thigh, thigh)
    shin = product(turn_shin, shin)
    return [
        product(inverse(hips), thigh),
        product(inverse(thigh), shin),
        product(inverse(shin), foot),
    ]
