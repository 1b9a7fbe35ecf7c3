"""Triangles drawn into pixels with numpy alone, the nearest on top: for pictures where there is no browser."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array

ROOM = 1 << 20
"""How many pixels of triangles are looked at in one go."""


def drawn(seen: Array, triangles: NDArray[np.intp], values: Array, shape: tuple[int, int]) -> tuple[Array, Array]:
    """What is seen in the pixels of a picture of ``shape`` (rows, columns): values (H, W, K) and depths (H, W).

    seen: corners (V, 3): column, row and depth; the middle of the first pixel is at .5. Triangles (F, 3) face the
    viewer if they are counterclockwise where rows go down the picture. values: (V, K), linear across a triangle. Where
    nothing is drawn the depth is infinite and the values are 0.
    """
    corners = seen[triangles]
    area = _across(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    nearest = np.full(shape[0] * shape[1], np.inf)
    found = np.zeros((len(nearest), values.shape[1]))
    for some, pixels, shares in _covered(corners, np.flatnonzero(area < 0), area, shape):
        depths = np.einsum("pk,pk->p", shares, corners[some, :, 2])
        np.minimum.at(nearest, pixels, depths)
        first = depths == nearest[pixels]
        found[pixels[first]] = np.einsum("pk,pkv->pv", shares[first], values[triangles[some[first]]])
    return found.reshape(*shape, -1), nearest.reshape(shape)


def _covered(
    corners: Array, facing: NDArray[np.intp], area: Array, shape: tuple[int, int]
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp], Array]]:
    """Pixels that triangles cover, some at a time: the triangles' indices (P,), the pixels' (P,), and how much of each
    corner is there (P, 3). Triangles of like size are looked at together."""
    low = np.floor(corners[facing, :, :2].min(axis=1) + 0.5).astype(int).clip(0, shape[::-1])
    high = np.floor(corners[facing, :, :2].max(axis=1) + 0.5).astype(int).clip(0, shape[::-1])
    sizes = (high - low).max(axis=1)
    kinds = np.ceil(np.log2(np.maximum(sizes, 1))).astype(int)
    for kind in np.unique(kinds[(high > low).all(axis=1)]):
        of_kind = np.flatnonzero((kinds == kind) & (high > low).all(axis=1))
        steps = np.stack(np.meshgrid(*[np.arange(1 << kind)] * 2), axis=-1).reshape(-1, 2)
        for part in np.array_split(of_kind, -(-len(of_kind) * len(steps) // ROOM)):
            pixels, some = low[part, None] + steps, facing[part]
            a, b, c = np.moveaxis(corners[some, None, :, :2] - (pixels[:, :, None] + 0.5), 2, 0)
            shares = np.stack([_across(b, c), _across(c, a), _across(a, b)], axis=-1) / area[some, None, None]
            inside = (shares >= 0).all(axis=-1) & (pixels < high[part, None]).all(axis=-1)
            triangle, place = np.nonzero(inside)
            x, y = pixels[triangle, place].T
            yield some[triangle], y * shape[1] + x, shares[inside]


def _across(a: Array, b: Array) -> Array:
    found: Array = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return found
