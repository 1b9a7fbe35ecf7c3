"""Measures of generated and recorded motions: speed, energy, foot skate and stillness at the end; and features by which
two motions are compared without any model, for the floors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motet.figures.feet.contacts import feet_of, ground_of
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, from_root_block
from motet_train.evaluate import positions as places
from motet_train.evaluate.language.split_store import SplitStore
from motet_train.evaluate.tables import Figures


def measures(motions: Sequence[Motion], contract: MotionContract, quiet: float) -> Figures:
    """Means over motions of seconds, speed (m/s), energy, energy of the last second, and foot skate (m/s).

    frozen: the share whose last second has less energy than ``quiet``, see :func:`energy`. Speed and skate are left out
    if the motions have no root block or no skeleton.
    """
    # frames in standard deviations of the training motions
    frames = [contract.normalised(contract.frames(motion)) for motion in motions]
    end_energies = [last_energy(z, contract.fps) for z in frames]
    means = {
        "seconds": np.mean([motion.duration for motion in motions]),
        "energy": np.mean([energy(z, contract.fps) for z in frames]),
        "end_energy": np.mean(end_energies),
        "frozen": np.mean(np.array(end_energies) < quiet),
    }
    # what needs to know the path over the ground
    if moves(motions[0]):
        means["speed"] = np.mean([speed(motion) for motion in motions])
        slides = [slide for slide in map(skate, motions) if np.isfinite(slide)]
        means["skate"] = np.mean(slides) if slides else np.float64(np.nan)
    return {key: float(value) for key, value in means.items()}


def moves(motion: Motion) -> bool:
    """Whether a motion tells how its figure moves over the ground, by a root block and a skeleton with a unit."""
    skeleton = motion.skeleton
    has_unit = skeleton is not None and skeleton.metres_per_unit is not None
    return has_unit and set(ROOT_BLOCK) <= set(motion.channels)


def energy(z: Array, fps: float) -> float:
    """Motion energy of frames (T, D) in standard deviations: the mean square of their velocities, 1/s^2."""
    if len(z) < 2:
        return 0.0
    velocities = np.diff(z, axis=0) * fps
    return float((velocities**2).mean())


def last_energy(z: Array, fps: float) -> float:
    """:func:`energy` of the last second, or of all frames of a shorter motion."""
    return energy(z[-1 - round(fps) :], fps)


def quiet_energy(motions: Sequence[Motion], contract: MotionContract) -> float:
    """The 5th percentile of the energy of the last second: motions below it count as frozen."""
    ends = [last_energy(contract.normalised(contract.frames(motion)), contract.fps) for motion in motions]
    return np.percentile(ends, 5)


def speed(motion: Motion) -> float:
    """Mean speed over the ground, m/s, of a motion with the root block."""
    velocity = motion.select(ROOT_BLOCK[:2], ("m/s", "m/s")).values
    return float(np.hypot(*velocity[1:].T).mean()) if len(motion) > 1 else 0.0


def skate(motion: Motion) -> float:
    """How fast foot joints at most 5 cm above the ground slide, m/s, by the slowest of several. NaN if none ever is."""
    # feet in metres, above their own ground
    skeleton = skeleton_of(motion)
    feet = positions(from_root_block(motion))[:, feet_of(skeleton)] * skeleton.unit_factor(1.0)
    heights = feet[..., 1] - ground_of(feet[..., 1])
    return places.skate(feet, heights, 0.05, motion.fps, slowest=True)


@dataclass(frozen=True, eq=False)
class Looks:
    """Features of motions, relative to the training motions of a corpus."""

    corpus: SplitStore

    def features(self, motions: Sequence[Motion]) -> Array:
        """(N, F): mean and standard deviation over time of all :meth:`arrays` of motions, in standard deviations from
        the mean of the training motions; each array has the same weight in distances, however many features it has.
        """
        mean, scale = self._training
        return (self._statistics(motions) - mean) / scale

    def arrays(self, motion: Motion) -> tuple[Array, ...]:
        """The positions of joints relative to the root and its facing (T, 3 J) in metres; their speeds, relative to it
        (T, J), m/s; and the root's velocities forward, to the left, and of turning (T, 3). For a motion without a root
        block its channels (T, D) in standard deviations from the mean of the training motions."""
        if not moves(motion):
            contract = self.corpus.contract
            return (contract.normalised(contract.frames(motion)),)
        path = motion.select(ROOT_BLOCK[:3], ROOT_BLOCK_UNITS[:3]).values

        # the same poses in place, without the root's velocities
        in_place = motion.values.copy()
        in_place[:, [motion.channels.index(name) for name in ROOT_BLOCK[:3]]] = 0
        placed = positions(from_root_block(replace(motion, values=in_place)))
        joints = placed * skeleton_of(motion).unit_factor(1.0)
        speeds = places.length(np.diff(joints, axis=0, prepend=joints[:1])) * motion.fps
        return joints.reshape(len(joints), -1), speeds, path

    @cached_property
    def _training(self) -> tuple[Array, Array]:
        """Mean (F,) and scale (F,) of the features; differences below .001 do not count."""
        motions = self.corpus.motions(self.corpus.parts.train)
        statistics = self._statistics(motions)
        # an array of many features has as much weight as one of few
        sizes = [frames.shape[1] for frames in self.arrays(motions[0])]
        weights = np.repeat(1 / np.sqrt(sizes), [2 * size for size in sizes])
        deviations = np.maximum(statistics.std(axis=0), 1e-3)
        return statistics.mean(axis=0), deviations / weights

    def _statistics(self, motions: Sequence[Motion]) -> Array:
        """(N, F): for each array its means, then its standard deviations."""
        rows = []
        for motion in motions:
            parts: list[Array] = []
            for frames in self.arrays(motion):
                parts += [frames.mean(axis=0), frames.std(axis=0)]
            rows.append(np.concatenate(parts))
        return np.array(rows)
