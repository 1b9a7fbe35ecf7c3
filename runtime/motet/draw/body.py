"""The body that figures of people have in pages and pictures: one mesh on the humanoid, made here from its measures.

Limbs, trunk, head, hands and shoes are lofts through rings; tables give each ring's place and half axes in metres, on
the humanoid in its T-pose. Shoulders and hips begin with balls around their joints, which look alike however they turn;
a yoke lies between neck and shoulder.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.draw.mesh import Mesh, eased, loft, ring, shared, together
from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array

SHIRT, TROUSERS, SKIN, LEFT_PART, RIGHT_PART, DARK, MIDDLE_PART = range(7)
"""Parts that have a colour each: of people also the glove and the shoe of either side, hair and eyes; of others bones
of either side and of the middle."""

TRUNK = (
    (0.832, 0.040, 0.040, 0.045), (0.850, 0.100, 0.070, 0.078), (0.880, 0.146, 0.090, 0.104),
    (0.920, 0.166, 0.097, 0.120), (0.965, 0.168, 0.096, 0.118), (1.010, 0.157, 0.094, 0.101),
    (1.036, 0.151, 0.093, 0.093), (1.038, 0.155, 0.097, 0.097), (1.080, 0.143, 0.094, 0.084),
    (1.130, 0.135, 0.093, 0.077), (1.190, 0.141, 0.102, 0.086), (1.250, 0.154, 0.115, 0.098),
    (1.310, 0.166, 0.119, 0.105), (1.360, 0.170, 0.109, 0.105), (1.400, 0.158, 0.088, 0.098),
    (1.432, 0.122, 0.070, 0.084), (1.452, 0.086, 0.060, 0.072), (1.464, 0.066, 0.056, 0.064),
)  # fmt: skip
"""Of each ring its height, half its width, and its depth in front and behind."""

BELT = 1.037
"""From which height on the shirt covers the trunk."""

HEAD = (
    (1.482, 0.018, 0.086, 0.046), (1.491, 0.036, 0.099, 0.014), (1.509, 0.050, 0.104, -0.022),
    (1.533, 0.060, 0.102, -0.050), (1.560, 0.067, 0.101, -0.070), (1.588, 0.072, 0.100, -0.083),
    (1.615, 0.075, 0.101, -0.090), (1.642, 0.076, 0.101, -0.092), (1.668, 0.071, 0.092, -0.086),
    (1.689, 0.058, 0.072, -0.068), (1.702, 0.036, 0.044, -0.042), (1.707, 0.014, 0.018, -0.016),
)  # fmt: skip
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
    (0.118, 0.016, 0.016), (0.126, 0.034, 0.034), (0.143, 0.051, 0.051), (0.170, 0.061, 0.060), (0.200, 0.062, 0.058),
    (0.240, 0.056, 0.054), (0.290, 0.051, 0.051), (0.340, 0.048, 0.049), (0.390, 0.045, 0.046), (0.420, 0.043, 0.043),
    (0.440, 0.042, 0.042), (0.460, 0.042, 0.042), (0.480, 0.043, 0.044), (0.510, 0.044, 0.046), (0.550, 0.043, 0.045),
    (0.600, 0.037, 0.041), (0.650, 0.032, 0.037), (0.686, 0.031, 0.036), (0.688, 0.026, 0.030),
)  # fmt: skip
"""Of each ring of the left arm its place along x, half its height and half its depth."""

YOKE = (
    (0.010, 0.024, 0.036, 0.028), (0.045, 0.034, 0.050, 0.026), (0.085, 0.039, 0.057, 0.018),
    (0.120, 0.044, 0.059, 0.007), (0.150, 0.049, 0.056, -0.001), (0.175, 0.043, 0.046, -0.002),
    (0.192, 0.024, 0.024, 0.002),
)  # fmt: skip
"""As of the hand, of what lies on the left collar bone, from the neck to the shoulder."""

HAND = (
    (0.680, 0.018, 0.024, 0.000), (0.684, 0.024, 0.030, 0.000), (0.705, 0.023, 0.032, 0.000),
    (0.730, 0.022, 0.039, 0.000), (0.765, 0.021, 0.044, 0.000), (0.800, 0.019, 0.044, -0.004),
    (0.830, 0.018, 0.041, -0.013), (0.855, 0.015, 0.034, -0.024), (0.871, 0.010, 0.022, -0.033),
    (0.876, 0.004, 0.010, -0.037),
)  # fmt: skip
"""As of the arm, and how high its middle is above the arm's: the fingers bend a little."""

