"""Vectors and quaternions as tuples of their parts: (x, y, z) and (x, y, z, w), each a float or an array of one shape.

So formulas are written once, and run on one figure as Python's floats, many times as fast as numpy's arrays of one
number, and on many along the figures. Both give the same bits.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

Part = Any
"""A float or a float64 array."""

Vector = tuple[Part, Part, Part]
Quaternion = tuple[Part, Part, Part, Part]

NO_ROTATION: Quaternion = (0.0, 0.0, 0.0, 1.0)


def parts(values: NDArray[Any]) -> tuple[Part, ...]:
    """The parts of vectors (n, k): floats of one, arrays (n,) of more."""
    return tuple(values[0].tolist()) if len(values) == 1 else tuple(np.array(values.T, dtype=np.float64, order="C"))


def joined(values: Sequence[Part]) -> Array:
    """Vectors (n, k) of their parts."""
    return np.array(values).reshape(len(values), -1).T


def single(values: NDArray[Any]) -> Part:
    """Values (n,) as a part: of one what it is to Python."""
    return values.tolist()[0] if len(values) == 1 else values


def computed(function: np.ufunc, *values: Part) -> Part:
    """A function of numpy's, of floats a float, rounded as it is in arrays."""
    result = function(*values)
    return float(result) if isinstance(result, float) else result


def where(condition: Any, yes: Part, no: Part) -> Part:
    """``np.where``, and of floats the one or the other."""
    if isinstance(condition, bool):
        return yes if condition else no
    return np.where(condition, yes, no)


def larger(a: Part, b: Part) -> Part:
    """The larger of two."""
    return max(a, b) if isinstance(a, float) else np.maximum(a, b)


def smaller(a: Part, b: Part) -> Part:
    """The smaller of two."""
    return min(a, b) if isinstance(a, float) else np.minimum(a, b)


def clipped(value: Part, low: Part, high: Part) -> Part:
    """A value within limits."""
    return smaller(larger(value, low), high)


def wrapped(angle: Part) -> Part:
    """An angle in radians, between -pi and pi."""
    turns = angle / (2 * math.pi)
    return angle - 2 * math.pi * (round(turns) if isinstance(turns, float) else np.rint(turns))


def root(value: Part) -> Part:
    """The square root."""
    return math.sqrt(value) if isinstance(value, float) else np.sqrt(value)


def plus(a: Vector, b: Vector) -> Vector:
    """The sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vector, b: Vector) -> Vector:
    """The difference."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(a: Vector, by: Part) -> Vector:
    """A vector made longer."""
    return a[0] * by, a[1] * by, a[2] * by


def dot(a: Vector, b: Vector) -> Part:
    """The inner product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def length(a: Vector) -> Part:
    """How long a vector is."""
    return root(dot(a, a))


def cross(a: Vector, b: Vector) -> Vector:
    """The outer product."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


def unit(a: Vector) -> Vector:
    """A vector of length 1; one of no length stays."""
    return times(a, 1 / larger(length(a), 1e-12))


def product(left: Quaternion, right: Quaternion) -> Quaternion:
    """The right rotation first, then the left."""
    a, b, c, d = left
    x, y, z, w = right
    return (
        d * x + w * a + b * z - c * y,
        d * y + w * b + c * x - a * z,
        d * z + w * c + a * y - b * x,
        d * w - a * x - b * y - c * z,
    )


def rotated(quat: Quaternion, vector: Vector) -> Vector:
    """A vector rotated by a unit quaternion."""
    x, y, z, w = quat
    a, b, c = vector
    p = 2 * (y * c - z * b)
    q = 2 * (z * a - x * c)
    r = 2 * (x * b - y * a)
    return (
        a + w * p + y * r - z * q,
        b + w * q + z * p - x * r,
        c + w * r + x * q - y * p,
    )


def yawed(quat: Quaternion, sine: Part, cosine: Part) -> Quaternion:
    """The product of a turn about the vertical, of which these are of half the angle, and a rotation."""
    x, y, z, w = quat
    return (
        cosine * x + sine * z,
        cosine * y + sine * w,
        cosine * z - sine * x,
        cosine * w - sine * y,
    )


def rotated_axis(quat: Quaternion, axis: int) -> Vector:
    """A unit vector along x, y or z (0, 1 or 2), rotated by a unit quaternion."""
    i = quat[axis]
    j = quat[(axis + 1) % 3]
    k = quat[(axis + 2) % 3]
    w = quat[3]
    p = 2 * j
    q = 2 * k
    columns = 1 - j * p - k * q, i * p + w * q, i * q - w * p
    return columns[-axis], columns[1 - axis], columns[2 - axis]


def inverse(quat: Quaternion) -> Quaternion:
    """The inverse rotation."""
    x, y, z, w = quat
    return -x, -y, -z, w


def normalised(quat: Quaternion) -> Quaternion:
    """A quaternion of length 1."""
    x, y, z, w = quat
    by = 1 / larger(root(x * x + y * y + z * z + w * w), 1e-300)
    return x * by, y * by, z * by, w * by


def swing(start: Vector, end: Vector) -> Quaternion:
    """The shortest rotation from one direction to another; half a turn is about any axis, and none from or to 0."""
    # the half-way quaternion: w is 1 + cosine, and (x, y, z) the sine about the axis, both times the lengths
    both = root(dot(start, start) * dot(end, end))
    x, y, z = start
    cosine = both + dot(start, end)
    # half a turn has no axis of its own: any that is square to the start
    half = cosine < 1e-6 * both
    a, b, c = cross(start, end)
    if half is not False and np.any(half):
        tall = abs(x) > abs(z)
        a = where(half, where(tall, -y, 0.0), a)
        b = where(half, where(tall, x, -z), b)
        c = where(half, where(tall, 0.0, y), c)
        cosine = where(half, 0.0, cosine)
    return normalised((a, b, c, cosine + (both == 0)))
