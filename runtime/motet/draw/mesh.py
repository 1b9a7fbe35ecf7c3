"""Closed surfaces of triangles that joints carry, made by lofts through rings of corners."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, unit

Surface = tuple[Array, NDArray[np.intp]]
"""Corners (V, 3), and triangles (F, 3) of them."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A skinned surface of V corners and F triangles.

    places: (V, 3) at rest. triangles: (F, 3) corners, counterclockwise from outside.
    joints, weights: (V, 2) which joints carry a corner, and how much of it; a corner's weights add up to 1.
    parts: (V,) of what a corner is a part, which gives its colour.
    """

    places: Array
    triangles: NDArray[np.intp]
    joints: NDArray[np.intp]
    weights: Array
    parts: NDArray[np.intp]

    @property
    def normals(self) -> Array:
        """Normals (V, 3) at rest, see :func:`normals_of`."""
        return normals_of(self.places, self.triangles)

    def carried(self, turned: Array, moved: Array) -> Array:
        """The corners (V, 3) as joints bring them to x -> turned x + moved: matrices (J, 3, 3), vectors (J, 3)."""
        by_each_joint = np.einsum("vkij,vj->vki", turned[self.joints], self.places) + moved[self.joints]
        mixed: Array = np.einsum("vk,vki->vi", self.weights, by_each_joint)
        return mixed


def normals_of(places: Array, triangles: NDArray[np.intp]) -> Array:
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
    count, around = rings.shape[:2]
    corner = np.arange(around)
    # between a ring and the next each corner has two triangles with the one beside it
    start = around * np.arange(count - 1)[:, None]
    below = (start + corner).reshape(-1)
    beside = (start + (corner + 1) % around).reshape(-1)
    sides = np.stack([below, beside, beside + around, below, beside + around, below + around], axis=1).reshape(-1, 3)
    # the first and the last ring are fans around their first corners
    fan = np.stack([0 * corner[1:-1], corner[1:-1], corner[2:]], axis=1)
    triangles = np.concatenate([fan[:, ::-1], sides, fan + (count - 1) * around])
    return rings.reshape(-1, 3), triangles


def ring(corners: int, power: float = 2.0) -> Array:
    """Corners (C, 2) of a superellipse with half axes 1, |x|^power + |y|^power = 1, counterclockwise from x = 1."""
    angles = np.arange(corners) * 2 * np.pi / corners
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    corners_on_it: Array = flat / np.linalg.norm(flat, ord=power, axis=1, keepdims=True)
    return corners_on_it


def shared(at: Array, chain: Sequence[tuple[int, float, float]]) -> tuple[NDArray[np.intp], Array]:
    """Which joints (V, 2) of a chain carry corners, with weights (V, 2), by how far along the chain they are (V,).

    chain: of each joint its index, from where on it carries, and over which length it takes over from the one before.
    """
    joints = np.full((len(at), 2), chain[0][0])
    weights = np.tile([1.0, 0.0], (len(at), 1))
    for (before, _, _), (joint, start, length) in pairwise(chain):
        share = eased((at - start) / length + 0.5)
        taken = share > 0
        joints[taken] = [before, joint]
        weights[taken] = np.stack([1 - share, share], axis=1)[taken]
    return joints, weights


def eased(part: Array) -> Array:
    """From 0 to 1 as a number goes from 0 to 1, slowly at both ends."""
    within = np.clip(part, 0.0, 1.0)
    smooth: Array = within * within * (3 - 2 * within)
    return smooth
