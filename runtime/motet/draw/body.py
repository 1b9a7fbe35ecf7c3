"""The body that figures of people have in pages and pictures: one mesh on the humanoid, made here from its measures.

Limbs, trunk, head, hands and shoes are lofts through rings; tables give each ring's place and half axes in metres, on
the humanoid in its T-pose. Shoulders and hips begin with balls around their joints, which look alike however they turn;
a yoke lies between neck and shoulder.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from motet.draw.mesh import Mesh, Surface, eased, loft, ring, shared, together
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array

SHIRT, TROUSERS, SKIN, LEFT_PART, RIGHT_PART, DARK, MIDDLE_PART = range(7)
"""Parts that have a colour each: of people also the glove and the shoe of either side, hair and eyes; of others bones
of either side and of the middle."""

GLOVES_AND_SHOES = {"left": LEFT_PART, "right": RIGHT_PART}

TRUNK = (
    (0.832, 0.040, 0.040, 0.045),
    (0.850, 0.100, 0.070, 0.078),
    (0.880, 0.146, 0.090, 0.104),
    (0.920, 0.166, 0.097, 0.120),
    (0.965, 0.168, 0.096, 0.118),
    (1.010, 0.157, 0.094, 0.101),
    (1.036, 0.151, 0.093, 0.093),
    (1.038, 0.155, 0.097, 0.097),
    (1.080, 0.143, 0.094, 0.084),
    (1.130, 0.135, 0.093, 0.077),
    (1.190, 0.141, 0.102, 0.086),
    (1.250, 0.154, 0.115, 0.098),
    (1.310, 0.166, 0.119, 0.105),
    (1.360, 0.170, 0.109, 0.105),
    (1.400, 0.158, 0.088, 0.098),
    (1.432, 0.122, 0.070, 0.084),
    (1.452, 0.086, 0.060, 0.072),
    (1.464, 0.066, 0.056, 0.064),
)
"""Of each ring its height, half its width, and its depth in front and behind."""

BELT = 1.037
"""From which height on the shirt covers the trunk."""

HEAD = (
    (1.482, 0.018, 0.086, 0.046),
    (1.491, 0.036, 0.099, 0.014),
    (1.509, 0.050, 0.104, -0.022),
    (1.533, 0.060, 0.102, -0.050),
    (1.560, 0.067, 0.101, -0.070),
    (1.588, 0.072, 0.100, -0.083),
    (1.615, 0.075, 0.101, -0.090),
    (1.642, 0.076, 0.101, -0.092),
    (1.668, 0.071, 0.092, -0.086),
    (1.689, 0.058, 0.072, -0.068),
    (1.702, 0.036, 0.044, -0.042),
    (1.707, 0.014, 0.018, -0.016),
)
"""Of each ring its height, half its width, and where it is in front and behind."""

NECK = (
    (1.425, 0.060, -0.012),
    (1.455, 0.056, -0.008),
    (1.480, 0.053, -0.002),
    (1.510, 0.052, 0.002),
    (1.550, 0.05, 0.006),
)
"""Of each ring its height, its radius, and how far it is in front."""

ARM = (
    (0.118, 0.016, 0.016),
    (0.126, 0.034, 0.034),
    (0.143, 0.051, 0.051),
    (0.170, 0.061, 0.060),
    (0.200, 0.062, 0.058),
    (0.240, 0.056, 0.054),
    (0.290, 0.051, 0.051),
    (0.340, 0.048, 0.049),
    (0.390, 0.045, 0.046),
    (0.420, 0.043, 0.043),
    (0.440, 0.042, 0.042),
    (0.460, 0.042, 0.042),
    (0.480, 0.043, 0.044),
    (0.510, 0.044, 0.046),
    (0.550, 0.043, 0.045),
    (0.600, 0.037, 0.041),
    (0.650, 0.032, 0.037),
    (0.686, 0.031, 0.036),
    (0.688, 0.026, 0.030),
)
"""Of each ring of the left arm its place along x, half its height and half its depth."""

YOKE = (
    (0.010, 0.024, 0.036, 0.028),
    (0.045, 0.034, 0.050, 0.026),
    (0.085, 0.039, 0.057, 0.018),
    (0.120, 0.044, 0.059, 0.007),
    (0.150, 0.049, 0.056, -0.001),
    (0.175, 0.043, 0.046, -0.002),
    (0.192, 0.024, 0.024, 0.002),
)
"""As of the hand, of what lies on the left collar bone, from the neck to the shoulder."""

HAND = (
    (0.680, 0.018, 0.024, 0.000),
    (0.684, 0.024, 0.030, 0.000),
    (0.705, 0.023, 0.032, 0.000),
    (0.730, 0.022, 0.039, 0.000),
    (0.765, 0.021, 0.044, 0.000),
    (0.800, 0.019, 0.044, -0.004),
    (0.830, 0.018, 0.041, -0.013),
    (0.855, 0.015, 0.034, -0.024),
    (0.871, 0.010, 0.022, -0.033),
    (0.876, 0.004, 0.010, -0.037),
)
"""As of the arm, and how high its middle is above the arm's: the fingers bend a little."""