THUMB = ((0.0, 0.010), (0.06, 0.015), (0.35, 0.0155), (0.7, 0.0135), (0.93, 0.010), (1.0, 0.004))
"""Of each ring how far along it is, and its radius."""

THUMB_FROM = np.array([0.704, 1.396, 0.020])
THUMB_TO = np.array([0.782, 1.376, 0.070])

LEG = (
    (1.004, 0.026, 0.026, 0.0), (0.990, 0.054, 0.054, -0.002), (0.965, 0.078, 0.080, -0.005),
    (0.925, 0.089, 0.093, -0.008), (0.880, 0.089, 0.094, -0.006), (0.830, 0.085, 0.091, -0.002),
    (0.770, 0.080, 0.086, 0.002), (0.700, 0.073, 0.079, 0.004), (0.630, 0.066, 0.071, 0.003),
    (0.570, 0.060, 0.064, 0.001), (0.535, 0.057, 0.061, 0.001), (0.505, 0.055, 0.060, 0.002),
    (0.475, 0.053, 0.057, -0.002), (0.440, 0.053, 0.057, -0.008), (0.380, 0.053, 0.058, -0.013),
    (0.310, 0.050, 0.054, -0.013), (0.240, 0.045, 0.048, -0.009), (0.170, 0.041, 0.044, -0.005),
    (0.110, 0.042, 0.047, -0.002), (0.082, 0.043, 0.049, 0.000), (0.080, 0.034, 0.038, 0.000),
)  # fmt: skip
"""Of each ring of the left leg its height, half its width and depth, and how far it is in front."""

SHOE = (
    (-0.066, 0.014, 0.010, 0.040), (-0.060, 0.026, 0.003, 0.062), (-0.042, 0.037, 0.0, 0.084),
    (-0.005, 0.040, 0.0, 0.096), (0.035, 0.040, 0.0, 0.092), (0.070, 0.043, 0.0, 0.073), (0.105, 0.047, 0.0, 0.058),
    (0.135, 0.048, 0.0, 0.050), (0.165, 0.045, 0.001, 0.044), (0.190, 0.036, 0.003, 0.037),
    (0.206, 0.022, 0.006, 0.028), (0.212, 0.008, 0.012, 0.020),
)  # fmt: skip
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


@cache
def human_mesh(detail: float = 1.0) -> Mesh:
    """The body on the humanoid in its T-pose: metres, y up, facing z, the soles at y = 0.

    detail: how many of the corners and rings there are: 1 is the whole body; below .5 it has no face and no thumbs.
    """
    sides = [mesh for side in LEFT_RIGHT for mesh in _limbs(side, detail)]
    return together([_trunk(detail), _neck(detail), *_head(detail), *sides])


def _index(name: str) -> int:
    return HUMANOID.index(name)


def _carried(rings: Array, along: int, chain: tuple[tuple[int, float, float], ...], part: int) -> Mesh:
    """A loft whose corners a chain of joints carries, by their place along an axis; see :func:`shared`."""
    places, triangles = loft(rings)
    joints, weights = shared(places[:, along], chain)
    return Mesh(places, triangles, joints, weights, np.full(len(places), part))


def _flat(corners: int, power: float, across: tuple[int, int], rows: Array, detail: float) -> Array:
    """Rings (R, C, 3) in planes that two axes span, from each ring's middle (3) and half axes (2): rows (R, 5)."""
    least = 4 if detail >= 0.3 else 3
    corners = max(least, 2 * round(corners * detail / 2))
    rows = rows[np.linspace(0, len(rows) - 1, max(least, round(len(rows) * detail))).round().astype(int)]
    rings = np.repeat(rows[:, None, :3], corners, axis=1)
    rings[:, :, across] += _as_large(ring(corners, power), ring(64, power)) * rows[:, None, 3:]
    return rings


