"""A motion as a skinned body: the mesh, and what its joints do frame by frame.

People have the body of :mod:`motet.draw.body`, with trunk and limbs as long and as wide as theirs; their path and their
turns are those of the motion on the humanoid. All other figures, and skeletons that are to be seen as they are, have
the round bones of :mod:`motet.draw.figure`. Lengths are in body heights.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from motet.draw.body import LEFT_PART, MIDDLE_PART, RIGHT_PART, human_mesh
from motet.draw.figure import SAME_SPOT, Body, Bone, figure_of
from motet.draw.mesh import Mesh, loft, ring, together
from motet.errors import MotionError
from motet.figures.humanoid import (
    HUMANOID,
    LEFT_RIGHT,
    SURE_OF_JOINTS,
    T_POSE,
    Figure,
    joint_of,
    leg_length,
    sided,
    to_humanoid,
)
from motet.motion.kinematics import Transforms, chained, global_transforms, local_rotations, local_translations
from motet.motion.motion import Motion
from motet.motion.rotations import UP, Array, angle_of, unit
from motet.motion.skeleton import LEFT, MIDDLE, RIGHT, Skeleton

PART_OF_SIDE = {LEFT: LEFT_PART, RIGHT: RIGHT_PART, MIDDLE: MIDDLE_PART}

BONE_ENDS = (
    ("UpperArm", "LowerArm", 0),
    ("LowerArm", "Hand", 0),
    ("UpperLeg", "LowerLeg", 1),
    ("LowerLeg", "Foot", 1),
)
"""Bones that have lengths of their own: where each ends, and along which axis of its joint."""

WIDTHS = {"UpperLeg": ("hips",), "UpperArm": ("upperChest", "leftShoulder", "rightShoulder")}
"""Which joints' distance from side to side gives the width of what of the trunk."""


@dataclass(frozen=True, eq=False)
class Skinned:
    """A motion of T frames on a mesh that a skeleton's K joints carry; the ground is y = 0.

    rest: (K, 3) where the joints are in the mesh. scales: (K, 3) how much larger a figure is than the mesh, along the
    axes of each joint. turns: (T, K, 3, 3) in the parents' frames. moves: (T, K, 3) places in the parents' frames.
    heading: where it faces at first, in radians about y, 0 is z.
    """

    mesh: Mesh
    rest: Array
    scales: Array
    skeleton: Skeleton
    turns: Array
    moves: Array
    heading: float
    fps: float

    def frames(self) -> Transforms:
        """Rotations (T, K, 3, 3) and places (T, K, 3) of the joints in the world."""
        return chained(self.skeleton, self.turns.copy(), self.moves.copy())

    def corners(self, turns: Array, places: Array) -> Array:
        """Corners (V, 3) of the mesh in one frame of :meth:`frames`: turns (K, 3, 3) and places (K, 3)."""
        scaled = turns * self.scales[:, None]
        return self.mesh.carried(scaled, places - np.einsum("kij,kj->ki", scaled, self.rest))


def skinned(motion: Motion, as_it_is: bool = False) -> Skinned:
    """A motion on the body of a person where it is surely one's, or on the bones of its own skeleton.

    as_it_is: on these in any case. MotionError as of :func:`motet.draw.figure.figure_of`.
    """
    bones = _on_bones(motion)
    return bones if as_it_is else _on_person(motion) or bones


def _on_person(motion: Motion) -> Skinned | None:
    """None for what is not surely a person."""
    scales = np.ones((len(HUMANOID.joints), 3))
    if motion.skeleton != HUMANOID:
        try:
            retargeted = to_humanoid(motion)
        except MotionError:
            return None
        if retargeted.confidence < SURE_OF_JOINTS:
            return None
        scales = _proportions(retargeted.figure, motion)
        motion = retargeted.motion
    height = Body(HUMANOID).height
    # joints turn as the humanoid's, and are as far from their parents as theirs are
    turns = local_rotations(motion)
    moves = np.tile(HUMANOID.offsets * scales[HUMANOID.parents], (len(motion), 1, 1))
    moves[:, 0] = local_translations(motion)[:, 0]
    heading = float(angle_of(turns[0, 0, 0, 2], turns[0, 0, 2, 2]))
    return Skinned(person(), T_POSE / height, scales, HUMANOID, turns, moves / height, heading, motion.fps)


@cache
def person(level: int = 0) -> Mesh:
    """The body of people in heights; see :func:`motet.draw.body.human_mesh`."""
    mesh = human_mesh(level)
    return replace(mesh, places=mesh.places / Body(HUMANOID).height)


