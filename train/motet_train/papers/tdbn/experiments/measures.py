"""The measures behind the control experiments: distances, loops, periods, energies.

A frame is compared in z units: each channel over its standard deviation in all training frames, channels that are
constant there left out. Letters in shapes: T frames, B characters, D channels.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.motion.motion import lines
from motet.motion.rotations import Array
from motet.representation.contract import LIVING_STD
from motet_train.papers.tdbn.period import period

ARRIVED = 0.25
"""z: a pose nearer to a loop than this is on it. As near as the frames of one recorded cycle of 39_14 are to another of
its cycles (median .25; 09_07 .30), and a fifth of the distance between the loops of walking and running."""

UPSAMPLE = 4


@dataclass(frozen=True, eq=False)
class Reference:
    """The training motions that a run is measured against.

    motions: label -> sequences (T, D) at the model's frame rate.
    legs: indices of the leg channels.
    """

    motions: Mapping[str, Sequence[Array]]
    fps: float
    legs: NDArray[np.intp]

    @cached_property
    def std(self) -> Array:
        """Standard deviation (D,) over all training frames, infinite where a channel is constant."""
        std = np.concatenate([clip for clips in self.motions.values() for clip in clips]).std(axis=0)
        return np.where(std < LIVING_STD["deg"], np.inf, std)

    @cached_property
    def moving(self) -> NDArray[np.intp]:
        """Indices of the channels that are not constant."""
        return np.flatnonzero(np.isfinite(self.std))

    def z(self, frames: Array) -> Array:
        """Frames (..., D) in z units, without a mean, of the channels that move."""
        return np.asarray(frames, dtype=np.float64)[..., self.moving] / self.std[self.moving]

    def leg_angles(self, frames: Array) -> Array:
        """The leg channels that move, of frames (..., D)."""
        return np.asarray(frames, dtype=np.float64)[..., np.intersect1d(self.legs, self.moving)]

    def distance(self, frames: Array, points: Array) -> Array:
        """RMS z (...) from frames (..., D) to the nearest of points (N, D); infinite for frames that are not finite."""
        from sklearn.metrics import pairwise_distances_argmin  # for this alone, so that other trainings do not load it

        z = self.z(frames)
        flat = z.reshape(-1, z.shape[-1])
        finite = np.isfinite(flat).all(axis=1)
        distance = np.full(len(flat), np.inf)
        near = self.z(points)[pairwise_distances_argmin(flat[finite], self.z(points))] if finite.any() else flat[finite]
        distance[finite] = np.linalg.norm(flat[finite] - near, axis=1) / np.sqrt(flat.shape[1])
        return distance.reshape(z.shape[:-1])

    def jumps(self, frames: Array) -> Array:
        """RMS z change (T-1, ...) from each of frames (T, ..., D) to the next."""
        change: Array = np.sqrt((np.diff(self.z(frames), axis=0) ** 2).mean(axis=-1))
        return change

    @cached_property
    def largest_jump(self) -> float:
        """The largest change from frame to frame in the training motions."""
        return max(float(self.jumps(clip).max()) for clips in self.motions.values() for clip in clips)

    def period(self, label: str) -> float:
        """The period of a training motion in frames, the mean over its sequences."""
        return float(np.mean([period(self.leg_angles(clip)) for clip in self.motions[label]]))

    def energy_ratio(self, frames: Array, label: str) -> float:
        """Leg energy of frames (T, D) over that of a training motion: mean squared change of the leg angles."""
        data = np.mean([_energy(self.leg_angles(clip)) for clip in self.motions[label]])
        return _energy(self.leg_angles(frames)) / float(data)


def _energy(angles: Array) -> float:
    return float((np.diff(angles, axis=0) ** 2).mean())


def upsample(frames: Array, factor: int = UPSAMPLE) -> Array:
    """Frames (T, D) with factor - 1 linear ones between each two."""
    return lines(frames, np.arange((len(frames) - 1) * factor + 1) / factor)
