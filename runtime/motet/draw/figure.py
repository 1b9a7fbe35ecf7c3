"""The figure in pictures of a motion: the points of its body in every frame, standing on the ground."""

from dataclasses import dataclass, replace

import numpy as np

from motet.draw.body import Body, Bone
from motet.errors import MotionError
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import LEFT, RIGHT, Skeleton

LARGEST_COORDINATE = 1e6
"""Positions further than this from the origin are refused: such a motion is broken and cannot be drawn."""


@dataclass(frozen=True)
class Figure:
    """A motion as points and bones.

    points: (T, P, 3) in body heights, y up, the ground at y = 0: the J joints, then jaw and crown if there is a head.
    bones: which points they join.
    heading: where the figure faces in its first frame: radians about y, 0 is +z, a quarter turn is +x.
    fps: frames per second.
    """

    points: Array
    bones: tuple[Bone, ...]
    heading: float
    fps: float


def figure_of(motion: Motion) -> Figure:
    """The figure of a motion; MotionError if it has no skeleton, no frames or positions far beyond any stage."""
    skeleton = skeleton_of(motion)
    if not len(motion):
        raise MotionError("this motion has no frames to show")
    skeleton, places = _moving_part(motion, skeleton)
    body = Body(skeleton)
    points = places / body.height
    if not np.abs(points).max() < LARGEST_COORDINATE:
        raise MotionError(f"joints are over {LARGEST_COORDINATE:g} body heights from the origin: too far to show")
    points[:, :, 1] -= _ground(points, moves=f"{skeleton.names[0]}.ty" in motion.channels)
    return Figure(body.points(points), body.bones, _heading(points[0], body.sides), motion.fps)


def _moving_part(motion: Motion, skeleton: Skeleton) -> tuple[Skeleton, Array]:
    """The skeleton from the joint on that carries the figure about, and the positions (T, J, 3) of its joints.

    Some programs put a joint above the hips that stays at the origin: it is not a part of the figure.
    """
    places, first = positions(motion), 0
    travelled = {name.rpartition(".")[0] for name in motion.channels if name[-3:-1] == ".t"}
    while (
        skeleton.children[first] == (first + 1,)
        and not np.ptp(places[:, first], axis=0).any()
        and skeleton.names[first + 1] in travelled
    ):
        first += 1
    joints = (replace(joint, parent=max(joint.parent - first, -1)) for joint in skeleton.joints[first:])
    return replace(skeleton, joints=tuple(joints)), places[:, first:]


def _ground(points: Array, moves: bool) -> float:
    lowest = float(points[..., 1].min())
    # metres: a lowest point this near y = 0 stands on it
    return 0.0 if moves and abs(lowest) < 0.1 else lowest


def _heading(points: Array, sides: tuple[str, ...]) -> float:
    if LEFT not in sides:
        return 0.0
    left, right = (np.mean([points[i] for i, of in enumerate(sides) if of == side], axis=0) for side in (LEFT, RIGHT))
    to_left = left - right
    return float(np.arctan2(-to_left[2], to_left[0]))
