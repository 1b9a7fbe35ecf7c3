"""Gaps of a motion: their frames, and resampling what fills them to the motion's own frame rate."""

import logging
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.motion.resample import spline
from motet.motion.rotations import Array

log = logging.getLogger(__name__)

Gap = tuple[float, float]
"""Times in seconds of the first missing frame and of the first frame after the gap."""

Span = tuple[int, int]
"""The same as frame numbers."""


def spans_of(motion: Motion, gaps: Sequence[Gap], longest: float) -> list[Span]:
    """The frames of gaps of at most ``longest`` seconds, in the order of time; MotionError as
    :meth:`motet.models.fill.FillModel.fill`."""
    if not isinstance(gaps, Sequence):
        raise MotionError(f"gaps are a list of (start, stop) in seconds, not {gaps!r}")
    if not gaps:
        raise MotionError("there is no gap to fill: give one, in seconds, such as (1.0, 2.0)")
    for gap in gaps:
        _check(motion, gap, longest)
    ordered = sorted(gaps)
    for (start, stop), (then, end) in pairwise(ordered):
        if round(then * motion.fps) <= round(stop * motion.fps):
            both = f"{_text(start, stop)} and {_text(then, end)}"
            raise MotionError(f"the gaps {both} overlap or touch: merge them, or leave motion between them")
    return [(round(start * motion.fps), round(stop * motion.fps)) for start, stop in ordered]


def _check(motion: Motion, gap: Gap, longest: float) -> None:
    try:
        start, stop = map(float, gap)
    except (TypeError, ValueError) as error:
        raise MotionError(f"a gap is two numbers in seconds, such as (1.0, 2.0), not {gap!r}") from error
    text, whole = f"the gap {_text(start, stop)} s", f"the motion of {motion.duration:g} s"
    if not (np.isfinite([start, stop]).all() and start < stop):
        raise MotionError(f"{text} is empty: it must start before it stops")
    if start < 0 or stop > motion.duration + 0.5 / motion.fps:
        raise MotionError(f"{text} is not within {whole}")
    if round(start * motion.fps) == round(stop * motion.fps):
        raise MotionError(f"{text} has no frame at {motion.fps:g} fps: make it longer")
    if round(start * motion.fps) == 0:
        raise MotionError(f"{text} is at the very start of {whole}: a gap needs frames before it")
    if round(stop * motion.fps) >= len(motion):
        raise MotionError(
            f"{text} is at the very end of {whole}: a gap needs frames after it (motet predict continues)"
        )
    if stop - start > longest + 1e-9:
        raise MotionError(f"{text} is too long: at most {longest:g} s can be filled")


def _text(start: float, stop: float) -> str:
    return f"{start:g}:{stop:g}"


def at_own_rate(past: Array, filled: Array, after: Array, count: int) -> Array:
    """Frames (count + 2, E) at even times from the last of ``past`` (P, E) to the first of ``after`` (A, E), both
    included, through those that fill the gap between them (N, E), on splines."""
    knots = np.concatenate([past[-2:], filled, after[:2]])
    times = len(past[-2:]) - 1 + np.arange(count + 2) / (count + 1) * (len(filled) + 1)
    return spline(knots, times)


def log_elsewhere() -> None:
    """Log that a motion does not keep its own skeleton."""
    log.warning(
        "the result uses the model's skeleton and frame rate: the file has no skeleton, a different world, or no "
        "channels for the position and rotation of the hips"
    )
