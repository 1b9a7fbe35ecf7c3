"""The figure in pictures of a motion: the body drawn on its skeleton, and its points in every frame.

A body has round bones with a thickness and a side, and a head. Lengths are in body heights (:attr:`Body.height`), so
bodies of every skeleton are of one size. Nothing here knows a naming scheme: thickness follows from how much body hangs
on a joint, sides from mirrored names.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from motet.errors import MotionError
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import LEFT, MIDDLE, RIGHT, Names, Skeleton, sides_of

COLOURS = {LEFT: (236, 122, 52), RIGHT: (58, 124, 226), MIDDLE: (176, 182, 196)}
"""sRGB of 0 to 255; ``player.html`` has the same."""

YAW = np.radians(40.0)
PITCH = np.radians(12.0)
"""Where the camera of pictures is: from which side of what a figure faces at first, and how far above."""

SAME_SPOT = 1e-6
"""A joint nearer than this to its parent is on the same spot."""

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
        """The height in the skeleton's length unit, even where the rest pose is no body; 1 where there is no extent.

        At least .62 of the longest way along bones from tip to tip, of which people in an A- or a T-pose are .63 to
        .76 high. Figures that rest with all their bones in a line would be taken for half as high.
        """
        lengths = np.linalg.norm(self.skeleton.offsets, axis=1)
        below = np.zeros(len(lengths))
        longest = 0.0
        for i in range(len(lengths) - 1, 0, -1):
            parent = self.skeleton.joints[i].parent
            reach = lengths[i] + below[i]
            longest = max(longest, float(below[parent] + reach))
            below[parent] = max(below[parent], reach)
        return max(self.skeleton.height, 0.62 * longest) or 1.0

    @cached_property
    def sides(self) -> Names:
        """The side of each joint, told from its name."""
        return sides_of(self.skeleton.names)

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
    def bones(self) -> tuple[Bone, ...]:
        """A bone to each joint apart from its parent, the flanks, and the skull in place of what is inside it."""
        bones: list[Bone] = []
        for joint in range(1, len(self.skeleton.joints)):
            if self._is_drawn(joint):
                bones += self._bones_to(joint)
        if self.head:
            jaw = len(self.skeleton.joints)
            carrier = self.skeleton.joints[self.head].parent
            bones.append(Bone(jaw, jaw + 1, SKULL[0][1], SKULL[1][1], MIDDLE, (carrier, carrier)))
        return tuple(bones) or (Bone(0, 0, 0.07, 0.07, MIDDLE, (0, 0)),)

    def _is_drawn(self, joint: int) -> bool:
        """Whether a bone leads to a joint: it is apart from its parent, not in the skull, and no side of the trunk."""
        in_skull = joint == self.head and self.head_is_tip
        beside_trunk = self._in_trunk[joint] and self.sides[joint] != MIDDLE
        return bool(self._lengths[joint] > SAME_SPOT and not in_skull and not beside_trunk)

    def _bones_to(self, joint: int) -> Iterator[Bone]:
        """The bone from a joint's parent, and a flank down to the root from a limb that hangs on the trunk above it."""
        parent = self.skeleton.joints[joint].parent
        beyond = self._beyond[joint]
        thick = _radius(self._lengths[joint] + beyond)
        thin = _radius(beyond)
        side = MIDDLE if self._in_trunk[parent] else self.sides[joint]
        yield Bone(parent, joint, thick, thin, side, (parent, parent))
        hangs = self._in_trunk[parent] and self.sides[joint] != MIDDLE and beyond > 0.2
        if hangs and np.linalg.norm(self._rest[parent]) > SAME_SPOT:
            yield Bone(joint, 0, 0.8 * thick, thick, MIDDLE, (parent, 0))

    @cached_property
    def _lengths(self) -> Array:
        lengths: Array = np.linalg.norm(self.skeleton.offsets, axis=1) / self.height
        return lengths

    @cached_property
    def _beyond(self) -> Array:
        """How much body hangs on each joint: along a limb lengths add up, where limbs meet their squares."""
        squares = np.zeros(len(self._lengths))
        squares[self.head] = 0.15**2  # the length that a head counts for in the thickness of the neck
        for i in range(len(squares) - 1, 0, -1):
            squares[self.skeleton.joints[i].parent] += (self._lengths[i] + np.sqrt(squares[i])) ** 2
        return np.sqrt(squares)

    @cached_property
    def _rest(self) -> Array:
        return self.skeleton.rest_positions / self.height

    @cached_property
    def _in_trunk(self) -> tuple[bool, ...]:
        """Whether each joint belongs to the trunk: it is in the middle, or rests on the spot of one that is."""
        middle = self._rest[[side == MIDDLE for side in self.sides]]
        return tuple(bool(np.any(np.linalg.norm(middle - place, axis=1) <= SAME_SPOT)) for place in self._rest)

    def points(self, joints: Array) -> Array:
        """The points that bones join (..., P, 3), from positions of the joints (..., J, 3), all in heights."""
        if not self.head:
            return joints
        head = joints[..., self.head, :]
        below = joints[..., self.skeleton.joints[self.head].parent, :]
        direction = head - below
        direction = direction / np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-9)
        middle = (head + below) / 2 if self.head_is_tip else head
        skull = np.stack([middle + along * direction for along, _ in SKULL], axis=-2)
        return np.concatenate([joints, skull], axis=-2)


