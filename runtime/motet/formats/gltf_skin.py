"""The outermost points of a glTF file's meshes on each joint, such as soles."""

import logging
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import FormatError
from motet.formats.gltf_data import Gltf
from motet.formats.gltf_figures import Rest
from motet.motion.rotations import Array, rotated

log = logging.getLogger(__name__)

SKIN_DIRECTIONS = 200
"""Directions, all around; the outermost point in each is kept."""


def skin_of(gltf: Gltf, rest: Rest) -> dict[int, Array]:
    """Hull points (P, 3) of the mesh on each joint that has some, relative to the joint, at rest, in metres.

    A point belongs to the joint that moves it most. Empty, with a line in the log, if meshes cannot be read.
    """
    try:
        parts = [part for node in gltf.order for part in _parts(gltf, rest, node)]
    except FormatError as error:
        log.info("estimating soles from the joints instead of the mesh: %s", error)
        return {}
    if not parts:
        return {}
    points, owners = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    found = {}
    for joint in np.unique(owners[owners >= 0]).tolist():
        own = points[owners == joint] - rest.places[rest.nodes[joint]]
        found[joint] = own[np.unique(np.argmax(own @ _directions().T, axis=0))]
    return found


def _directions() -> Array:
    """Unit vectors (SKIN_DIRECTIONS, 3), spread evenly by the golden angle."""
    height = 1 - (2 * np.arange(SKIN_DIRECTIONS) + 1) / SKIN_DIRECTIONS
    angle, radius = np.arange(SKIN_DIRECTIONS) * np.pi * (3 - 5**0.5), np.sqrt(1 - height**2)
    return np.stack([radius * np.cos(angle), height, radius * np.sin(angle)], axis=-1)


def _parts(gltf: Gltf, rest: Rest, node: int) -> Iterator[tuple[Array, NDArray[np.intp]]]:
    """The points (P, 3) of a node's mesh in the world at rest, and the joint of each, -1 for none."""
    found = gltf.objects("nodes")[node]
    if "mesh" not in found:
        return
    for primitive in gltf.objects("meshes")[found["mesh"]]["primitives"]:
        attributes = primitive["attributes"]
        points = gltf.array(attributes["POSITION"])
        if "skin" in found and "JOINTS_0" in attributes:
            yield _skinned(gltf, rest, gltf.objects("skins")[found["skin"]], points, attributes)
        else:
            yield points @ rest.linear[node].T + rest.places[node], np.full(len(points), _carrier(gltf, rest, node))


def _carrier(gltf: Gltf, rest: Rest, node: int) -> int:
    """The joint that a node is attached to, -1 for none."""
    while node >= 0 and node not in rest.nodes:
        node = gltf.parents[node]
    return rest.nodes.index(node) if node >= 0 else -1


def _skinned(
    gltf: Gltf, rest: Rest, skin: dict[str, Any], points: Array, attributes: dict[str, int]
) -> tuple[Array, NDArray[np.intp]]:
    linear, places = _bound(gltf, rest, skin)
    joints, weights = gltf.array(attributes["JOINTS_0"]).astype(np.intp), gltf.array(attributes["WEIGHTS_0"])
    moved = np.zeros(points.shape)
    for joint, weight in zip(joints.T, weights.T, strict=True):
        moved += weight[:, None] * (rotated(linear[joint], points) + places[joint])
    moved /= np.maximum(weights.sum(axis=1), 1e-9)[:, None]
    owners = np.array([_carrier(gltf, rest, node) for node in skin["joints"]])
    return moved, owners[joints[np.arange(len(joints)), np.argmax(weights, axis=1)]]


def _bound(gltf: Gltf, rest: Rest, skin: dict[str, Any]) -> tuple[Array, Array]:
    """The transform of mesh points by each joint of a skin at rest: linear maps (J, 3, 3) and positions (J, 3)."""
    nodes = list(skin["joints"])
    linear, places = rest.linear[nodes], rest.places[nodes]
    if "inverseBindMatrices" not in skin:
        return linear, places
    bind = np.swapaxes(gltf.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4), 1, 2)[: len(nodes)]
    return linear @ bind[:, :3, :3], rotated(linear, bind[:, :3, 3]) + places
