"""Periods: how long a rhythmic motion takes to come back to its poses, and which motions do."""

from collections.abc import Sequence

import numpy as np

from motet.motion.rotations import Array


def period(frames: Array) -> float:
    """The period of frames (T, D), in frames; NaN where there is none.

    The first peak of the autocorrelation that reaches 0.9 of its largest peak, by a parabola through three points.
    """
    signal = frames - frames.mean(axis=0)
    lags = min(len(signal) - 8, 200)
    curve = np.array([(signal[lag:] * signal[: len(signal) - lag]).sum() / (len(signal) - lag) for lag in range(lags)])
    peaks = np.flatnonzero((curve[1:-1] > curve[:-2]) & (curve[1:-1] >= curve[2:]) & (curve[1:-1] > 0)) + 1
    if not len(peaks) or signal.std() < 1e-6:
        return float("nan")
    peak = int(peaks[np.argmax(curve[peaks] > 0.9 * curve[peaks].max())])
    left, middle, right = curve[peak - 1 : peak + 2]
    return float(peak + 0.5 * (left - right) / (left - 2 * middle + right))


def is_periodic(sequences: Sequence[Array]) -> bool:
    """Whether all sequences (T, D) of a motion come back to their poses, as walking does and bending over does not."""
    return all(bool(np.isfinite(period(frames))) for frames in sequences)
