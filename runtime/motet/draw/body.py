"""The body that figures of people have in pages, pictures and files: a faceless mannequin, made from its outlines.

mannequin.json has tables of key rings along trunk and head, leg, arm and finger in metres, around the humanoid's
joints; half-way between them lie smooth ones. Trunk, legs and arms are one closed surface: a leg begins with half of
the trunk's lowest ring and a bridge through the crotch, an arm with the border of a hole in the trunk. Arms are shaped
as they mostly are, hanging by SLOPE, and then turned up into the T-pose. Each corner belongs to the joint of its ring
at first, from where weights even out.
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.draw.figure import COLOURS
from motet.draw.mesh import Mesh, patch_triangles, ring, smooth_weights, smoothed
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, SIDES, T_POSE, joint_of
from motet.motion.rotations import Array, Indices, Mask
from motet.motion.skeleton import LEFT, MIDDLE, RIGHT, Triple

BODY, LEFT_PART, RIGHT_PART, MIDDLE_PART = range(4)
"""Parts that have a colour each: of people the body and the bands at wrist and ankle of either side; of others bones of
either side and of the middle."""

INKS = np.array([(168, 179, 198), COLOURS[LEFT], COLOURS[RIGHT], COLOURS[MIDDLE]])
"""Their colours, as of the player."""

BANDS = {"left": LEFT_PART, "right": RIGHT_PART}


OUTLINES = json.loads((files("motet.draw") / "mannequin.json").read_text("utf-8"))
"""Tables of the body, a row for each ring. "trunk", from the crotch to the crown, and "leg", the left one from the
thigh to the toes: the height of a ring and its place in front, those behind, half its width, and where its middle is
from side to side. "arm", the left one with its palm: how far from the shoulder a ring is, and how far it reaches
over the arm's axis, under it, in front and behind. "fingers": a :class:`Finger` each, the middle one first, the
thumb last. "phalanges": how far along a finger a ring is, and how much of its radius it has."""


class Finger(NamedTuple):
    """Where a finger begins along the arm, over it and in front; its length and radius; and in degrees its turn towards
    the thumb's side, and how much it is curled at first and at each of its joints."""

    start: Triple
    length: float
    radius: float
    aside: float
    curl: tuple[float, float]


RING_CORNERS = 24
"""Corners of the trunk's rings, the first in front. Limbs have 16, fingers 6."""

HOLE_ROW = 12
HOLE_COLUMNS = (4, 16)
HOLE = 4
"""Where holes for arms, the left one first, begin in the smoothed trunk; how many squares they are wide and high."""

BRIDGE = np.array([(0.22, -0.018), (0.48, -0.026), (0.74, -0.020)])
"""Of corners from the trunk's lowest ring in front to the one behind how far along they are, and how far above."""

ARM_SLOPE = np.radians(50.0)
"""How far arms hang as they are shaped."""

SHOULDER = T_POSE[HUMANOID.index("leftUpperArm")]
DOWN_ARM = np.array(
    [[np.cos(ARM_SLOPE), -np.sin(ARM_SLOPE), 0.0], [np.sin(ARM_SLOPE), np.cos(ARM_SLOPE), 0.0], [0.0, 0.0, 1.0]]
)
"""The axes of the left arm as it is shaped: along it, over it, and in front."""

TRUNK_JOINTS = ("hips", "spine", "chest", "upperChest", "neck", "head")

BAND = 0.025
"""Half of the width of bands."""


class Patch(NamedTuple):
    """Rings (R, C) of numbered corners; which squares (R - 1, C) from a ring to the next are drawn; and whether the
    first ring and the last one are closed."""

    grid: Indices
    is_drawn: Mask
    closes: tuple[bool, bool]


class Limb(NamedTuple):
    """Rings (R, C, 3) on the left side; of each (R,), or all (1,), the bone without its side, and whether it is in a
    band."""

    rings: Array
    bones: NDArray[np.str_]
    in_band: Mask


class Corners:
    """Corners as they are numbered: lists of their places, joints and parts."""

    def __init__(self) -> None:
        self.places = np.zeros((0, 3))
        self.bones = np.zeros(0, np.intp)
        self.parts = np.zeros(0, np.intp)

    def add(self, rings: Array, bones: Indices, parts: Indices) -> Indices:
        """Number rings (R, C, 3), with joints and parts that go with (R, C): their numbers (R, C)."""
        size = rings.shape[:2]
        numbers = len(self.places) + np.arange(size[0] * size[1]).reshape(size)
        self.places = np.concatenate([self.places, rings.reshape(-1, 3)])
        self.bones = np.append(self.bones, np.broadcast_to(bones, size))
        self.parts = np.append(self.parts, np.broadcast_to(parts, size))
        return numbers


