"""Conversions between rotation representations, named ``from_to``, and arithmetic with matrices and quaternions.

Any number of leading dimensions may precede the last one (angles, vectors, quaternions) or the last two (matrices).
Angles are radians, arrays float64. Matrices rotate column vectors. An Euler ``order`` of three different axes lists the
factors of the product from left to right, as do the angles: "zyx" is R = Rz Ry Rx (scipy's intrinsic ``"ZYX"``).
Quaternions are (x, y, z, w), unit length, scalar last.

Products are summed along the frames, about four times as fast as by ``@``, if the frames are contiguous in memory
(:func:`frames_last`). Results and slices of such arrays keep that layout; others give the same products, more slowly.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

UP = np.array([0.0, 1.0, 0.0])
"""Where y points."""

LOCKED = 1e-9
"""Gimbal lock: below this cosine of the middle Euler angle the other two turn about the same axis."""


def frames_last(shape: tuple[int, ...]) -> Array:
    """An uninitialized array (T, ...) with the frames last in memory, along which elementwise computations then run."""
    return np.empty(shape[::-1]).T


def identities(*shape: int) -> Array:
    """Rotations (..., 3, 3) by no angle."""
    return np.tile(np.eye(3), (*shape, 1, 1))


def angle_of(sine: Array, cosine: Array) -> Array:
    """Angles (...) in radians from sines and cosines (...): ``np.arctan2``, rounded the same for any memory layout.

    Old numpy mistakes a strided array that ends next to the result's memory for overlapping, and rounds differently.
    """
    return np.arctan2(np.array(sine, order="K"), np.array(cosine, order="K"))


def axis_to_rotmat(axis: str, angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) about one coordinate axis ("x", "y" or "z") by ``angle`` (...)."""
    i = "xyz".index(axis)
    j = (i + 1) % 3
    k = (i + 2) % 3
    cos = np.cos(angle)
    sin = np.sin(angle)
    matrix = np.zeros((*np.shape(angle), 3, 3))
    matrix[..., i, i] = 1.0
    matrix[..., j, j] = matrix[..., k, k] = cos
    matrix[..., k, j] = sin
    matrix[..., j, k] = -sin
    return matrix


def euler_to_rotmat(angles: Array, order: str) -> Array:
    """Euler angles (..., 3) to matrices (..., 3, 3): the product multiplied out."""
    i, j, k = map("xyz".index, order)
    # cosine and sine from the tangent of the half angle, several times as fast in numpy as both
    tangent = np.tan(angles * (0.5 * _handedness(order)))
    part = 1 / (1 + tangent**2)
    cos_a, cos_b, cos_c = np.moveaxis((1 - tangent**2) * part, -1, 0)
    sin_a, sin_b, sin_c = np.moveaxis(2 * tangent * part, -1, 0)

    # R = Ri(a) Rj(b) Rk(c): the row that the first turn leaves as it is
    matrix = frames_last((*angles.shape[:-1], 3, 3))
    matrix[..., i, i] = cos_b * cos_c
    matrix[..., i, j] = -cos_b * sin_c
    matrix[..., i, k] = sin_b

    # and the two rows that it mixes, which are alike but for a quarter turn of a
    for row, cos, sin in ((j, cos_a, sin_a), (k, sin_a, -cos_a)):
        tilted = sin * sin_b
        matrix[..., row, i] = tilted * cos_c + cos * sin_c
        matrix[..., row, j] = cos * cos_c - tilted * sin_c
        matrix[..., row, k] = -sin * cos_b
    return matrix


def rotmat_to_euler(matrix: Array, order: str) -> Array:
    """Matrices (..., 3, 3) to Euler angles (..., 3), the middle within a quarter turn, the last 0 at a gimbal lock."""
    i, j, k = map("xyz".index, order)
    sign = _handedness(order)
    # the row that the first turn leaves and the column that the last one leaves tell all three angles
    cos_middle = np.sqrt(matrix[..., i, i] ** 2 + matrix[..., i, j] ** 2)
    angles = frames_last((*matrix.shape[:-2], 3))
    angles[..., 0] = angle_of(-sign * matrix[..., j, k], matrix[..., k, k])
    angles[..., 1] = angle_of(sign * matrix[..., i, k], cos_middle)
    angles[..., 2] = angle_of(-sign * matrix[..., i, j], matrix[..., i, i])
    # where the outer axes are the same, the first angle takes all of the turn
    locked = cos_middle < LOCKED
    if locked.any():
        angles[locked, 0] = angle_of(sign * matrix[locked, k, j], matrix[locked, j, j])
        angles[locked, 2] = 0.0
    return angles


