"""Frames of the humanoid placed in the world: where its hips are, and two axes of every bone, the hips among them.

What stands between two poses is told best from one of them: placed frames are turned and moved over the ground as a
whole (:func:`seen_from`), and know no smoothed facing, which near a gap would tell of what lies in it.

Letters in shapes: T frames, K bones, E = 3 + 6 K channels: the hips' x, y and z in metres, and for each bone where its
x and its y axis point in its parent's frame (:mod:`motet.representation.root_sixd`), for the hips in the world.
"""

import numpy as np

from motet.figures.humanoid import BONES
from motet.motion.kinematics import channels_of, continued, local_rotations, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import (
    Array,
    inverse,
    product,
    rotmat_to_rotvec,
    rotvec_to_rotmat,
)
from motet.motion.skeleton import partners_of
from motet.representation.base import FrameMirror
from motet.representation.root_sixd import (
    ROOT_SIXD,
    SIXD_KINDS,
    SIXD_SIGNS,
    rotmat_to_sixd,
    sixd_to_rotmat,
)

ROOT_PLACE = 3
"""Channels of the root's place, before all axes."""

HIPS_AXES = slice(ROOT_PLACE, ROOT_PLACE + 6)
"""Channels of the axes of the hips."""

PLACED_CHANNELS = ROOT_PLACE + 6 * len(BONES)
"""E."""


def placed(motion: Motion) -> Array:
    """A motion on the humanoid as placed frames (T, E); MotionError where it does not say where the hips are."""
    skeleton = skeleton_of(motion)
    turned = local_rotations(motion, [skeleton.index(name) for name in BONES])
    root = motion.select(channels_of(BONES[0], "t"), ("m",) * 3).values
    return np.column_stack([root, rotmat_to_sixd(np.ascontiguousarray(turned)).reshape(len(motion), -1)])


def placed_by_way(frames: Array, fps: float) -> Array:
    """Frames (..., T, 4 + 6 K) of ``root_sixd`` as placed frames (..., T, E), the first at the origin, facing z."""
    steps = frames[..., :ROOT_PLACE] / fps
    steps[..., :1, :] = 0
    forward, left, turn = np.moveaxis(steps, -1, 0)

    # each step is taken in the facing before it: they add up to the path, and the height is as it is
    facing = np.cumsum(turn, axis=-1)
    moves = np.stack([left, np.zeros_like(left), forward], axis=-1)
    _turn(moves, facing - turn)
    path = np.cumsum(moves, axis=-2)
    path[..., 1] = frames[..., ROOT_PLACE]

    # the hips are turned from the facing to the world; all other bones are seen from their parents
    placed_frames = np.concatenate([path, frames[..., len(ROOT_SIXD) :]], axis=-1, dtype=np.float64)
    _turn(placed_frames[..., HIPS_AXES], facing)
    return placed_frames


def pose_of(frames: Array) -> Array:
    """Where a figure is and how it faces: (..., 3), x, z and the angle in radians, of placed frames (..., E).

    The angle is that of the turn about the vertical axis after which the root is tilted, as that of
    :func:`motet.representation.root_sixd.facing`, but of one frame alone.
    """
    # of a turn about y after a tilt, this quotient is free of the tilt
    hips = sixd_to_rotmat(frames[..., HIPS_AXES])
    angle = np.arctan2(hips[..., 0, 2] - hips[..., 2, 0], hips[..., 0, 0] + hips[..., 2, 2])
    return np.stack([frames[..., 0], frames[..., 2], angle], axis=-1)


def seen_from(frames: Array, pose: Array) -> Array:
    """Placed frames (..., T, E) as they are seen from poses (..., 3), which come to the origin and face z."""
    # moved first, then turned
    seen = np.array(frames, dtype=np.float64)
    seen[..., 0] -= pose[..., None, 0]
    seen[..., 2] -= pose[..., None, 1]
    return _turned(seen, -pose[..., None, 2])


def put_at(frames: Array, pose: Array) -> Array:
    """The inverse of :func:`seen_from`: frames whose origin comes to poses (..., 3)."""
    # turned first, then moved
    put = _turned(np.array(frames, dtype=np.float64), pose[..., None, 2])
    put[..., 0] += pose[..., None, 0]
    put[..., 2] += pose[..., None, 1]
    return put