def _as_large(coarse: Array, fine: Array) -> Array:
    """A ring (C, 2) widened so far that it takes as much room as one of more corners."""
    of_fine, of_coarse = (
        np.linalg.det(np.stack([one, np.roll(one, -1, axis=0)], axis=1)).sum() for one in (fine, coarse)
    )
    widened: Array = coarse * np.sqrt(of_fine / of_coarse)
    return widened


def _trunk(detail: float) -> Mesh:
    rows = np.array(TRUNK)
    middle = (rows[:, 2] - rows[:, 3]) / 2
    depth = (rows[:, 2] + rows[:, 3]) / 2
    rings = _flat(16, 2.4, (2, 0), np.stack([0 * middle, rows[:, 0], middle, depth, rows[:, 1]], axis=1), detail)
    chain = tuple((_index(name), height, 0.10) for name, height in
                  (("hips", 0.0), ("spine", 1.07), ("chest", 1.17), ("upperChest", 1.27)))  # fmt: skip
    mesh = _carried(rings, 1, chain, SHIRT)
    mesh.parts[mesh.places[:, 1] < BELT] = TROUSERS
    # towards the shoulders the collar bones carry more and more of the chest: recorded ones often slope by 40 degrees
    x = mesh.places[:, 0]
    height = mesh.places[:, 1]
    part = eased((np.abs(x) - 0.03) / 0.10) * eased((height - 1.29) / 0.09)
    for side, sign in zip(LEFT_RIGHT, (1, -1), strict=True):
        on_side = (sign * x > 0) & (part > 0)
        mesh.joints[on_side] = [_index("upperChest"), _index(sided(side, "Shoulder"))]
        mesh.weights[on_side] = np.stack([1 - part, part], axis=1)[on_side]
    return mesh


def _neck(detail: float) -> Mesh:
    height, radius, front = np.array(NECK).T
    rings = _flat(10, 2.0, (2, 0), np.stack([0 * height, height, front, radius, radius], axis=1), detail)
    chain = ((_index("upperChest"), 0.0, 0.0), (_index("neck"), 1.46, 0.04), (_index("head"), 1.53, 0.05))
    return _carried(rings, 1, chain, SKIN)


def _head(detail: float) -> list[Mesh]:
    height, wide, front, back = np.array(HEAD).T
    rows = np.stack([0 * height, height, (front + back) / 2, (front - back) / 2, wide], axis=1)
    rings = _flat(14, 2.3, (2, 0), rows, detail)
    hair = _hair(rings)[:: 1 if detail >= 0.5 else 3]
    meshes = [_on_head(loft(rings), SKIN), _on_head(loft(hair), DARK)]
    for ball in FACE if detail >= 0.5 else ():
        for sign in (1, -1) if ball.twice else (1,):
            meshes.append(_on_head(_ellipsoid(np.array(ball.middle) * [sign, 1, 1], np.array(ball.half)), ball.part))
    return meshes


def _hair(head: Array, thick: float = 1.075) -> Array:
    """Rings (R, C, 3) around the head's (K, C, 3): from the hairline, which is low behind and high in front, up."""
    angles = np.arange(head.shape[1]) * 2 * np.pi / head.shape[1]  # 0 in front
    line = 1.604 + 0.056 * np.cos(angles) + 0.010 * np.cos(2 * angles)
    rings = []
    for part in (0.0, 0.02, 0.25, 0.5, 0.72, 0.88, 0.97, 1.0):
        heights = line + (head[-1, 0, 1] - line) * part
        x, z = (
            np.array([np.interp(y, head[:, n, 1], head[:, n, axis]) for n, y in enumerate(heights)]) for axis in (0, 2)
        )
        out = thick if part else 0.9
        rings.append(np.stack([x * out, heights + 0.008 * bool(part) + 0.004 * part, z * out], axis=1))
    return np.array(rings)