def _handedness(order: str) -> float:
    return 1.0 if order in "xyzxy" else -1.0


def continuous_euler(angles: Array, turn: Array | float = 2 * np.pi) -> Array:
    """The same rotations with Euler angles (T, ..., 3) that do not jump from frame to frame; the first frame stays.

    Of the two solutions (a, b, c) and (a + pi, pi - b, c + pi), each up to whole turns, every frame takes the one
    nearest to the frame before it. turn: a whole turn in the angles' unit, or one for each angle.
    """
    turn = turn + np.zeros(angles.shape[1:])
    result = np.array(angles, dtype=np.float64)
    # steps of less than a sixth of a turn are nearer than the other solution, of which two angles are half a turn off
    leaping = (np.abs(np.diff(result, axis=0)) > turn / 6).any(axis=(0, -1))
    if leaping.any():
        result[:, leaping] = _without_flips(result[:, leaping], turn[leaping])
    return result


def _without_flips(angles: Array, turn: Array) -> Array:
    """:func:`continuous_euler` of angles (T, J, 3) with whole turns (J, 3)."""
    # the solutions lie as far from each other seen from either: where one is nearer than the other does not depend on
    # which of them the frame before took
    flipped = angles * [1, -1, 1] + turn / 2
    stay = _distance((angles[1:] - angles[:-1]) / turn)
    change = _distance((flipped[1:] - angles[:-1]) / turn)

    # so every change goes over to the other solution, and every second one back
    is_flipped = np.cumsum(change < stay - 1e-9, axis=0) % 2 == 1
    nearest = np.concatenate([angles[:1], np.where(is_flipped[..., None], flipped[1:], angles[1:])])
    return without_turns(nearest, turn)


def _distance(turns: Array) -> Array:
    """How far (...) rotations are from each other whose Euler angles differ by turns (..., 3), in radians."""
    return np.asarray(2 * np.pi * np.abs(turns - np.round(turns)).sum(axis=-1))


def rotmats_to_euler(matrices: Array, order: str, leaps: bool = False) -> Array:
    """Matrices (T, ..., 3, 3) to Euler angles (T, ..., 3) that do not leap from frame to frame, unless ``leaps``.

    At a gimbal lock, where only the sum or difference of the outer angles counts, the last is that of the last free
    frame.
    """
    angles = rotmat_to_euler(matrices, order)
    # where the middle angle is a right angle only the sum or difference of the others counts: the last one stays as it
    # was
    locked = np.abs(angles[..., 1]) > np.pi / 2 - LOCKED
    if locked.any():
        frames = np.arange(len(angles)).reshape(-1, *[1] * (angles.ndim - 2))
        free = np.maximum.accumulate(np.where(locked, 0, frames), axis=0)
        last = np.take_along_axis(angles[..., 2], free, axis=0)
        angles[..., 0] -= np.where(
            locked,
            _handedness(order) * np.sign(angles[..., 1]) * (last - angles[..., 2]),
            0,
        )
        angles[..., 2] = np.where(locked, last, angles[..., 2])
    return angles if leaps else continuous_euler(angles)


def without_turns(angles: Array, turn: Array | float = 2 * np.pi) -> Array:
    """Angles (T, ...) that differ by no more than half a turn from frame to frame; the first frame stays."""
    turns = np.round(np.diff(angles, axis=0) / turn).cumsum(axis=0)
    return np.concatenate([angles[:1], angles[1:] - turns * turn])