def bridge(past: Array, after: Array, count: int, pace: float = 1.0) -> Array:
    """A plain way (..., count, E) from the last of placed frames (..., P, E) to the first of (..., A, E).

    Joints turn the shortest way at an even speed (slerp); the root goes on a cubic Hermite curve that leaves and
    arrives with the velocities it has there. pace: frames of the gap per frame of the past.
    """
    # the root: a cubic through both ends, with the velocities there (Hermite)
    part = _parts(count)
    start = past[..., -1:, :ROOT_PLACE]
    end = after[..., :1, :ROOT_PLACE]
    leaves = _root_velocity(past[..., -4:, :ROOT_PLACE])
    arrives = _root_velocity(after[..., :4, :ROOT_PLACE])
    span = (count + 1) * pace
    path = (
        (1 + 2 * part) * (1 - part) ** 2 * start
        + part * (1 - part) ** 2 * span * leaves
        + part**2 * (3 - 2 * part) * end
        - part**2 * (1 - part) * span * arrives
    )
    return np.concatenate([path, _axes_between(past, after, part)], axis=-1)


def straight(past: Array, after: Array, count: int) -> Array:
    """As :func:`bridge`, the root on a line at an even speed: the plainest interpolation."""
    part = _parts(count)
    start = past[..., -1:, :ROOT_PLACE]
    path = start + part * (after[..., :1, :ROOT_PLACE] - start)
    return np.concatenate([path, _axes_between(past, after, part)], axis=-1)


def _parts(count: int) -> Array:
    """Which part of the way (count, 1) each of the frames between two has behind it."""
    return (np.arange(1, count + 1) / (count + 1))[:, None]


def _root_velocity(places: Array) -> Array:
    """The mean velocity (..., 1, 3) over places (..., T, 3), metres a frame; 0 where there is only one."""
    return np.asarray((places[..., -1:, :] - places[..., :1, :]) / max(1, places.shape[-2] - 1))


def _axes_between(past: Array, after: Array, part: Array) -> Array:
    """Axes (..., T, 6 K) of bones that turn the shortest way from the last of frames (..., P, E) to the first of
    (..., A, E), of which they have parts (T, 1) behind them (slerp)."""
    # the turn from one to the other as a rotation vector, of which each frame has its part
    rotations = _rotations(past[..., -1:, :])
    turns = rotmat_to_rotvec(product(inverse(rotations), _rotations(after[..., :1, :]))) * part[..., None]
    axes = rotmat_to_sixd(np.matmul(rotations, rotvec_to_rotmat(turns)))
    return axes.reshape(*axes.shape[:-2], past.shape[-1] - ROOT_PLACE)


def unplaced(frames: Array, after: Motion) -> Motion:
    """Placed frames (T, E) as what follows a motion on the humanoid, in its channels."""
    turned = _rotations(frames)
    rotations = {name: turned[:, place] for place, name in enumerate(BONES)}
    return continued(after[-1:], rotations, {BONES[0]: frames[:, :ROOT_PLACE]})


def mirror() -> FrameMirror:
    """How placed frames are mirrored, in the plane x = 0."""
    columns = np.arange(PLACED_CHANNELS)
    signs = np.ones(PLACED_CHANNELS, dtype=np.float32)
    signs[0] = -1
    # each bone's columns come from its partner's
    kinds = np.arange(len(SIXD_KINDS)) + ROOT_PLACE
    for bone, partner in enumerate(partners_of(BONES)):
        bone_columns = kinds + len(SIXD_KINDS) * bone
        columns[bone_columns] = kinds + len(SIXD_KINDS) * partner
        signs[bone_columns] = list(SIXD_SIGNS.values())
    return FrameMirror(columns, signs)


def _rotations(frames: Array) -> Array:
    """Local rotations (..., K, 3, 3) of placed frames (..., E)."""
    return sixd_to_rotmat(frames[..., ROOT_PLACE:].reshape(*frames.shape[:-1], len(BONES), 6))


def _turned(frames: Array, angle: Array) -> Array:
    """The frames (..., T, E), changed in place, turned about the world's vertical axis by angles (..., T)."""
    _turn(frames[..., :ROOT_PLACE], angle)
    _turn(frames[..., HIPS_AXES], angle)
    return frames


def _turn(vectors: Array, angle: Array) -> None:
    """Turn vectors (..., 3 N), which lie one after the other, in place."""
    sin = np.sin(angle)[..., None]
    cos = np.cos(angle)[..., None]
    x = np.array(vectors[..., 0::3])
    z = np.array(vectors[..., 2::3])
    vectors[..., 0::3] = x * cos + z * sin
    vectors[..., 2::3] = z * cos - x * sin
