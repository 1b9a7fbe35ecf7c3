"""Characters of glTF and VRM files: their skeleton, and a motion on it as tracks of the file's own nodes.

Nodes have their own rest poses, axes and scales, and so may the skeleton's ancestors: in every Mixamo export the hips
are below a node with scale .01. A track is in the frame of the node's parent, so these all affect it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motet.errors import FormatError, MotionError
from motet.files import File, place_of
from motet.formats.character import Character
from motet.formats.glb import Track
from motet.formats.gltf import broken
from motet.formats.gltf_data import Gltf, parse
from motet.formats.gltf_figures import Rest, at_rest
from motet.formats.gltf_skin import skin_of
from motet.formats.gltf_tracks import GLTF_FPS
from motet.motion.humanoid import BONES, REQUIRED, JointMap, check_map
from motet.motion.kinematics import local_rotations, local_translations
from motet.motion.motion import Motion
from motet.motion.rotations import Array, product, quat_to_rotmat, rotmat_to_quat
from motet.motion.skeleton import Skeleton

STAYS_WITHIN = 1e-6
"""A joint that stays within this of its rest, in radians and heights, has no track."""


@dataclass(frozen=True)
class Nodes:
    """The nodes of a character's file, and their rest pose."""

    gltf: Gltf
    rest: Rest

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """The tracks of a motion on the character's skeleton, in metres, for the file's nodes.

        The root has both tracks, other joints only those in which they leave their rest. Exact for uniform or mirroring
        scales; under stretched parents the rotation is the nearest one.
        """
        skeleton, still = self.rest.skeleton, STAYS_WITHIN * self.rest.skeleton.height
        turns, moves = local_rotations(motion), local_translations(motion)
        for i, node in enumerate(self.rest.nodes):
            to_parent, origin = self._above(node)
            frame, turn = _orthogonal(to_parent), self.gltf.local(node)[1]
            if not i or np.abs(turns[:, i] - np.eye(3)).max() > STAYS_WITHIN:
                at_rest = frame @ quat_to_rotmat(turn / np.linalg.norm(turn))
                yield node, "rotation", rotmat_to_quat(product(product(frame.T, turns[:, i]), at_rest))
            if not i or np.abs(moves[:, i] - skeleton.offsets[i]).max() > still:
                from_parent: Array = moves[:, i] - (origin if not i else 0.0)
                yield node, "translation", from_parent @ np.linalg.inv(to_parent).T

    def above(self) -> tuple[int, ...]:
        """The skeleton's ancestor nodes, from the top."""
        found = [self.rest.nodes[0]]
        while self.gltf.parents[found[0]] >= 0:
            found.insert(0, self.gltf.parents[found[0]])
        return tuple(found[:-1])

    def _above(self, node: int) -> tuple[Array, Array]:
        """The linear map (3, 3) and the position (3) of a node's parent in the world."""
        parent = self.gltf.parents[node]
        return (self.rest.linear[parent], self.rest.places[parent]) if parent >= 0 else (np.eye(3), np.zeros(3))


def _orthogonal(linear: Array) -> Array:
    """The rotation (3, 3), or rotation with mirroring, nearest to a linear map."""
    left, _, right = np.linalg.svd(linear)
    nearest: Array = left @ right
    return nearest


def read_character(file: File) -> Character:
    """Read a character to put motions onto; FormatError like :func:`motet.formats.gltf.read`."""
    path = place_of(file)
    with broken(path):
        gltf = parse(file)
        rest = at_rest(gltf)
        scales = np.abs(np.linalg.det(rest.linear[list(rest.nodes)]))
        if not scales.min() > 0:
            raise FormatError(path, "nodes of its skeleton have scale 0: apply scales when exporting")
        still = Motion(np.zeros((1, 0)), (), (), GLTF_FPS, rest.skeleton)
        return Character(still, _map(path, gltf, rest), Nodes(gltf, rest), skin_of(gltf, rest))


def _map(path: Path, gltf: Gltf, rest: Rest) -> JointMap | None:
    """The bones of a VRM humanoid."""
    humanoid = {bone: rest.nodes.index(node) for bone, node in gltf.humanoid().items() if node in rest.nodes}
    if not humanoid:
        return None
    missing = [bone for bone in REQUIRED if bone not in humanoid]
    if missing:
        raise FormatError(path, f"its VRM humanoid lacks bones that VRM requires: {', '.join(missing)}")
    return _checked(path, rest.skeleton, humanoid)


def _checked(path: Path, skeleton: Skeleton, humanoid: dict[str, int]) -> JointMap:
    spine = tuple(humanoid[bone] for bone in ("spine", "chest", "upperChest") if bone in humanoid)
    neck = tuple(humanoid[bone] for bone in ("neck",) if bone in humanoid)
    joints = {bone: humanoid[bone] for bone in BONES if bone in humanoid and humanoid[bone] not in (*spine, *neck)}
    try:
        return check_map(skeleton, JointMap(joints, spine, neck, "VRM humanoid", 1.0))
    except MotionError as error:
        raise FormatError(path, str(error)) from error