def continuous_rotvec(vectors: Array) -> Array:
    """The same rotations as rotation vectors (T, J, 3) that do not jump from frame to frame; the last frame stays.

    A rotation by a about an axis is also one by a - 2 pi: every frame takes the one nearest to the frame after it.
    """
    result = np.array(vectors, dtype=np.float64)
    frames, joints, _ = np.nonzero(_whole_turns(result[:-1], result[1:]))
    if len(joints):  # without jumps they are the nearest already
        joints = np.unique(joints)
        part = result[:, joints]
        # from the last jump backwards, each frame after the one behind it is settled
        for t in range(int(frames.max()), -1, -1):
            part[t] += _whole_turns(part[t], part[t + 1])
        result[:, joints] = part
    return result


def _whole_turns(now: Array, after: Array) -> Array:
    """Whole turns to add to rotation vectors (..., 3) to bring them nearest to ``after`` (..., 3)."""
    angle = np.linalg.norm(now, axis=-1, keepdims=True)
    angle_after = np.linalg.norm(after, axis=-1, keepdims=True)
    # a rotation by no angle takes the axis of the frame after it
    axis = np.where(
        angle > 1e-3,
        now / np.maximum(angle, 1e-9),
        after / np.maximum(angle_after, 1e-9),
    )
    along = (after * axis).sum(-1, keepdims=True)
    return np.asarray(axis * (np.round((along - angle) / (2 * np.pi)) * 2 * np.pi))


def rotvec_to_rotmat(vector: Array) -> Array:
    """Rotation vectors (exponential maps) (..., 3) to matrices (..., 3, 3) (Rodrigues' formula)."""
    angle = np.linalg.norm(vector, axis=-1)
    # sin(a)/a and (1 - cos a)/a^2, both exact at 0 by numpy's sinc(t) = sin(pi t)/(pi t)
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return rodrigues(np.cos(angle), first[..., None] * vector, second[..., None] * vector, vector)


def rodrigues(cosine: Array, sine: Array, versed: Array, along: Array) -> Array:
    """Matrices (..., 3, 3) of rotations by angles a about axes n, as c I + [s]x + v w^T.

    cosine: c = cos a (...); sine: s = n sin a (..., 3); versed, along: v and w, with v w^T = (1 - cos a) n n^T.
    """
    matrix = frames_last((*sine.shape, 3))
    matrix[:] = versed[..., :, None] * along[..., None, :]
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., i, i] += cosine
        matrix[..., k, j] += sine[..., i]
        matrix[..., j, k] -= sine[..., i]
    return matrix


def rotmat_to_rotvec(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to rotation vectors (..., 3) of at most half a turn."""
    quat = rotmat_to_quat(matrix)
    # the quaternion is (n sin a/2, cos a/2)
    sin_half = np.linalg.norm(quat[..., :3], axis=-1, keepdims=True)
    half = angle_of(sin_half, quat[..., 3:])
    scale = np.where(sin_half > 1e-12, 2 * half / np.where(sin_half > 1e-12, sin_half, 1.0), 2.0)
    return quat[..., :3] * scale


def quat_to_rotmat(quat: Array) -> Array:
    """Unit quaternions (..., 4), scalar last, to matrices (..., 3, 3)."""
    vector = quat[..., :3]
    scalar = quat[..., 3:]
    return rodrigues(1 - 2 * np.sum(vector**2, axis=-1), 2 * scalar * vector, 2 * vector, vector)


def rotmat_to_quat(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to unit quaternions (..., 4), scalar last and not negative.

    The largest of the four components is found first and divides the others, so every rotation is exact (Shepperd
    1978).
    """
    # of the four scaled ones that with the largest component, of length 1 and with w not negative
    scaled = _scaled_quats(matrix)
    largest = np.argmax(np.diagonal(scaled, axis1=-2, axis2=-1), axis=-1)
    quat = np.take_along_axis(scaled, largest[..., None, None], axis=-2)[..., 0, :]
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    return np.where(quat[..., 3:] < 0, -quat, quat)


def _scaled_quats(matrix: Array) -> Array:
    """The quaternions q of matrices (..., 3, 3) scaled in four ways: row n of (..., 4, 4) is 4 q_n q."""
    trace = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None]
    difference = matrix - inverse(matrix)
    scaled = frames_last((*matrix.shape[:-2], 4, 4))
    scaled[..., :3, :3] = matrix + inverse(matrix) + (1 - trace) * np.eye(3)
    scaled[..., 3, :3] = scaled[..., :3, 3] = difference[..., [2, 0, 1], [1, 2, 0]]
    scaled[..., 3, 3] = 1 + trace[..., 0, 0]
    return scaled


