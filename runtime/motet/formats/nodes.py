"""From nodes in the world to a motion, for the readers of scene files (glTF, FBX).

A motion's skeleton has the rest pose of the file's nodes, with all rotations removed: every angle 0 is that pose,
whatever the nodes' own axes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motet.errors import FormatError, MotionError
from motet.motion.kinematics import motion_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array, inverse, product, rotated
from motet.motion.skeleton import Joint, Skeleton


@dataclass(frozen=True)
class Poses:
    """Joints in the world: rotations (T, J, 3, 3), without scale, and positions (T, J, 3)."""

    turns: Array
    places: Array

    def of(self, joints: Sequence[int]) -> "Poses":
        """Those of some joints."""
        return Poses(self.turns[:, list(joints)], self.places[:, list(joints)])


def motion_of_nodes(
    path: Path, names: list[str], parents: tuple[int, ...], rest: Poses, poses: Poses, fps: float, metres: float | None
) -> Motion:
    """The motion of joints, parents first (-1 for the root), from their poses (T) and their rest pose (1).

    metres: the length of the positions' unit. Channels: three angles in "deg" for each joint, the translation of the
    root and of moving joints in "length". FormatError if the joints do not form a skeleton.
    """
    at_rest = rest.places[0]
    offsets = [at_rest[i] - at_rest[parent] if parent >= 0 else at_rest[i] for i, parent in enumerate(parents)]
    skeleton = skeleton_of_nodes(path, names, parents, offsets, metres)
    turned = product(poses.turns, inverse(rest.turns[0]))
    return motion_of(skeleton, turned, _moved(skeleton, turned, poses.places), fps)


def rested(rest: Poses, names: Sequence[str], parents: Sequence[int], turns: Mapping[str, Array]) -> Poses:
    """A rest pose with each bone turned like that of the same name in another figure: rotations (3, 3) in the world.

    Bones keep their lengths; joints missing from the other figure keep their rotation relative to their parent.
    """
    turned, places = rest.turns.copy(), rest.places.copy()
    for i, (name, parent) in enumerate(zip(names, parents, strict=True)):
        if parent >= 0:
            back = turned[0, parent] @ rest.turns[0, parent].T
            turned[0, i] = back @ rest.turns[0, i]
            places[0, i] = places[0, parent] + back @ (rest.places[0, i] - rest.places[0, parent])
        turned[0, i] = turns.get(name, turned[0, i])
    return Poses(turned, places)


def skeleton_of_nodes(
    path: Path, names: list[str], parents: tuple[int, ...], offsets: list[Array], metres: float | None
) -> Skeleton:
    """The skeleton of joints with offsets (3,) from their parents; FormatError if they do not form one."""
    triples = [(float(x), float(y), float(z)) for x, y, z in offsets]
    made = [Joint(*joint) for joint in zip(names, parents, triples, strict=True)]
    try:
        return Skeleton(tuple(made), metres_per_unit=metres)
    except MotionError as error:
        raise FormatError(path, str(error)) from error


def _moved(skeleton: Skeleton, turned: Array, places: Array) -> dict[int, Array]:
    """Translations (T, 3) in their parents' frames: of the root, and of joints that leave their offset."""
    moved = {0: places[:, 0]}
    for i, joint in enumerate(skeleton.joints[1:], start=1):
        from_parent = places[:, i] - places[:, joint.parent]
        local = rotated(inverse(turned[:, joint.parent]), from_parent)
        # share of the figure's height: a joint that stays within this of its offset does not move
        if np.abs(local - joint.offset).max(initial=0.0) > 1e-4 * max(skeleton.height, 1e-9):
            moved[i] = local
    return moved