THUMB = ((0.0, 0.010), (0.06, 0.015), (0.35, 0.0155), (0.7, 0.0135), (0.93, 0.010), (1.0, 0.004))
"""Of each ring how far along it is, and its radius."""

THUMB_FROM = np.array([0.704, 1.396, 0.020])
THUMB_TO = np.array([0.782, 1.376, 0.070])

LEG = (
    (1.004, 0.026, 0.026, 0.0),
    (0.990, 0.054, 0.054, -0.002),
    (0.965, 0.078, 0.080, -0.005),
    (0.925, 0.089, 0.093, -0.008),
    (0.880, 0.089, 0.094, -0.006),
    (0.830, 0.085, 0.091, -0.002),
    (0.770, 0.080, 0.086, 0.002),
    (0.700, 0.073, 0.079, 0.004),
    (0.630, 0.066, 0.071, 0.003),
    (0.570, 0.060, 0.064, 0.001),
    (0.535, 0.057, 0.061, 0.001),
    (0.505, 0.055, 0.060, 0.002),
    (0.475, 0.053, 0.057, -0.002),
    (0.440, 0.053, 0.057, -0.008),
    (0.380, 0.053, 0.058, -0.013),
    (0.310, 0.050, 0.054, -0.013),
    (0.240, 0.045, 0.048, -0.009),
    (0.170, 0.041, 0.044, -0.005),
    (0.110, 0.042, 0.047, -0.002),
    (0.082, 0.043, 0.049, 0.000),
    (0.080, 0.034, 0.038, 0.000),
)
"""Of each ring of the left leg its height, half its width and depth, and how far it is in front."""

SHOE = (
    (-0.066, 0.014, 0.010, 0.040),
    (-0.060, 0.026, 0.003, 0.062),
    (-0.042, 0.037, 0.0, 0.084),
    (-0.005, 0.040, 0.0, 0.096),
    (0.035, 0.040, 0.0, 0.092),
    (0.070, 0.043, 0.0, 0.073),
    (0.105, 0.047, 0.0, 0.058),
    (0.135, 0.048, 0.0, 0.050),
    (0.165, 0.045, 0.001, 0.044),
    (0.190, 0.036, 0.003, 0.037),
    (0.206, 0.022, 0.006, 0.028),
    (0.212, 0.008, 0.012, 0.020),
)
"""Of each ring of the left shoe its place along z, half its width, its bottom and its top."""

LEG_X = 0.09
ARM_Y = 1.40
"""Where the joints of the left leg lie along x, and those of the arm above the ground."""


class Ball(NamedTuple):
    """An ellipsoid on the head: its middle and half axes, and whether there is another one on the right."""

    middle: tuple[float, float, float]
    half: tuple[float, float, float]
    part: int
    twice: bool = True


FACE = (
    Ball((0.030, 1.604, 0.0895), (0.0120, 0.0105, 0.0100), DARK),
    Ball((0.031, 1.628, 0.0920), (0.0180, 0.0042, 0.0090), DARK),
    Ball((0.077, 1.590, -0.006), (0.0100, 0.0270, 0.0170), SKIN),
    Ball((0.000, 1.572, 0.1000), (0.0110, 0.0260, 0.0120), SKIN, twice=False),
    Ball((0.000, 1.560, 0.1060), (0.0150, 0.0110, 0.0170), SKIN, twice=False),
    Ball((0.000, 1.527, 0.0980), (0.0220, 0.0040, 0.0085), DARK, twice=False),
)
"""Eyes, brows, ears, nose and mouth."""


Chain = tuple[tuple[int, float, float], ...]
"""Joints that carry a surface along an axis, as :func:`shared` takes them."""


@cache
def human_mesh(detail: float = 1.0) -> Mesh:
    """The body on the humanoid in its T-pose: metres, y up, facing z, the soles at y = 0.

    detail: how many of the corners and rings there are: 1 is the whole body; below .5 it has no face and no thumbs.
    """
    meshes = [_trunk(detail), _neck(detail), *_head(detail)]
    for side in LEFT_RIGHT:
        meshes += _limbs(side, detail)
    return together(meshes)


def _chain(*links: tuple[str, float, float]) -> Chain:
    """Bones of the humanoid with where each begins to carry and the length of its transition."""
    return tuple((HUMANOID.index(name), start, length) for name, start, length in links)