def product(left: Array, right: Array) -> Array:
    """Matrix products (..., 3, 3); one of the factors has the shape of the result."""
    result: Array = np.empty_like(left if left.shape == np.broadcast_shapes(left.shape, right.shape) else right)
    np.einsum("...ij,...jk->...ik", left, right, out=result)
    return result


def rotated(rotations: Array, vectors: Array) -> Array:
    """Vectors (..., 3) rotated by rotations (..., 3, 3)."""
    turned: Array = np.einsum("...ij,...j->...i", rotations, vectors)
    return turned


def inverse(rotations: Array) -> Array:
    """The inverse rotations (..., 3, 3)."""
    return np.swapaxes(rotations, -1, -2)


def unit(vectors: Array) -> Array:
    """Vectors (..., 3) of length 1; zero vectors stay."""
    lengths = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None]
    return vectors / np.where(lengths > 1e-12, lengths, 1.0)


def swing(start: Array, end: Array) -> Array:
    """The shortest rotations (..., 3, 3) from directions (..., 3) to others; half a turn is about any axis."""
    start = unit(start)
    end = unit(end)
    axis = np.cross(start, end)
    cosine = np.sum(start * end, axis=-1)
    versed = axis / np.maximum(1 + cosine, 1e-9)[..., None]
    # 1 - (1 - cosine) instead of the cosine: a direction of 0 gives the identity
    turn = rodrigues(1 - np.sum(versed * axis, axis=-1), axis, versed, axis)

    # half a turn is about the axis that is square to the direction and to the coordinate axis farthest from it
    half = cosine < -1 + 1e-6
    if half.any():
        side = unit(np.cross(start, np.eye(3)[np.argmin(np.abs(start), axis=-1)]))
        turn = np.where(
            half[..., None, None],
            2 * side[..., :, None] * side[..., None, :] - np.eye(3),
            turn,
        )
    return turn


def twist(rotations: Array, axis: Array) -> Array:
    """The twist (T, 3, 3) of rotations (T, 3, 3) about an axis (3); the rest is the swing."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.broadcast_to(np.eye(3), rotations.shape)
    # a quaternion's part along the axis, beside its scalar, is that of the twist
    quats = rotmat_to_quat(rotations)
    along = axis / length
    angles = 2 * angle_of(quats[..., :3] @ along, quats[..., 3])
    return rotvec_to_rotmat(angles[..., None] * along)


def quat_product(left: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """Products of quaternions (..., 4): the right rotation first, then the left."""
    # (v, s)(w, t) = (s w + t v + v x w, s t - v.w)
    a = left[..., :3]
    b = right[..., :3]
    products = np.empty(np.broadcast_shapes(left.shape, right.shape), dtype=left.dtype)
    products[..., :3] = left[..., 3:] * b + right[..., 3:] * a + cross(a, b)
    products[..., 3] = left[..., 3] * right[..., 3] - (a * b).sum(axis=-1)
    return products


def quat_rotated(quats: NDArray[Any], vectors: NDArray[Any]) -> NDArray[Any]:
    """Vectors (..., 3) rotated by unit quaternions (..., 4)."""
    axis = quats[..., :3]
    twice = 2 * cross(axis, vectors)
    turned: NDArray[Any] = vectors + quats[..., 3:] * twice + cross(axis, twice)
    return turned


def cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    """Cross products of vectors (..., 3); numpy's own takes several times as long for small arrays."""
    products = np.empty(np.broadcast_shapes(a.shape, b.shape), dtype=a.dtype)
    products[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    products[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    products[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return products


def conjugate(quats: NDArray[Any]) -> NDArray[Any]:
    """The inverse rotations (..., 4)."""
    inverses: NDArray[Any] = quats * np.array([-1, -1, -1, 1], dtype=quats.dtype)
    return inverses


def wrapped(angle: NDArray[Any]) -> NDArray[Any]:
    """Angles in radians, between -pi and pi."""
    return angle - 2 * np.pi * np.rint(angle / (2 * np.pi))