def _proportions(figure: Figure, motion: Motion) -> Array:
    """How much longer the bones of a figure are than the humanoid's, if its legs are as long: (J, 3) along the axes of
    the humanoid's joints, of which those of arms are x and of legs and trunk y."""
    body = figure.fitted.body
    places = global_transforms(motion[:: max(1, len(motion) // 100)])[1] * (leg_length() / figure.fitted.leg)
    scales = _proportions_of_limbs(places, body.joints)
    # the trunk, upwards
    trunk = body.middle(places, "UpperArm") - body.middle(places, "UpperLeg")
    scales[_indices("spine", "chest", "upperChest"), 1] = _ratio(trunk, np.array([0.48]))
    # shoulders and hips, sideways
    for part, bones in WIDTHS.items():
        usual_wide = 2 * HUMANOID.rest_positions[joint_of("left", part), :1]
        scales[_indices(*bones), 0] = _ratio(body.to_left(places, part), usual_wide)
    return scales


def _proportions_of_limbs(places: Array, joints: Mapping[str, int]) -> Array:
    """As :func:`_proportions`, of limbs along their bones alone, from places (T, J, 3) of a figure's joints."""
    scales = np.ones((len(HUMANOID.joints), 3))
    for bone, end, axis in BONE_ENDS:
        for side in LEFT_RIGHT:
            if sided(side, end) in joints:
                vectors = places[:, joints[sided(side, bone)]] - places[:, joints[sided(side, end)]]
                usual = HUMANOID.rest_positions[joint_of(side, bone)] - HUMANOID.rest_positions[joint_of(side, end)]
                scales[joint_of(side, bone), axis] = _ratio(vectors, usual)
    return scales


def _indices(*bones: str) -> list[int]:
    return list(map(HUMANOID.index, bones))


def _ratio(vectors: Array, usual: Array) -> float:
    """How much longer vectors (T, 3), where they are nearly longest, are than one (3,); within what a body can be."""
    longest = np.quantile(np.linalg.norm(vectors, axis=-1), 0.9)
    return float(np.clip(longest / np.linalg.norm(usual), 0.75, 1.33))


def _on_bones(motion: Motion) -> Skinned:
    """The round bones of a motion's own skeleton."""
    figure = figure_of(motion)
    first = figure.first
    body = figure.body
    skeleton = body.skeleton
    # the root as in the world, all others as in their parents
    turns = local_rotations(motion)[:, first:]
    moves = local_translations(motion)[:, first:] / body.height
    turns[:, 0] = global_transforms(motion)[0][:, first]
    moves[:, 0] = figure.points[:, 0]
    rest = body.points(skeleton.rest_positions / body.height)
    mesh = mesh_of_bones(body, rest, moves)
    joints = len(skeleton.joints)
    return Skinned(mesh, rest[:joints], np.ones((joints, 3)), skeleton, turns, moves, figure.heading, motion.fps)


def mesh_of_bones(body: Body, rest: Array, moves: Array) -> Mesh:
    """The bones of a body at rest (P, 3). moves: (T, J, 3) places of its joints in their parents' frames."""
    # a bone whose end moves there is stretched: its end goes with that joint
    is_stretched = np.ptp(moves, axis=0).max(axis=-1) > SAME_SPOT
    bones = []
    for bone in body.bones:
        goes_along = bone.end < len(is_stretched) and is_stretched[bone.end]
        bones.append(_capsule(bone, rest, bone.end if goes_along else bone.carriers[1]))
    return together(bones)


CAPS = np.radians([-80.0, -50.0, 0.0, 0.0, 50.0, 80.0])[:, None, None]
"""Where the rings of a round bone are on the balls at its ends, from its start on."""


def _capsule(bone: Bone, rest: Array, end_carrier: int, corners: int = 10) -> Mesh:
    """A bone between points of a skeleton at rest (P, 3), whose end a joint carries."""
    # three rings at each end
    middles = rest[[bone.start] * 3 + [bone.end] * 3][:, None]
    radii = np.repeat([bone.start_radius, bone.end_radius], 3)[:, None, None]
    places, triangles = loft(middles + radii * _unit_rings(rest[bone.end] - rest[bone.start], corners))
    carriers = np.repeat([bone.carriers[0], end_carrier], 3 * corners)
    parts = np.full(len(places), PART_OF_SIDE[bone.side])
    return Mesh(places, triangles, carriers[:, None], np.ones((len(places), 1)), parts)


def _unit_rings(axis: Array, corners: int) -> Array:
    """Rings (6, C, 3) around an axis on balls of radius 1, upright where it has no length."""
    axis = unit(axis) if axis.any() else UP
    side = unit(np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))]))
    around = ring(corners) @ np.stack([side, np.cross(axis, side)])
    return np.cos(CAPS) * around + np.sin(CAPS) * axis
