"""A control model under study: runs from any state, with all their codes, beside the training motions.

Letters in shapes: T frames, B characters, D channels, K taps, H codes, L labels.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.models.tdbn_control import TdbnModel, TdbnSession
from motet.motion.rotations import Array
from motet_train.evaluate.positions import arrival
from motet_train.papers.tdbn.experiments.measures import ARRIVED, Reference, upsample
from motet_train.papers.tdbn.period import period

Codes = NDArray[np.floating[Any]]

SETTLE_S, LOOP_S = 10.0, 3.0
"""A free run is on its loop after this many seconds; so much of the loop is kept, a few cycles."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A run with all its codes: frames (T, B, D), codes (T, B, H)."""

    frames: Array
    codes: Codes

    def histories(self, times: ArrayLike, taps: int, row: int = 0) -> Codes:
        """The histories (N, K, H) just after given frames of one character."""
        return np.stack([self.codes[time - taps + 1 : time + 1, row] for time in np.asarray(times, dtype=int)])


@dataclass(frozen=True, eq=False)
class Leg:
    """Indices of a leg's channels, and of its codes."""

    channels: NDArray[np.intp]
    codes: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class ControlStudy:
    """A control model beside its training motions, with the loops that several experiments need.

    walk, run: the labels of two periodic motions, run None where there is one; bend: of one that ends, or None.
    legs: the left and the right one, where the skeleton has legs.
    """

    model: TdbnModel
    reference: Reference
    walk: str
    run: str | None
    bend: str | None
    legs: tuple[Leg, Leg] | None

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.model.fps

    def frames(self, seconds: float) -> int:
        """A number of frames."""
        return round(seconds * self.fps)

    def control(self, **weights: ArrayLike) -> Array:
        """Control values (..., L) by role: walk, run, bend."""
        values = np.broadcast_arrays(*(np.asarray(value, dtype=np.float64) for value in weights.values()))
        track = np.zeros((*values[0].shape, len(self.model.labels)))
        for role, value in zip(weights, values, strict=True):
            track[..., self.model.labels.index(getattr(self, role))] = value
        return track

    def start(self, history: Codes, **options: Any) -> TdbnSession:
        """A session whose characters have the given histories (B, K, H)."""
        session = self.model.start(characters=len(history), smooth=False, **options)
        session.restore(replace(session.snapshot(), history=history.astype(np.float32)))
        return session

    def play(self, session: TdbnSession, track: Array, force: Callable[[int, Codes], None] | None = None) -> Recording:
        """Run a control track (T, L) or (T, B, L); ``force(t, codes)`` may overwrite a tick's codes (B, H) in place."""
        frames, codes = [], []
        for time, control in enumerate(track):
            session.set_control(control)
            frames.append(session.step())
            now = session.snapshot()
            if force is not None:
                force(time, now.history[:, -1])
                session.restore(now)
            codes.append(now.history[:, -1])
        return Recording(np.stack(frames).astype(np.float64), np.stack(codes))

    def hold(self, history: Codes, role: str, seconds: float, **options: Any) -> Recording:
        """Run from histories under one label."""
        track = np.repeat(self.control(**{role: 1.0})[None], self.frames(seconds), axis=0)
        return self.play(self.start(history, **options), track)

    def settle(self, session: TdbnSession, control: Array, seconds: float) -> None:
        """Run under constant control values (B, L), of which nothing is recorded."""
        session.set_control(control)
        for _ in range(self.frames(seconds)):
            session.step()

    def training_history(self, role: str, frame: int = 0) -> Codes:
        """The history (1, K, H) of a training motion's frames from the given one on."""
        clip = self.reference.motions[getattr(self, role)][0]
        return self.model.encode(clip[frame : frame + self.model.taps])[None]

    def loop(self, role: str) -> Recording:
        """A noiseless run on a gait's loop."""
        if role not in self._loops:
            whole = self.hold(self.training_history(role), role, SETTLE_S + LOOP_S)
            start = self.frames(SETTLE_S)
            self._loops[role] = Recording(whole.frames[start:], whole.codes[start:])
        return self._loops[role]

    @cached_property
    def _loops(self) -> dict[str, Recording]:
        return {}

    def loop_points(self, role: str) -> Array:
        """A gait's loop as points (N, D), upsampled."""
        return upsample(self.loop(role).frames[:, 0])

    def cycle(self, role: str) -> float:
        """The period in frames of a gait's loop; one second where it has none, so that experiments still run."""
        cycle = period(self.reference.z(self.loop(role).frames[:, 0]))
        return cycle if np.isfinite(cycle) else self.fps

    def phases(self, role: str, count: int) -> tuple[Codes, Array]:
        """Histories (count, K, H) at equal phases of a gait's loop, and the frames (count, D) they ended with."""
        taps = self.model.taps
        times = [int(taps + round(i * self.cycle(role) / count)) for i in range(count)]
        loop = self.loop(role)
        return loop.histories(times, taps), loop.frames[times, 0]

    def reaches(self, frames: Array, role: str) -> Array:
        """Seconds (B,) until frames (T, B, D) are on a gait's loop and stay there."""
        return arrival(self.reference.distance(frames, self.loop_points(role)) < ARRIVED, self.fps)
