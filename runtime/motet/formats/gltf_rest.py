"""A glTF file's figure as its nodes rest, with all that stands above it."""

from dataclasses import dataclass

import numpy as np

from motet.formats.gltf_data import Gltf
from motet.formats.gltf_figures import figure_of, figures, likeliest
from motet.formats.gltf_tracks import moved
from motet.formats.nodes import skeleton_of_nodes
from motet.motion.rotations import Array, quat_to_rotmat
from motet.motion.skeleton import Skeleton


@dataclass(frozen=True)
class Rest:
    """The node of each joint, and the skeleton, which rests in the nodes' pose, in metres.

    linear: what all nodes of the file, joints or not, make of vectors in the world (N, 3, 3), with their scales; places
    (N, 3): where they are.
    """

    nodes: tuple[int, ...]
    skeleton: Skeleton
    linear: Array
    places: Array


def at_rest(gltf: Gltf) -> Rest:
    """The figure of a file that its animations move the most; FormatError where there is none."""
    all_moved = set().union(*map(moved, gltf.objects("animations")))
    figure = figure_of(gltf, likeliest(gltf, figures(gltf, all_moved), all_moved))
    linear, places = _world(gltf)
    joints = places[list(figure.nodes)]
    offsets = [joints[i] - joints[parent] if parent >= 0 else joints[i] for i, parent in enumerate(figure.parents)]
    skeleton = skeleton_of_nodes(gltf.path, list(figure.names), figure.parents, offsets, metres=1.0)
    return Rest(figure.nodes, skeleton, linear, places)


def _world(gltf: Gltf) -> tuple[Array, Array]:
    """Linear maps (N, 3, 3) and places (N, 3) of all nodes in the world."""
    linear, places = np.zeros((len(gltf.parents), 3, 3)), np.zeros((len(gltf.parents), 3))
    for node in gltf.order:
        move, turn, scale = gltf.local(node)
        linear[node], places[node] = quat_to_rotmat(turn / np.linalg.norm(turn)) * scale, move
        if (parent := gltf.parents[node]) >= 0:
            places[node] = places[parent] + linear[parent] @ move
            linear[node] = linear[parent] @ linear[node]
    return linear, places
