"""Closed surfaces of triangles that joints carry, made by lofts through rings of corners."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet.motion.rotations import Array, Indices, Mask, unit

Surface = tuple[Array, Indices]
"""Corners (V, 3), and triangles (F, 3) of them."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A skinned surface of V corners and F triangles.

    places: (V, 3) at rest. triangles: (F, 3) corners, counterclockwise from outside.
    joints, weights: (V, K) which K joints carry a corner, and how much of it; a corner's weights add up to 1.
    parts: (V,) of what a corner is a part, which gives its colour.
    """

    places: Array
    triangles: Indices
    joints: Indices
    weights: Array
    parts: Indices

    @property
    def normals(self) -> Array:
        """Normals (V, 3) at rest, see :func:`normals_of`."""
        return normals_of(self.places, self.triangles)

    @property
    def shares(self) -> Array:
        """The weights (V, K) as whole numbers that add up to 255."""
        shares = np.round(255 * self.weights)
        shares[:, 0] += 255 - shares.sum(axis=1)
        return shares

    def carried(self, turned: Array, moved: Array) -> Array:
        """The corners (V, 3) as joints bring them to x -> turned x + moved: matrices (J, 3, 3), vectors (J, 3)."""
        by_each_joint = np.einsum("vkij,vj->vki", turned[self.joints], self.places) + moved[self.joints]
        mixed: Array = np.einsum("vk,vki->vi", self.weights, by_each_joint)
        return mixed


def normals_of(places: Array, triangles: Indices) -> Array:
    """Normals (V, 3) of corners (V, 3), from the triangles around each, weighed by their areas."""
    a, b, c = places[triangles.T]
    across = np.cross(b - a, c - a)
    normals = np.zeros_like(places)
    for corner in triangles.T:
        np.add.at(normals, corner, across)
    return unit(normals)


def together(meshes: Sequence[Mesh]) -> Mesh:
    """Meshes as one."""
    start = 0
    triangles = []
    for mesh in meshes:
        triangles.append(mesh.triangles + start)
        start += len(mesh.places)
    return Mesh(
        np.concatenate([mesh.places for mesh in meshes]),
        np.concatenate(triangles),
        np.concatenate([mesh.joints for mesh in meshes]),
        np.concatenate([mesh.weights for mesh in meshes]),
        np.concatenate([mesh.parts for mesh in meshes]),
    )


def loft(rings: Array) -> Surface:
    """The corners and the triangles of a closed surface through rings (R, C, 3) of C corners each.

    A ring goes counterclockwise as seen from the ring after it. The first and the last are closed.
    """
    numbers = np.arange(rings[..., 0].size).reshape(rings.shape[:2])
    return rings.reshape(-1, 3), patch_triangles(numbers, numbers[1:] >= 0, (True, True))


def patch_triangles(grid: Indices, is_drawn: Mask, closes: tuple[bool, bool]) -> Indices:
    """Triangles (F, 3) of a surface through rings (R, C) of numbered corners, as of :func:`loft`.

    is_drawn: (R - 1, C) from which corners a square leads to the next ring. closes: whether the first ring and the last
    one are closed.
    """
    # between a ring and the next each corner has two triangles with the one beside it
    beside = np.roll(grid, -1, axis=1)
    sides = np.stack([grid[:-1], beside[:-1], beside[1:], grid[:-1], beside[1:], grid[1:]], axis=-1)
    triangles = [sides[is_drawn].reshape(-1, 3)]
    # the first and the last ring are fans around their first corners
    for ends, is_closed in zip((grid[0, ::-1], grid[-1]), closes, strict=True):
        fan = np.stack([np.full(len(ends) - 2, ends[0]), ends[1:-1], ends[2:]], axis=1)
        triangles.append(fan[: len(fan) * is_closed])
    return np.concatenate(triangles)


def smoothed(rings: Array) -> Array:
    """Rings (R, C, 3), and between each and the next one that goes on smoothly: (2 R - 1, C, 3).

    By the four-point rule of Dyn, Levin and Gregory 1987.
    """
    before = 2 * rings[:1] - rings[1:2]
    after = 2 * rings[-1:] - rings[-2:-1]
    padded = np.concatenate([before, rings, after])
    between = (9 * (padded[1:-2] + padded[2:-1]) - padded[:-3] - padded[3:]) / 16
    return np.insert(rings, np.arange(1, len(rings)), between, axis=0)


def ring(corners: int, power: float = 2.0) -> Array:
    """Corners (C, 2) of a superellipse with half axes 1, |x|^power + |y|^power = 1, counterclockwise from x = 1."""
    angles = np.arange(corners) * 2 * np.pi / corners
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners_on_it: Array = flat / np.linalg.norm(flat, ord=power, axis=1, keepdims=True)
    return corners_on_it


def smooth_weights(joints: Indices, grids: Sequence[Indices], times: int) -> tuple[Indices, Array]:
    """The three joints that carry corners most, and their weights: both (V, 3).

    joints: (V,) of each corner its only joint at first. grids: rings (R, C) of corners, which are neighbours along and
    across them. times: how often weights are evened out between neighbours.
    """
    neighbours = np.unique(np.concatenate(list(map(_neighbours, grids))), axis=0)
    first = np.searchsorted(neighbours[:, 0], np.arange(len(joints)))
    weights = np.eye(joints.max() + 1)[joints]
    for _ in range(times):
        sums = np.add.reduceat(weights[neighbours[:, 1]], first, axis=0)
        weights = (weights + sums / sums.sum(axis=1, keepdims=True)) / 2
    return _largest(weights)


def _neighbours(grid: Indices) -> Indices:
    """Pairs (E, 2) of neighbours in a grid (R, C), each both ways."""
    along = np.stack([grid, np.roll(grid, 1, axis=1)])
    across = np.stack([grid[:-1], grid[1:]])
    pairs = np.concatenate([along.reshape(2, -1), across.reshape(2, -1)], axis=1).T
    return np.concatenate([pairs, pairs[:, ::-1]])


def _largest(weights: Array) -> tuple[Indices, Array]:
    """Of weights (V, J) the three largest of each corner: their joints and they, both (V, 3), with a sum of 1."""
    most = np.argsort(-weights, axis=1, kind="stable")[:, :3]
    largest = np.take_along_axis(weights, most, axis=1)
    return np.where(largest > 0, most, 0), largest / largest.sum(axis=1, keepdims=True)