@cache
def human_mesh(level: int = 0) -> Mesh:
    """The body on the humanoid in its T-pose: metres, y up, facing z, the soles at y = 0.

    level: 0 is the whole body; 1 and 2 have a half and a quarter of its corners around and along.
    """
    mesh, patches = _whole()
    places = mesh.places.copy()
    triangles = []
    # the coarsest body has trunk, legs and arms without fingers
    for patch in patches[: None if level < 2 else 5]:
        step = min(2**level, patch.grid.shape[1] // 3)
        kept = patch.grid[:: 2**level, ::step]
        triangles.append(patch_triangles(kept, patch.is_drawn[:: 2**level, ::step], patch.closes))
        # those of two patches are the trunk's
        rings = kept if patch is patches[0] else kept[1:]
        places[rings] = _wider(mesh.places[rings])
    used, numbers = np.unique(np.concatenate(triangles), return_inverse=True)
    return Mesh(places[used], numbers.reshape(-1, 3), mesh.joints[used], mesh.weights[used], mesh.parts[used])


def _wider(rings: Array) -> Array:
    """Rings (R, C, 3) that take as much room as if they had many corners."""
    angle = 2 * np.pi / rings.shape[1]
    middles = rings.mean(axis=1, keepdims=True)
    wider: Array = middles + np.sqrt(angle / np.sin(angle)) * (rings - middles)
    return wider


@cache
def _whole() -> tuple[Mesh, list[Patch]]:
    """The whole body, and the rings that it is made of, those of the trunk first."""
    corners = Corners()
    patches = _patches(corners)
    triangles = np.concatenate([patch_triangles(patch.grid, patch.is_drawn, patch.closes) for patch in patches])
    joints, weights = smooth_weights(corners.bones, [patch.grid for patch in patches], 6)
    return _with_arms_up(Mesh(corners.places, triangles, joints, weights, corners.parts)), patches


def _patches(corners: Corners) -> list[Patch]:
    """Number the corners of all rings: of the trunk, of legs and arms, and of fingers."""
    trunk = _trunk(corners)
    leg = _leg(corners.places[_hip(trunk)])
    arm = _arm(corners.places[_shoulder(trunk)])
    patches = [Patch(trunk, _without_holes(trunk), (False, True))]
    for side in LEFT_RIGHT:
        on_side = trunk if side == "left" else trunk[:, -np.arange(RING_CORNERS)]
        patches.append(_limb(corners, leg, side, _hip(on_side)))
        patches.append(_limb(corners, arm, side, _shoulder(on_side)))
    for shape in OUTLINES["fingers"]:
        finger = _finger(Finger(**shape))
        patches += [_limb(corners, finger, side) for side in LEFT_RIGHT]
    return patches


def _trunk(corners: Corners) -> Indices:
    """Number the trunk's rings (R, C), and after them a bridge from front to back through the crotch."""
    rings = smoothed(_spanned(OUTLINES["trunk"], *ring(RING_CORNERS, 2.3).T))
    trunk = corners.add(rings, _bones_of_trunk(rings), np.array(BODY))
    front = rings[0, 0]
    bridge = front + BRIDGE[:, :1] * (rings[0, RING_CORNERS // 2] - front) + BRIDGE[:, 1:] * [0.0, 1.0, 0.0]
    corners.add(bridge[None], np.array(HUMANOID.index("hips")), np.array(BODY))
    return trunk


def _limb(corners: Corners, limb: Limb, side: str, start: Indices | None = None) -> Patch:
    """Number a limb's rings on a side, which go on from a ring of the trunk or are closed."""
    sign = 1 if side == "left" else -1
    bones = np.array([joint_of(side, bone) for bone in limb.bones])[:, None]
    parts = np.where(limb.in_band, BANDS[side], BODY)[:, None]
    grid = corners.add(limb.rings * [sign, 1, 1], bones, parts)
    if start is not None:
        grid = np.vstack([start, grid])
    # mirrored rings go round the other way from the same corner
    grid = grid[:, sign * np.arange(grid.shape[1])]
    return Patch(grid, grid[1:] >= 0, (start is None, True))


def _spanned(table: Sequence[Sequence[float]], front: Array, left: Array) -> Array:
    """Rings (R, C, 3) of a table like "trunk" or "leg", from how far each corner (C,) is in front and to the left."""
    front_y, front_z, back_y, back_z, half, middle_x = np.array(table).T[..., None]
    x = middle_x + half * left
    y = (front_y + back_y + (front_y - back_y) * front) / 2
    z = (front_z + back_z + (front_z - back_z) * front) / 2
    return np.stack([x, y, z], axis=-1)


def _bones_of_trunk(rings: Array) -> Indices:
    """The joint of each corner (R, C): by its ring's height one of the spine, beside it a collar bone or a leg."""
    spine = np.array([HUMANOID.index(name) for name in TRUNK_JOINTS])
    on_spine = np.searchsorted(T_POSE[spine[1:], 1], rings[..., 1].mean(axis=1), "right")
    bones = np.repeat(spine[on_spine][:, None], rings.shape[1], axis=1)
    x, y, _ = np.moveaxis(rings, -1, 0)
    for side, sign in SIDES:
        bones[(sign * x > 0.04) & (y > 1.31) & (y < 1.47)] = joint_of(side, "Shoulder")
        bones[(sign * x > 0.04) & (y < 0.92)] = joint_of(side, "UpperLeg")
    return bones


def _without_holes(trunk: Indices) -> Mask:
    """Which squares of the trunk are drawn."""
    is_drawn = np.full((len(trunk) - 1, RING_CORNERS), True)
    for column in HOLE_COLUMNS:
        is_drawn[HOLE_ROW : HOLE_ROW + HOLE, column : column + HOLE] = False
    return is_drawn


def _hip(trunk: Indices) -> Indices:
    """Corners (16,) that a left leg begins with: half of the lowest ring from the back, and the bridge."""
    return np.append(trunk[0, RING_CORNERS // 2 :: -1], trunk.size + np.arange(len(BRIDGE)))


def _shoulder(trunk: Indices) -> Indices:
    """Corners (16,) that a left arm begins with: the hole's border from its upper end at the back, over the top."""
    rows = trunk[HOLE_ROW : HOLE_ROW + HOLE + 1, HOLE_COLUMNS[0] : HOLE_COLUMNS[0] + HOLE + 1]
    return np.concatenate([rows[-1, :0:-1], rows[:0:-1, 0], rows[0, :-1], rows[:-1, -1]])


def _leg(start: Array) -> Limb:
    """The leg from corners (16, 3) of the trunk on: its rings begin behind, and go round by the outer side."""
    outline = np.roll(ring(len(start), 2.2), 6, axis=0)
    rings = smoothed(np.concatenate([start[None], _spanned(OUTLINES["leg"], outline[:, 1], outline[:, 0])]))[1:]
    _, height, ahead = rings.mean(axis=1).T
    bones = np.array(["UpperLeg", "LowerLeg", "Foot"])[np.searchsorted([-0.5, -0.08], -height)]
    bones[ahead > 0.13] = "Toes"
    # its band is over the ankle
    return Limb(rings, bones, np.abs(height - 0.12) < BAND)


def _arm(start: Array) -> Limb:
    """The arm and the palm from corners (16, 3) of the trunk on: its rings begin behind, and go round over the top."""
    # rings as wide above, below, in front and behind as the arm is there
    up, ahead = np.roll(ring(len(start), 2.2), 2, axis=0).T
    along, over, under, front, back = np.array(OUTLINES["arm"]).T[..., None]
    height = np.where(up > 0, over, -under) * up
    depth = np.where(ahead > 0, front, -back) * ahead
    rings = _hanging(np.stack(np.broadcast_arrays(along, height, depth), axis=-1))
    rings = smoothed(np.concatenate([start[None], rings]))[1:]
    # each ring belongs to the bone at its distance from the shoulder
    reach = (rings.mean(axis=1) - SHOULDER) @ DOWN_ARM[0]
    bones = np.array(["UpperArm", "LowerArm", "Hand"])[np.searchsorted([0.28, 0.53], reach)]
    # its band is at the wrist
    return Limb(rings, bones, np.abs(reach - 0.535) < BAND)


def _hanging(places: Array) -> Array:
    """Places (..., 3) of how far along the arm, over it, and in front."""
    hanging: Array = SHOULDER + places @ DOWN_ARM
    return hanging


def _finger(finger: Finger) -> Limb:
    """A chain of bones, each more curled than the one before."""
    share, wide = np.array(OUTLINES["phalanges"]).T[..., None]
    curl = np.radians(finger.curl[0] + finger.curl[1] * np.arange(len(share)))[:, None]
    aside = np.radians(finger.aside)
    way = np.cos(curl) * [np.cos(aside), 0.0, np.sin(aside)] - [0.0, 1.0, 0.0] * np.sin(curl)
    middles = finger.start + np.cumsum(np.diff(share, axis=0, prepend=0.0) * finger.length * way, axis=0)
    # rings at right angles to its way
    sideways = np.array([-np.sin(aside), 0.0, np.cos(aside)])
    rings = _hanging(_rings_around(middles, np.cross(sideways, way), sideways, finger.radius * wide))
    return Limb(rings, np.array(["Hand"]), np.array([False]))


def _rings_around(middles: Array, upward: Array, sideways: Array, radii: Array) -> Array:
    """Rings (R, 6, 3) around middles (R, 3) in planes that two axes (R, 3) and (3,) span, with radii (R, 1)."""
    up, side = ring(6).T[..., None]
    rings: Array = middles[:, None] + radii[:, None] * (up * upward[:, None] + side * sideways)
    return rings


def _with_arms_up(mesh: Mesh) -> Mesh:
    """The mesh in the T-pose, whose joints bring it back to where it was shaped when arms hang by SLOPE."""
    places = mesh.places
    for side, sign in SIDES:
        arm = [joint_of(side, bone) for bone in ("UpperArm", "LowerArm", "Hand")]
        share = (mesh.weights * np.isin(mesh.joints, arm)).sum(axis=1)
        shoulder = SHOULDER * [sign, 1, 1]
        hangs = DOWN_ARM.T * np.outer([1, sign, 1], [1, sign, 1])
        mixed = np.eye(3) + share[:, None, None] * (hangs - np.eye(3))
        places = np.linalg.solve(mixed, (places - shoulder)[..., None])[..., 0] + shoulder
    return replace(mesh, places=places)
