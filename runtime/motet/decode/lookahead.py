"""Frames that do not tremble, and do not come late: the net runs a few frames ahead of those that are shown.

What is shown is the mean of the frames before it, itself and those to come, through a Gaussian window; the net's own
history is not touched. Where the control changes, the frames ahead are run again from the last one shown. The
difference between what would have been shown and what now is does not leap but fades, as a critically damped spring
comes to rest: inertialisation (Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War",
GDC 2018). So does what is faster than joints turn. While the control stays as it is, a tick runs the net once.

Letters in shapes: R frames of reach, B characters, D channels, K taps, H codes, L labels.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.springs import damped

WIDTH = 0.04  # s: the window's standard deviation
REACH = 2  # standard deviations that the window reaches to both sides
FADING = 20.0  # 1/s: how fast a difference fades, to a quarter in 0.13 s
FADED = 1e-3  # units of the channel: a smaller difference is none

Run = Callable[[Floats, int], tuple[Floats, Floats]]
"""From a history (B, K, H) and how many ticks from now it is, the next frame (B, D) and the next history."""


class Fade(NamedTuple):
    """What is left of a difference, and how fast it changes: (B, D) each, in units of the channel, and of them a
    second."""

    offset: Floats
    speed: Floats


class Ahead(NamedTuple):
    """Where a run is. Nothing in it is changed in place.

    frames: (2R + 1, B, D) of the net, those before, at and after the one that is shown. histories: (B, K, H) after that
        one and after each of those to come. control: (B, L) that those to come know. shown: what is shown, (B, D).
    """

    frames: Floats
    histories: tuple[Floats, ...]
    control: Floats
    shown: Floats
    fade: Fade


def begun(run: Run, history: Floats, past: Floats, control: Floats, fps: float) -> Ahead:
    """Before the first tick: from the history (B, K, H) after some frames (T, B, D), of which the last is not shown any
    more."""
    reach = reach_of(fps)
    before = past[np.maximum(np.arange(-reach - 1, 0), -len(past))]
    frames, histories = _run_on(run, before, (history,), reach)
    shown = _mean(frames, fps)
    return Ahead(frames, histories, control, shown, Fade(np.zeros_like(shown), np.zeros_like(shown)))


def ticked(now: Ahead, run: Run, control: Floats, fps: float, most: Floats) -> Ahead:
    """One tick later; ``run`` counts from the tick that is now. A channel changes by no more than ``most`` (D)."""
    reach, fade = reach_of(fps), _faded(now.fade, 1 / fps)
    if control is now.control or np.array_equal(control, now.control):
        frames, histories = _run_on(run, now.frames[1:], now.histories, 1)
    else:
        frames, histories = _run_on(run, now.frames[1 : reach + 1], now.histories[:1], reach + 1)
        # what is farthest ahead was not run before: it is taken to differ as what is before it does
        apart = now.frames[reach + 1 :] - frames[reach:-1]
        offset = _mean(np.concatenate([np.zeros_like(apart), apart, apart[-1:]]), fps)
        fade = Fade(fade.offset + offset, fade.speed)
    return _held_back(now.shown, Ahead(frames, histories[1:], control, _mean(frames, fps), fade), most)


def _held_back(before: Floats, after: Ahead, most: Floats) -> Ahead:
    """What is shown (B, D) after a frame: with what fades, and no faster than ``most`` (D); what is too fast fades.

    Each character by itself: it moves as it would alone, to the bit.
    """
    wanted = after.shown + after.fade.offset
    step = wanted - before
    fast = (np.abs(step) > most).any(axis=1, keepdims=True)
    shown = np.where(fast, before + np.clip(step, -most, most), wanted)
    offset = np.where(fast, shown - after.shown, after.fade.offset)
    return after._replace(shown=shown, fade=Fade(offset, after.fade.speed))


def reach_of(fps: float) -> int:
    """How many frames before and after the one that is shown have a part in it."""
    return max(1, round(REACH * WIDTH * fps))


def _run_on(run: Run, frames: Floats, histories: tuple[Floats, ...], count: int) -> tuple[Floats, tuple[Floats, ...]]:
    """With ``count`` more frames after the last of the histories, which is ``len(histories) - 1`` ticks from now."""
    found = []
    for _ in range(count):
        frame, history = run(histories[-1], len(histories) - 1)
        found.append(frame[None])
        histories = (*histories, history)
    return np.concatenate([frames, *found]), histories


def _mean(frames: Floats, fps: float) -> Floats:
    """The mean (B, D) of frames (2R + 1, B, D) by the window."""
    # not as a product of matrices, which rounds a character by how many there are
    mean: Floats = (_window(fps)[:, None, None] * frames).sum(axis=0)
    return mean


@cache
def _window(fps: float) -> Floats:
    reach = reach_of(fps)
    window = np.exp(-0.5 * (np.arange(-reach, reach + 1) / (WIDTH * fps)) ** 2)
    weights: Floats = (window / window.sum()).astype(np.float32)
    return weights


def _faded(fade: Fade, seconds: float) -> Fade:
    """A critically damped spring at rest at 0, so many seconds later (exact), for each character that is not there."""
    offset, speed = damped(fade.offset, fade.speed, FADING, seconds)
    moving = (np.maximum(np.abs(offset), np.abs(speed)) > FADED).any(axis=1, keepdims=True)
    return Fade(np.where(moving, offset, 0), np.where(moving, speed, 0))
