"""Smooth frames without delay: the net runs a few frames ahead of those shown.

What is shown is the mean of the frames before it, itself and those to come, through a Gaussian window; the net's own
history is not touched. Where the control changes, the frames ahead are run again from the last one shown. The
difference between what would have been shown and what now is does not leap but fades, as a critically damped spring
comes to rest: inertialisation (Bollo, "Inertialization: High-Performance Animation Transitions in Gears of War",
GDC 2018). So does what is faster than joints turn. While the control stays as it is, a tick runs the net once.

Letters in shapes: R frames of reach, B characters, D channels, K taps, H codes, L labels.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.springs import damped
from motet.settings import Range, Settings


@dataclass(frozen=True)
class LookaheadSettings(Settings):
    """width: the window's standard deviation. reach: how many of them it reaches to both sides. fading: the damping of
    a difference, which comes down to a quarter in 0.13 s. faded: a smaller difference, in units of the channel, counts
    for none. fastest: no angle changes faster; a little less than the fastest in recorded walking and running that does
    not tremble, a foot's 1.9, as the three angles of a joint add up.
    """

    FEATURE: ClassVar[str] = "lookahead"

    width: Annotated[float, Range(0.001, 1, "s")] = 0.04
    reach: Annotated[float, Range(0.5, 10)] = 2.0
    fading: Annotated[float, Range(0.1, 1000, "1/s")] = 20.0
    faded: Annotated[float, Range(0, 1)] = 1e-3
    fastest: Annotated[float, Range(0.1, 100, "turns/s")] = 1.8


Run = Callable[[Floats, int], tuple[Floats, Floats]]
"""From a history (B, K, H) and how many ticks from now it is, the next frame (B, D) and the next history."""


class Ahead(NamedTuple):
    """Where a run is. Nothing in it is changed in place.

    frames: (2R + 1, B, D) of the net, those before, at and after the one that is shown. histories: (B, K, H) after that
        one and after each of those to come. control: (B, L) that those to come know. shown: what is shown, (B, D).
    offset, speed: what is left of a difference, and how fast it changes a second: (B, D), in units of the channel.
    """

    frames: Floats
    histories: tuple[Floats, ...]
    control: Floats
    shown: Floats
    offset: Floats
    speed: Floats


class Lookahead:
    """What is shown of a net's run at ``fps``. whole_turn: (D,) a turn in the units of each channel, infinite for
    channels that are no angles."""

    def __init__(self, settings: LookaheadSettings, fps: float, whole_turn: Floats) -> None:
        self.settings = settings
        self.seconds = 1 / fps
        self.most: Floats = whole_turn * np.float32(settings.fastest / fps)
        self.reach = max(1, round(settings.reach * settings.width * fps))
        window = np.exp(-0.5 * (np.arange(-self.reach, self.reach + 1) / (settings.width * fps)) ** 2)
        self.window: Floats = (window / window.sum()).astype(np.float32)[:, None, None]

    def begun(self, run: Run, history: Floats, past: Floats, control: Floats) -> Ahead:
        """Before the first tick: from the history (B, K, H) after some frames (T, B, D), of which the last is not shown
        any more."""
        before = past[np.maximum(np.arange(-self.reach - 1, 0), -len(past))]
        frames, histories = _run_on(run, before, (history,), self.reach)
        shown = self._mean(frames)
        return Ahead(frames, histories, control, shown, np.zeros_like(shown), np.zeros_like(shown))

    def ticked(self, now: Ahead, run: Run, control: Floats) -> Ahead:
        """One tick later; ``run`` counts from now. Each character moves as it would alone, to the bit."""
        reach = self.reach
        offset, speed = self._faded(now)

        # the frames to come: one more, or all of them anew under another control
        if control is now.control or np.array_equal(control, now.control):
            frames, histories = _run_on(run, now.frames[1:], now.histories, 1)
        else:
            frames, histories = _run_on(run, now.frames[1 : reach + 1], now.histories[:1], reach + 1)
            # what is farthest ahead was not run before: it is taken to differ as what is before it does
            apart = now.frames[reach + 1 :] - frames[reach:-1]
            offset = offset + self._mean(np.concatenate([np.zeros_like(apart), apart, apart[-1:]]))

        # what is shown: their mean with what is left of a difference, no faster than a figure turns
        mean = self._mean(frames)
        target = mean + offset
        step = target - now.shown
        is_too_fast = (np.abs(step) > self.most).any(axis=1, keepdims=True)
        limited = now.shown + np.clip(step, -self.most, self.most)
        shown = np.where(is_too_fast, limited, target)
        offset = np.where(is_too_fast, shown - mean, offset)
        return Ahead(frames, histories[1:], control, shown, offset, speed)

    def _faded(self, now: Ahead) -> tuple[Floats, Floats]:
        """What is left of a difference one tick later, and its speed: nothing once all of a figure is small."""
        offset, speed = damped(now.offset, now.speed, self.settings.fading, self.seconds)
        largest = np.maximum(np.abs(offset), np.abs(speed))
        is_moving = (largest > self.settings.faded).any(axis=1, keepdims=True)
        return np.where(is_moving, offset, 0), np.where(is_moving, speed, 0)

    def _mean(self, frames: Floats) -> Floats:
        """The mean (B, D) of frames (2R + 1, B, D) by the window."""
        # not as a product of matrices, which rounds a character by how many there are
        mean: Floats = (self.window * frames).sum(axis=0)
        return mean


def _run_on(run: Run, frames: Floats, histories: tuple[Floats, ...], count: int) -> tuple[Floats, tuple[Floats, ...]]:
    """With ``count`` more frames after the last of the histories, which is ``len(histories) - 1`` ticks from now."""
    later = []
    for _ in range(count):
        frame, history = run(histories[-1], len(histories) - 1)
        later.append(frame[None])
        histories = (*histories, history)
    return np.concatenate([frames, *later]), histories