def _carried(surface: Surface, along: Array, chain: Chain, part: int) -> Mesh:
    """A surface that a chain of joints carries, by how far along it each of its corners (V,) is; see :func:`shared`."""
    places, triangles = surface
    joints, weights = shared(along, chain)
    return Mesh(places, triangles, joints, weights, np.full(len(places), part))


def _along(axis: int, rings: Array, chain: Chain, part: int) -> Mesh:
    """A loft that a chain of joints carries, along an axis."""
    surface = loft(rings)
    return _carried(surface, surface[0][:, axis], chain, part)


def _rings(corners: int, power: float, across: tuple[int, int], rows: Sequence[Array | float], detail: float) -> Array:
    """Rings (R, C, 3) in planes that two axes span.

    rows: x, y and z of each ring's middle and its two half axes, each (R,) or one number.
    """
    # as many rings and corners as the detail asks for
    least = 4 if detail >= 0.3 else 3
    corners = max(least, 2 * round(corners * detail / 2))
    columns = np.stack(np.broadcast_arrays(*rows), axis=1)
    count = max(least, round(len(columns) * detail))
    columns = columns[np.linspace(0, len(columns) - 1, count).round().astype(int)]
    # coarse rings are widened until they take as much room as fine ones
    outline = ring(corners, power)
    outline = outline * np.sqrt(_area(ring(64, power)) / _area(outline))
    rings = np.repeat(columns[:, None, :3], corners, axis=1)
    rings[:, :, across] += outline * columns[:, None, 3:]
    return rings


def _area(outline: Array) -> float:
    """Twice the area within a ring (C, 2)."""
    edges = np.stack([outline, np.roll(outline, -1, axis=0)], axis=1)
    area: float = np.linalg.det(edges).sum()
    return area


def _trunk(detail: float) -> Mesh:
    height, wide, front, back = np.array(TRUNK).T
    rings = _rings(16, 2.4, (2, 0), [0.0, height, (front - back) / 2, (front + back) / 2, wide], detail)
    spine = _chain(("hips", 0.0, 0.10), ("spine", 1.07, 0.10), ("chest", 1.17, 0.10), ("upperChest", 1.27, 0.10))
    mesh = _along(1, rings, spine, SHIRT)
    mesh.parts[mesh.places[:, 1] < BELT] = TROUSERS
    _share_with_collar_bones(mesh)
    return mesh


def _share_with_collar_bones(mesh: Mesh) -> None:
    """Towards the shoulders they carry more of the chest, in place: recorded ones often slope by 40 degrees."""
    x = mesh.places[:, 0]
    share = eased((np.abs(x) - 0.03) / 0.10) * eased((mesh.places[:, 1] - 1.29) / 0.09)
    weights = np.stack([1 - share, share], axis=1)
    for bone, is_on_side in (("leftShoulder", x > 0), ("rightShoulder", x < 0)):
        near = is_on_side & (share > 0)
        mesh.joints[near] = [HUMANOID.index("upperChest"), HUMANOID.index(bone)]
        mesh.weights[near] = weights[near]


def _neck(detail: float) -> Mesh:
    height, radius, front = np.array(NECK).T
    rings = _rings(10, 2.0, (2, 0), [0.0, height, front, radius, radius], detail)
    return _along(1, rings, _chain(("upperChest", 0.0, 0.0), ("neck", 1.46, 0.04), ("head", 1.53, 0.05)), SKIN)


def _head(detail: float) -> list[Mesh]:
    """The skull and the hair, and unless the detail is low the face."""
    height, wide, front, back = np.array(HEAD).T
    skull = _rings(14, 2.3, (2, 0), [0.0, height, (front + back) / 2, (front - back) / 2, wide], detail)
    head = _chain(("head", 0.0, 0.0))
    if detail < 0.5:
        return [_along(1, skull, head, SKIN), _along(1, _hair(skull)[::3], head, DARK)]
    meshes = [_along(1, skull, head, SKIN), _along(1, _hair(skull), head, DARK)]
    for ball in FACE:
        for sign in (1, -1) if ball.twice else (1,):
            rings = _ellipsoid(np.array(ball.middle) * [sign, 1, 1], np.array(ball.half))
            meshes.append(_along(1, rings, head, ball.part))
    return meshes


