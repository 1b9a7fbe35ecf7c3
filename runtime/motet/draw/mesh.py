"""Closed surfaces of triangles that joints carry, made by lofts through rings of corners."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, unit


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
        found = np.einsum("vkij,vj->vki", turned[self.joints], self.places) + moved[self.joints]
        mixed: Array = np.einsum("vk,vki->vi", self.weights, found)
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
    starts = np.cumsum([0, *(len(mesh.places) for mesh in meshes[:-1])])
    triangles = [mesh.triangles + start for mesh, start in zip(meshes, starts, strict=True)]
    of_corners = zip(*((mesh.places, mesh.joints, mesh.weights, mesh.parts) for mesh in meshes), strict=True)
    places, joints, weights, parts = (np.concatenate(arrays) for arrays in of_corners)
    return Mesh(places, np.concatenate(triangles), joints, weights, parts)


def loft(rings: Array) -> tuple[Array, NDArray[np.intp]]:
    """The corners and the triangles of a closed surface through rings (R, C, 3) of C corners each.

    A ring goes counterclockwise as seen from the ring after it. The first and the last are closed.
    """
    count, around = rings.shape[:2]
    corner = np.arange(around)
    start = around * np.arange(count - 1)[:, None]
    below = (start + corner).reshape(-1)
    beside = (start + (corner + 1) % around).reshape(-1)
    sides = np.stack([below, beside, beside + around, below, beside + around, below + around], axis=1).reshape(-1, 3)
    fan = np.stack([0 * corner[1:-1], corner[1:-1], corner[2:]], axis=1)
    return rings.reshape(-1, 3), np.concatenate([fan[:, ::-1], sides, fan + (count - 1) * around])


def ring(corners: int, power: float = 2.0) -> Array:
    """Corners (C, 2) of a superellipse with half axes 1, |x|^power + |y|^power = 1, counterclockwise from x = 1."""
    angles = np.arange(corners) * 2 * np.pi / corners
    flat = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    found: Array = flat / np.linalg.norm(flat, ord=power, axis=1, keepdims=True)
    return found


def shared(at: Array, chain: Sequence[tuple[int, float, float]]) -> tuple[NDArray[np.intp], Array]:
    """Which joints (V, 2) of a chain carry corners, with weights (V, 2), by how far along the chain they are (V,).

    chain: of each joint its index, from where on it carries, and over which length it takes over from the one before.
    """
    joints = np.full((len(at), 2), chain[0][0])
    weights = np.tile([1.0, 0.0], (len(at), 1))
    for (before, _, _), (joint, start, length) in pairwise(chain):
        part = eased((at - start) / length + 0.5)
        taken = part > 0
        joints[taken] = [before, joint]
        weights[taken] = np.stack([1 - part, part], axis=1)[taken]
    return joints, weights


def eased(part: Array) -> Array:
    """From 0 to 1 as a number goes from 0 to 1, slowly at both ends."""
    within = np.clip(part, 0.0, 1.0)
    found: Array = within * within * (3 - 2 * within)
    return found
