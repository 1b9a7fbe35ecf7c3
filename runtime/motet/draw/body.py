"""The body drawn on a skeleton: round bones with a thickness and a side, and a head.

Lengths are in body heights (:attr:`Body.height`), so bodies of every skeleton are of one size. Nothing here knows a
naming scheme: thickness follows from how much body hangs on a joint, sides from mirrored names.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from motet.motion.rotations import Array
from motet.motion.skeleton import LEFT, MIDDLE, RIGHT, Skeleton, sides_of

COLOURS = {LEFT: (236, 122, 52), RIGHT: (58, 124, 226), MIDDLE: (176, 182, 196)}
"""sRGB of 0 to 255; ``player.html`` has the same."""

THICKNESS, TAPER, THINNEST = 0.07, 0.65, 0.014
"""A bone has the radius THICKNESS * (length beyond it) ** TAPER, and at least THINNEST."""

SAME_SPOT = 1e-6
"""A joint nearer than this to its parent is on the same spot."""

HEIGHT_OF_PATH = 0.62
"""What part of the longest way along bones from tip to tip a figure is high at least: people in an A- or a T-pose are
.63 to .76. Figures that rest with all their bones in a line would be taken for half as high."""

SKULL = ((-0.024, 0.040), (0.020, 0.050))
"""Jaw and crown: how far along the head's direction from the middle of the head, and the radius."""


class Bone(NamedTuple):
    """A tapered capsule between two points, with a radius at each, in heights.

    carriers: the joints with which the two ends move when a pose is made by turning a rest pose.
    """

    start: int
    end: int
    start_radius: float
    end_radius: float
    side: str
    carriers: tuple[int, int]


@dataclass(frozen=True)
class Body:
    """What is drawn for a skeleton of J joints: :attr:`bones` between the J joints, or these and jaw and crown."""

    skeleton: Skeleton

    @cached_property
    def height(self) -> float:
        """The height in the skeleton's length unit, even where the rest pose is no body; 1 where there is no extent."""
        return max(self.skeleton.height, HEIGHT_OF_PATH * _longest_path(self.skeleton)) or 1.0

    @cached_property
    def sides(self) -> tuple[str, ...]:
        """The side of each joint, told from its name."""
        return sides_of(self.skeleton.names)

    @cached_property
    def lengths(self) -> Array:
        """How far each joint (J) is from its parent at rest, in heights."""
        lengths: Array = np.linalg.norm(self.skeleton.offsets, axis=1) / self.height
        return lengths

    @cached_property
    def head(self) -> int:
        """The joint in the head: the last one called so, else the highest tip that has no side; 0 if none is."""
        skeleton = self.skeleton
        middle = [i for i, side in enumerate(self.sides) if i and side == MIDDLE]
        named = [i for i in middle if "head" in skeleton.names[i].lower()]
        tips = [i for i in middle if not skeleton.children[i]]
        return named[-1] if named else max(tips, key=lambda i: float(skeleton.rest_positions[i, 1]), default=0)

    @cached_property
    def head_is_tip(self) -> bool:
        """Whether the joint in the head is its crown, and the one before it the neck's upper end."""
        parent = self.skeleton.joints[self.head].parent
        return parent >= 0 and "head" in self.skeleton.names[parent].lower()

    @cached_property
    def beyond(self) -> Array:
        """For each joint (J) how much body hangs on it: along a limb lengths add up, where limbs meet their squares."""
        squares = np.zeros(len(self.lengths))
        # the length that a head counts for in the thickness of the neck
        squares[self.head] = 0.15**2
        for i in range(len(squares) - 1, 0, -1):
            squares[self.skeleton.joints[i].parent] += (self.lengths[i] + np.sqrt(squares[i])) ** 2
        return np.sqrt(squares)

    @cached_property
    def bones(self) -> tuple[Bone, ...]:
        """A bone to each joint apart from its parent, the flanks, and the skull in place of what is inside it."""
        bones = [bone for i in range(1, len(self.lengths)) for bone in self._bones_to(i)]
        if self.head:
            jaw, carrier = len(self.lengths), self.skeleton.joints[self.head].parent
            bones.append(Bone(jaw, jaw + 1, SKULL[0][1], SKULL[1][1], MIDDLE, (carrier, carrier)))
        return tuple(bones) or (Bone(0, 0, THICKNESS, THICKNESS, MIDDLE, (0, 0)),)

    @cached_property
    def trunk(self) -> tuple[bool, ...]:
        """Whether each joint belongs to the trunk: it is in the middle, or rests on the spot of one that is."""
        rest = self.skeleton.rest_positions / self.height
        middle = rest[[side == MIDDLE for side in self.sides]]
        return tuple(bool(np.any(np.linalg.norm(middle - place, axis=1) <= SAME_SPOT)) for place in rest)

    def _bones_to(self, i: int) -> list[Bone]:
        parent, side = self.skeleton.joints[i].parent, self.sides[i]
        in_skull = i == self.head and self.head_is_tip
        if self.lengths[i] <= SAME_SPOT or in_skull or (self.trunk[i] and side != MIDDLE):
            return []
        thick, thin = _radius(self.lengths[i] + self.beyond[i]), _radius(self.beyond[i])
        bone = Bone(parent, i, thick, thin, MIDDLE if self.trunk[parent] else side, (parent, parent))
        rise = np.linalg.norm(self.skeleton.rest_positions[parent]) / self.height
        # a limb that hangs on the trunk above the root gets a flank down to the root
        if self.trunk[parent] and side != MIDDLE and self.beyond[i] > 0.2 and rise > SAME_SPOT:
            return [bone, Bone(i, 0, 0.8 * thick, thick, MIDDLE, (parent, 0))]
        return [bone]

    def points(self, joints: Array) -> Array:
        """The points that bones join (..., P, 3), from positions of the joints (..., J, 3), all in heights."""
        if not self.head:
            return joints
        head, below = (joints[..., i, :] for i in (self.head, self.skeleton.joints[self.head].parent))
        direction = head - below
        direction = direction / np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-9)
        middle = (head + below) / 2 if self.head_is_tip else head
        skull = np.stack([middle + along * direction for along, _ in SKULL], axis=-2)
        return np.concatenate([joints, skull], axis=-2)


def _longest_path(skeleton: Skeleton) -> float:
    """The length of the longest way along bones from one tip to another."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    below, longest = np.zeros(len(lengths)), 0.0
    for i in range(len(lengths) - 1, 0, -1):
        parent, reach = skeleton.joints[i].parent, lengths[i] + below[i]
        longest = max(longest, float(below[parent] + reach))
        below[parent] = max(below[parent], reach)
    return longest


def _radius(beyond: float) -> float:
    return float(max(THINNEST, THICKNESS * beyond**TAPER))
