"""Conversions between rotation representations; names say ``from_to``.

Any number of leading dimensions comes before the last one (angles, vectors, quaternions) or the last two
(matrices). Angles are radians, arrays float64. Matrices turn column vectors. An Euler ``order`` such as ``"zyx"``
lists the factors of the product from left to right, R = Rz Ry Rx, and the angles come in the same order (what
scipy writes as the intrinsic ``"ZYX"``). Quaternions are (x, y, z, w), unit length, the scalar last.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_AXES = {"x": 0, "y": 1, "z": 2}


def axis_to_rotmat(axis: str, angle: Array) -> Array:
    """Rotation matrices (..., 3, 3) about one coordinate axis ("x", "y" or "z") by ``angle`` (...)."""
    i = _AXES[axis]
    j, k = (i + 1) % 3, (i + 2) % 3
    cos, sin = np.cos(angle), np.sin(angle)
    matrix = np.zeros((*np.shape(angle), 3, 3))
    matrix[..., i, i] = 1.0
    matrix[..., j, j] = matrix[..., k, k] = cos
    matrix[..., k, j], matrix[..., j, k] = sin, -sin
    return matrix


def euler_to_rotmat(angles: Array, order: str) -> Array:
    """Euler angles (..., 3) in ``order`` to matrices (..., 3, 3)."""
    a, b, c = (axis_to_rotmat(axis, angles[..., n]) for n, axis in enumerate(order))
    product: Array = a @ b @ c
    return product


def rotmat_to_euler(matrix: Array, order: str) -> Array:
    """Matrices (..., 3, 3) to Euler angles (..., 3): with the middle one within a quarter turn.

    ``order`` must name three different axes. At a gimbal lock the last angle is 0.
    """
    i, j, k = (_AXES[axis] for axis in order)
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    cos_middle = np.hypot(matrix[..., i, i], matrix[..., i, j])
    locked = cos_middle < 1e-9
    first = np.where(
        locked,
        np.arctan2(sign * matrix[..., k, j], matrix[..., j, j]),
        np.arctan2(-sign * matrix[..., j, k], matrix[..., k, k]),
    )
    middle = np.arctan2(sign * matrix[..., i, k], cos_middle)
    last = np.where(locked, 0.0, np.arctan2(-sign * matrix[..., i, j], matrix[..., i, i]))
    return np.stack([first, middle, last], axis=-1)


def continuous_euler(angles: Array) -> Array:
    """The same rotations with Euler angles (T, ..., 3) that do not leap from frame to frame.

    Of the two solutions (a, b, c) and (a + pi, pi - b, c + pi), each up to whole turns, every frame takes the one
    nearest to the frame before it; the first frame stays.
    """
    result = np.array(angles, dtype=np.float64)
    turn = 2 * np.pi
    for t in range(1, len(result)):
        before, now = result[t - 1], result[t]
        flipped = now * [1, -1, 1] + np.pi
        now, flipped = (x - turn * np.round((x - before) / turn) for x in (now, flipped))
        nearer = np.abs(flipped - before).sum(-1) < np.abs(now - before).sum(-1) - 1e-9
        result[t] = np.where(nearer[..., None], flipped, now)
    return result


def rotvec_to_rotmat(vector: Array) -> Array:
    """Rotation vectors, also called exponential maps, (..., 3) to matrices (..., 3, 3) (Rodrigues' formula)."""
    angle = np.linalg.norm(vector, axis=-1)[..., None, None]
    zero = np.zeros(vector.shape[:-1])
    x, y, z = np.moveaxis(vector, -1, 0)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1).reshape(*vector.shape[:-1], 3, 3)
    # sin(a)/a and (1 - cos a)/a^2, both exact at 0 by numpy's sinc(t) = sin(pi t)/(pi t)
    first, second = np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    matrix: Array = np.eye(3) + first * skew + second * (skew @ skew)
    return matrix


def rotmat_to_rotvec(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to rotation vectors (..., 3) of at most half a turn."""
    quat = rotmat_to_quat(matrix)
    sin_half = np.linalg.norm(quat[..., :3], axis=-1, keepdims=True)
    half = np.arctan2(sin_half, quat[..., 3:])
    scale = np.where(sin_half > 1e-12, 2 * half / np.where(sin_half > 1e-12, sin_half, 1.0), 2.0)
    vector: Array = quat[..., :3] * scale
    return vector


def quat_to_rotmat(quat: Array) -> Array:
    """Unit quaternions (..., 4), scalar last, to matrices (..., 3, 3)."""
    x, y, z, w = np.moveaxis(quat, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def rotmat_to_quat(matrix: Array) -> Array:
    """Matrices (..., 3, 3) to unit quaternions (..., 4), scalar last and not negative.

    The largest of the four components is found first and divides the others, which keeps every rotation exact
    (Shepperd 1978).
    """
    trace = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None]
    transposed = np.swapaxes(matrix, -1, -2)
    # row n is 4 q_n q: the quaternion scaled by four times its n-th component
    scaled = np.empty((*matrix.shape[:-2], 4, 4))
    scaled[..., :3, :3] = matrix + transposed + (1 - trace) * np.eye(3)
    difference = matrix - transposed
    scaled[..., 3, :3] = scaled[..., :3, 3] = difference[..., [2, 0, 1], [1, 2, 0]]
    scaled[..., 3, 3] = 1 + trace[..., 0, 0]
    largest = np.argmax(np.diagonal(scaled, axis1=-2, axis2=-1), axis=-1)
    quat = np.take_along_axis(scaled, largest[..., None, None], axis=-2)[..., 0, :]
    quat /= np.linalg.norm(quat, axis=-1, keepdims=True)
    return np.where(quat[..., 3:] < 0, -quat, quat)
