"""Motions at a higher frame rate without the kinks of linear interpolation."""

from dataclasses import replace

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.motion.rotations import Array


def smooth_resample(motion: Motion, fps: float) -> Motion:
    """The motion at a higher frame rate ``fps``, along Catmull-Rom splines through its frames.

    The splines pass through every frame and have no kink there; Euler angles are continuous first. Nothing is made up
    behind the last frame, so three times the frame rate gives 3 (T - 1) + 1 frames. MotionError for a lower frame rate.
    """
    if not fps >= motion.fps:
        raise MotionError(f"{motion.fps:g} fps cannot be smoothed to {fps:g} fps, which is less: use resample")
    if len(motion) < 2:
        return replace(motion, fps=fps)
    count = int((len(motion) - 1) * fps / motion.fps + 1e-9) + 1
    times: Array = np.arange(count, dtype=np.float64) * (motion.fps / fps)
    return replace(motion, values=_spline(motion.continuous().values, times), fps=fps)


def _spline(frames: Array, times: Array) -> Array:
    """Values (S, D) of the Catmull-Rom spline through frames (T, D) at times (S,) counted in frames."""
    # beyond each end the parabola through the three nearest frames goes on, or the line through two
    near, far = (np.array([3.0, -3.0, 1.0]), 3) if len(frames) > 2 else (np.array([2.0, -1.0]), 2)
    padded = np.concatenate([[near @ frames[:far]], frames, [near @ frames[: -far - 1 : -1]]])
    start = np.minimum(times.astype(np.intp), len(frames) - 2)
    s = (times - start)[:, None]
    a, b, c, d = (padded[start + n] for n in range(4))
    spline: Array = b + 0.5 * s * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))
    return spline