def _radius(beyond: float) -> float:
    """The radius of a bone at a place with this much body beyond it."""
    return float(max(0.014, 0.07 * beyond**0.65))


@dataclass(frozen=True)
class Figure:
    """A motion as the points of a body.

    first: the joint of its skeleton that the body begins with.
    points: (T, P, 3) in body heights, y up, the ground at y = 0: the J joints, then jaw and crown if there is a head.
    heading: where the figure faces in its first frame: radians about y, 0 is +z, a quarter turn is +x.
    """

    body: Body
    first: int
    points: Array
    heading: float


def figure_of(motion: Motion) -> Figure:
    """The figure of a motion; MotionError if it has no skeleton, no frames or positions far beyond any stage."""
    skeleton = skeleton_of(motion)
    if not len(motion):
        raise MotionError("this motion has no frames to show")
    first = first_of(motion)
    body = Body(below(skeleton, first))
    points = positions(motion)[:, first:] / body.height
    if not np.abs(points).max() < 1e6:
        raise MotionError("joints are over 1e+06 body heights from the origin: too far to show")
    lowest = float(points[..., 1].min())
    # a figure that moves up and down stands on y = 0 if its lowest point is that near
    stands = f"{skeleton.names[first]}.ty" in motion.channels and abs(lowest) < 0.1
    points[:, :, 1] -= 0.0 if stands else lowest
    return Figure(body, first, body.points(points), _heading(points[0], body.sides))


def _heading(points: Array, sides: Names) -> float:
    """Where joints (J, 3) face, at right angles to the way from those of the right to those of the left."""
    if LEFT not in sides:
        return 0.0
    of_side = np.array(sides)
    to_left = points[of_side == LEFT].mean(axis=0) - points[of_side == RIGHT].mean(axis=0)
    return float(np.arctan2(-to_left[2], to_left[0]))


def first_of(motion: Motion) -> int:
    """The joint from which on a figure is drawn: the one that carries it about.

    Some programs put a joint above the hips that stays at the origin: it is not a part of the figure.
    """
    skeleton = skeleton_of(motion)
    places = positions(motion)
    first = 0
    travelled = {name.rpartition(".")[0] for name in motion.channels if name[-3:-1] == ".t"}
    while (
        skeleton.children[first] == (first + 1,)
        and not np.ptp(places[:, first], axis=0).any()
        and skeleton.names[first + 1] in travelled
    ):
        first += 1
    return first


def below(skeleton: Skeleton, first: int) -> Skeleton:
    """The skeleton from a joint on, on which all later ones hang."""
    joints = (replace(joint, parent=max(joint.parent - first, -1)) for joint in skeleton.joints[first:])
    return replace(skeleton, joints=tuple(joints))


def camera_axes(yaw: float) -> Array:
    """The axes (3, 3) of a camera of pictures: to its right, up, and towards it; yaw in radians about y, 0 looks at
    the +z side."""
    toward = np.array([np.cos(PITCH) * np.sin(yaw), np.sin(PITCH), np.cos(PITCH) * np.cos(yaw)])
    right = np.array([np.cos(yaw), 0.0, -np.sin(yaw)])
    return np.stack([right, np.cross(toward, right), toward])