def _hair(head: Array, thick: float = 1.075) -> Array:
    """Rings (R, C, 3) around the head's (K, C, 3): from the hairline, which is low behind and high in front, up."""
    angles = np.arange(head.shape[1]) * 2 * np.pi / head.shape[1]  # 0 in front
    hairline = 1.604 + 0.056 * np.cos(angles) + 0.010 * np.cos(2 * angles)
    crown = head[-1, 0, 1]
    rings = []
    for share in (0.0, 0.02, 0.25, 0.5, 0.72, 0.88, 0.97, 1.0):
        heights = hairline + (crown - hairline) * share
        # the lowest ring is within the head, so that no gap shows under the hair
        wide = thick if share else 0.9
        x = _at_heights(head, heights, 0)
        z = _at_heights(head, heights, 2)
        rings.append(np.stack([x * wide, heights + 0.008 * bool(share) + 0.004 * share, z * wide], axis=1))
    return np.array(rings)


def _at_heights(head: Array, heights: Array, axis: int) -> Array:
    """Where the lines up the head (K, C, 3) are along an axis at a height each (C,)."""
    return np.array([np.interp(y, head[:, n, 1], head[:, n, axis]) for n, y in enumerate(heights)])


def _ellipsoid(middle: Array, half: Array, corners: int = 6) -> Array:
    """Rings (4, C, 3) around an ellipsoid."""
    turns = np.linspace(-0.43, 0.43, 4) * np.pi
    flat = ring(corners)[None] * np.cos(turns)[:, None, None]
    heights = np.repeat(np.sin(turns)[:, None], corners, axis=1)
    rings: Array = middle + half * np.stack([flat[..., 1], heights, flat[..., 0]], axis=-1)
    return rings


def _limbs(side: str, detail: float) -> list[Mesh]:
    """Arm, hand, thumb, leg, shoe and yoke of a side: of the right one mirrored."""
    meshes = [*_arm(side, detail), _leg(side, detail), _shoe(side, detail)]
    if detail >= 0.3:
        shoulder = _chain((sided(side, "Shoulder"), 0.0, 0.0))
        meshes.append(_along(0, _beside_arm(10, 2.0, YOKE, detail), shoulder, SHIRT))
    return meshes if side == "left" else list(map(_mirrored, meshes))


def _arm(side: str, detail: float) -> list[Mesh]:
    """Sleeve, hand, and unless the detail is low the thumb."""
    x, tall, deep = np.array(ARM).T
    sleeve = _rings(10, 2.0, (1, 2), [x, ARM_Y, 0.0, tall, deep], detail)
    hand = sided(side, "Hand")
    arm = _chain((sided(side, "UpperArm"), 0.0, 0.0), (sided(side, "LowerArm"), 0.45, 0.07), (hand, 0.70, 0.04))
    glove = GLOVES_AND_SHOES[side]
    meshes = [_along(0, sleeve, arm, SHIRT), _along(0, _beside_arm(8, 2.5, HAND, detail), arm, glove)]
    if detail >= 0.5:
        meshes.append(_along(0, _thumb(detail), _chain((hand, 0.0, 0.0)), glove))
    return meshes


def _beside_arm(corners: int, power: float, table: tuple[tuple[float, ...], ...], detail: float) -> Array:
    """Rings around x, whose table says how high each is over the arm."""
    x, tall, deep, above = np.array(table).T
    return _rings(corners, power, (1, 2), [x, ARM_Y + above, 0.0, tall, deep], detail)


def _leg(side: str, detail: float) -> Mesh:
    height, wide, deep, front = np.array(LEG).T
    surface = loft(_rings(10, 2.1, (0, 2), [LEG_X, height, front, wide, deep], detail))
    upper_leg = (sided(side, "UpperLeg"), -9.0, 0.0)
    leg = _chain(upper_leg, (sided(side, "LowerLeg"), -0.50, 0.10), (sided(side, "Foot"), -0.09, 0.05))
    return _carried(surface, -surface[0][:, 1], leg, TROUSERS)  # from the hip down


def _thumb(detail: float) -> Array:
    """Rings around the thumb's axis, in planes across x."""
    share, radius = np.array(THUMB).T
    middles = THUMB_FROM + share[:, None] * (THUMB_TO - THUMB_FROM)
    return _rings(6, 2.0, (1, 2), [*middles.T, radius, 1.3 * radius], detail)


def _shoe(side: str, detail: float) -> Mesh:
    z, wide, low, high = np.array(SHOE).T
    rings = _rings(10, 2.8, (0, 1), [LEG_X, (low + high) / 2, z, wide, (high - low) / 2], detail)
    foot = _chain((sided(side, "Foot"), 0.0, 0.0), (sided(side, "Toes"), 0.13, 0.05))
    return _along(2, rings, foot, GLOVES_AND_SHOES[side])


def _mirrored(mesh: Mesh) -> Mesh:
    """The mesh on the other side of x = 0."""
    return replace(mesh, places=mesh.places * [-1, 1, 1], triangles=mesh.triangles[:, ::-1])