def _ellipsoid(middle: Array, half: Array, corners: int = 6) -> tuple[Array, NDArray[np.intp]]:
    turns = np.linspace(-0.43, 0.43, 4) * np.pi
    flat = ring(corners)[None] * np.cos(turns)[:, None, None]
    unit_ball = np.stack([flat[..., 1], np.repeat(np.sin(turns)[:, None], corners, axis=1), flat[..., 0]], axis=-1)
    return loft(middle + half * unit_ball)


def _on_head(made: tuple[Array, NDArray[np.intp]], part: int) -> Mesh:
    places, triangles = made
    joints, weights = shared(places[:, 1], ((_index("head"), 0.0, 0.0),))
    return Mesh(places, triangles, joints, weights, np.full(len(places), part))


def _limbs(side: str, detail: float) -> list[Mesh]:
    """Arm, hand, thumb, leg and shoe of a side: of the right one mirrored."""
    joint = {
        part: _index(sided(side, part))
        for part in ("Shoulder", "UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot", "Toes")
    }
    own = LEFT_PART if side == "left" else RIGHT_PART
    arm = ((joint["UpperArm"], 0.0, 0.0), (joint["LowerArm"], 0.45, 0.07), (joint["Hand"], 0.70, 0.04))
    leg = ((joint["UpperLeg"], 0.0, 0.0), (joint["LowerLeg"], -0.50, 0.10), (joint["Foot"], -0.09, 0.05))
    x, tall, deep = np.array(ARM).T
    arms = _flat(10, 2.0, (1, 2), np.stack([x, 0 * x + ARM_Y, 0 * x, tall, deep], axis=1), detail)
    hand = _along_arm(8, 2.5, HAND, detail)
    yoke = _along_arm(10, 2.0, YOKE, detail)
    meshes = [
        _carried(arms, 0, arm, SHIRT),
        _carried(hand, 0, arm, own),
        _leg(leg, detail),
        _carried(_shoe(detail), 2, ((joint["Foot"], 0.0, 0.0), (joint["Toes"], 0.13, 0.05)), own),
    ]
    if detail >= 0.3:
        meshes.append(_carried(yoke, 0, ((joint["Shoulder"], 0.0, 0.0),), SHIRT))
    if detail >= 0.5:
        meshes.insert(2, _carried(_thumb(detail), 0, ((joint["Hand"], 0.0, 0.0),), own))
    return meshes if side == "left" else [_mirrored(mesh) for mesh in meshes]


def _along_arm(corners: int, power: float, table: tuple[tuple[float, ...], ...], detail: float) -> Array:
    x, tall, deep, up = np.array(table).T
    return _flat(corners, power, (1, 2), np.stack([x, ARM_Y + up, 0 * x, tall, deep], axis=1), detail)


def _leg(chain: tuple[tuple[int, float, float], ...], detail: float) -> Mesh:
    height, wide, deep, front = np.array(LEG).T
    rings = _flat(10, 2.1, (0, 2), np.stack([0 * height + LEG_X, height, front, wide, deep], axis=1), detail)
    places, triangles = loft(rings)
    joints, weights = shared(-places[:, 1], ((chain[0][0], -9.0, 0.0), *chain[1:]))
    return Mesh(places, triangles, joints, weights, np.full(len(places), TROUSERS))


def _thumb(detail: float) -> Array:
    """Rings around the thumb's axis, in planes across x."""
    part, radius = np.array(THUMB).T
    middles = THUMB_FROM + part[:, None] * (THUMB_TO - THUMB_FROM)
    return _flat(6, 2.0, (1, 2), np.concatenate([middles, np.stack([radius, 1.3 * radius], axis=1)], axis=1), detail)


def _shoe(detail: float) -> Array:
    z, wide, low, high = np.array(SHOE).T
    rows = np.stack([0 * z + LEG_X, (low + high) / 2, z, wide, (high - low) / 2], axis=1)
    return _flat(10, 2.8, (0, 1), rows, detail)


def _mirrored(mesh: Mesh) -> Mesh:
    """The mesh on the other side of x = 0."""
    return Mesh(mesh.places * [-1, 1, 1], mesh.triangles[:, ::-1], mesh.joints, mesh.weights, mesh.parts)
