"""A control model under study: runs from any state, with all their codes, compared with the training motions.

Frames are compared in z units: each channel relative to its standard deviation in all training frames, without channels
that are constant there. Letters in shapes: T frames, B characters, D channels, K taps, H codes, L labels.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from motet.motion.motion import lines
from motet.motion.rotations import Array, Indices, Mask
from motet.papers.tdbn_control import TdbnModel, TdbnSession
from motet.representation.contract import LIVING_STD
from motet_train.evaluate.positions import arrival
from motet_train.papers.tdbn.clips import Sequences, period

Codes = NDArray[np.floating[Any]]

ARRIVED = 0.25
"""Largest distance in z of a pose on a loop: that of the frames of one recorded cycle of 39_14 from another (median
.25; 09_07 .30), and a fifth of the distance between the loops of walking and running."""


def upsample(frames: Array) -> Array:
    """Frames (T, D) with three linearly interpolated ones between each two."""
    return lines(frames, np.arange((len(frames) - 1) * 4 + 1) / 4)


@dataclass(frozen=True, eq=False)
class Reference:
    """The training motions with which a run is compared.

    motions: label -> sequences (T, D) at the model's frame rate. legs: indices of the leg channels.
    """

    motions: Sequences
    legs: Indices

    @property
    def clips(self) -> list[Array]:
        """The sequences of all labels."""
        return list(chain.from_iterable(self.motions.values()))

    @cached_property
    def std(self) -> Array:
        """Standard deviation (D,) over all training frames, infinite for constant channels."""
        std = np.concatenate(self.clips).std(axis=0)
        return np.where(std < LIVING_STD["deg"], np.inf, std)

    def z(self, frames: Array) -> Array:
        """The moving channels of frames (..., D) in z units; the mean is not subtracted."""
        moving = np.isfinite(self.std)
        return frames[..., moving] / self.std[moving]

    def leg_angles(self, frames: Array) -> Array:
        """The moving leg channels of frames (..., D)."""
        legs = np.intersect1d(self.legs, np.flatnonzero(np.isfinite(self.std)))
        return np.asarray(frames, dtype=np.float64)[..., legs]

    def distance(self, frames: Array, points: Array) -> Array:
        """RMS z (...) from frames (..., D) to the nearest of points (N, D); infinite for frames that are not finite."""
        from sklearn.metrics import pairwise_distances_argmin  # here, so that other trainings do not load scikit-learn

        z = self.z(frames)
        flat = z.reshape(-1, z.shape[-1])
        distance = np.full(len(flat), np.inf)
        finite = np.isfinite(flat).all(axis=1)
        if finite.any():
            targets = self.z(points)
            nearest = targets[pairwise_distances_argmin(flat[finite], targets)]
            distance[finite] = np.linalg.norm(flat[finite] - nearest, axis=1) / np.sqrt(flat.shape[1])
        return distance.reshape(z.shape[:-1])

    def jumps(self, frames: Array) -> Array:
        """RMS z change (T-1, ...) from each of frames (T, ..., D) to the next."""
        return np.asarray(np.sqrt((np.diff(self.z(frames), axis=0) ** 2).mean(axis=-1)))

    @cached_property
    def largest_jump(self) -> float:
        """The largest change from frame to frame in the training motions."""
        return max(float(self.jumps(clip).max()) for clip in self.clips)

    def period(self, label: str) -> float:
        """The period of a training motion in frames, the mean over its sequences."""
        return float(np.mean([period(self.leg_angles(clip)) for clip in self.motions[label]]))

    def energy_ratio(self, frames: Array, label: str) -> float:
        """Leg energy of frames (T, D) relative to a training motion: the mean squared change of the leg angles."""
        training = [self._leg_energy(clip) for clip in self.motions[label]]
        return self._leg_energy(frames) / float(np.mean(training))

    def _leg_energy(self, frames: Array) -> float:
        return float((np.diff(self.leg_angles(frames), axis=0) ** 2).mean())


class Recording(NamedTuple):
    """A run with all its codes: frames (T, B, D), codes (T, B, H)."""

    frames: Array
    codes: Codes

    def histories(self, times: Iterable[int], taps: int, row: int = 0) -> Codes:
        """The histories (N, K, H) just after some frames of one character."""
        return np.stack([self.codes[time - taps + 1 : time + 1, row] for time in times])


class Leg(NamedTuple):
    """Indices of a leg's channels, and of its codes."""

    channels: Indices
    codes: Indices


@dataclass(frozen=True, eq=False)
class ControlStudy:
    """A control model with its training motions, and the loops that several experiments need.

    walk, run: the labels of two periodic motions; run is "" if there is only one. bend: the label of a motion that
    ends, or "". legs: the left and the right one, if the skeleton has legs.
    """

    model: TdbnModel
    reference: Reference
    walk: str
    run: str
    bend: str
    legs: Sequence[Leg]

    @property
    def fps(self) -> float:
        """Frames per second."""
        return self.model.fps

    def frames(self, seconds: float) -> int:
        """A number of frames."""
        return round(seconds * self.fps)

    def control(self, **weights: ArrayLike) -> Array:
        """Control values (..., L) by role: walk, run, bend."""
        values = np.broadcast_arrays(*weights.values())
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
        frames = []
        codes = []
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

    def training_history(self, role: str, frame: int = 0) -> Codes:
        """The history (1, K, H) of a training motion's frames from the given one on."""
        clip = self.reference.motions[getattr(self, role)][0]
        return self.model.encode(clip[frame : frame + self.model.taps])[None]

    def loop(self, role: str) -> Recording:
        """A noiseless run of 3 s, a few cycles, on a gait's loop, which a free run has reached after 10 s."""
        if role not in self._loops:
            whole = self.hold(self.training_history(role), role, 13.0)
            start = self.frames(10.0)
            self._loops[role] = Recording(whole.frames[start:], whole.codes[start:])
        return self._loops[role]

    @cached_property
    def _loops(self) -> dict[str, Recording]:
        return {}

    def loop_frames(self, role: str) -> Array:
        """The frames (T, D) of a gait's loop."""
        return self.loop(role).frames[:, 0]

    def loop_points(self, role: str) -> Array:
        """A gait's loop as points (N, D), upsampled."""
        return upsample(self.loop_frames(role))

    def cycle(self, role: str) -> float:
        """The period in frames of a gait's loop, or a second if it has none, so that experiments still run."""
        cycle = period(self.reference.z(self.loop_frames(role)))
        return cycle if np.isfinite(cycle) else self.fps

    def phases(self, role: str, count: int) -> tuple[Codes, Array]:
        """Histories (count, K, H) at equal phases of a gait's loop, and the frames (count, D) they ended with."""
        taps = self.model.taps
        loop = self.loop(role)
        times = [int(taps + round(i * self.cycle(role) / count)) for i in range(count)]
        return loop.histories(times, taps), loop.frames[times, 0]

    def reaches(self, frames: Array, role: str) -> Array:
        """Seconds (B,) until frames (T, B, D) are on a gait's loop and stay there."""
        return arrival(self.reference.distance(frames, self.loop_points(role)) < ARRIVED, self.fps)

    def nearer_to_run(self, frames: Array) -> Mask:
        """Whether each of frames (..., D) is nearer to the running loop than to the walking one."""
        to_walk = self.reference.distance(frames, self.loop_points("walk"))
        to_run = self.reference.distance(frames, self.loop_points("run"))
        return to_run < to_walk
