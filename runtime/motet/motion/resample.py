"""Resampling: the times of the new frames, and linear or spline interpolation.

One rule applies: nothing is extrapolated past the last frame, so T frames become ``floor((T - 1) * new / old) + 1``.
Whole ratios pick every n-th frame; otherwise lower rates interpolate linearly, and higher ones by Catmull-Rom splines,
which pass smoothly through every frame.
"""

import numpy as np

from motet.motion.rotations import Array


def resampled(values: Array, ratio: float, to_end: bool = False) -> Array:
    """Values (T, ...) at every ``ratio``-th frame, from the first; the ratio need not be whole.

    to_end: keep the last frame instead of the first; the remainder is dropped at the start.
    """
    frames = len(values)
    count = int((frames - 1) / ratio + 1e-9) + 1 if frames else 0
    if abs(ratio - round(ratio)) < 1e-9 and ratio > 0.5:
        step = round(ratio)
        return values[(frames - 1) % step if to_end and frames else 0 :: step]
    times: Array = np.arange(count, dtype=np.float64) * ratio
    if to_end and frames:
        times = frames - 1 - times[::-1]
    return spline(values, times) if ratio < 1 else lines(values, times)


def lines(values: Array, times: Array) -> Array:
    """Values (S, ...) on the lines between the frames of ``values`` (T, ...), at times (S,) counted in frames."""
    if len(values) < 2:
        return np.repeat(values[:1], len(times), axis=0)
    start, part = _between(values, times)
    found: Array = values[start] + part * (values[start + 1] - values[start])
    return found


def spline(values: Array, times: Array) -> Array:
    """Like :func:`lines`, on Catmull-Rom splines."""
    if len(values) < 2:
        return np.repeat(values[:1], len(times), axis=0)
    # beyond each end, continue the parabola through the three nearest frames, or the line through two
    near, far = (np.array([3.0, -3.0, 1.0]), 3) if len(values) > 2 else (np.array([2.0, -1.0]), 2)
    ends = [np.tensordot(near, part, 1)[None] for part in (values[:far], values[: -far - 1 : -1])]
    padded = np.concatenate([ends[0], values, ends[1]])
    start, s = _between(values, times)
    a, b, c, d = (padded[start + n] for n in range(4))
    found: Array = b + 0.5 * s * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))
    return found


def _between(values: Array, times: Array) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], Array]:
    """For each time the frame before it, and the fraction of the way to the next one (S, 1, ...)."""
    # a time that equals a frame up to rounding is that frame
    start = np.minimum((times + 1e-9).astype(np.intp), len(values) - 2)
    return start, (times - start).reshape(-1, *[1] * (values.ndim - 1))
