"""Motions in numbers, generated or recorded alike: speed, energy, foot skate, stillness at the end; and how alike two
motions look without any model, for the floors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motet.motion.feet.contacts import feet_of, ground_of
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS, from_root_block
from motet_train.evaluate import positions as places
from motet_train.evaluate.language.split_store import SplitStore


def measures(motions: Sequence[Motion], contract: MotionContract, quiet: float) -> dict[str, float]:
    """Means over motions of seconds, speed (m/s), energy, energy of the last second, and foot skate (m/s).

    frozen: the share whose last second has less energy than ``quiet``. Energies are those of :func:`energy`.
    What the channels do not tell, or without a skeleton, is left out.
    """
    z = [contract.normalised(contract.frames(motion)) for motion in motions]
    ends = [last_energy(frames, contract.fps) for frames in z]
    found = {
        "seconds": np.mean([motion.duration for motion in motions]),
        "energy": np.mean([energy(frames, contract.fps) for frames in z]),
        "end_energy": np.mean(ends),
        "frozen": np.mean(np.array(ends) < quiet),
    }
    if moves(motions[0]):
        found["speed"] = np.mean([speed(motion) for motion in motions])
        slides = [slide for slide in map(skate, motions) if np.isfinite(slide)]
        found["skate"] = np.mean(slides) if slides else np.float64(np.nan)
    return {key: float(value) for key, value in found.items()}


def moves(motion: Motion) -> bool:
    """Whether a motion says how its figure moves over the ground: it has the root block and a skeleton with a unit."""
    skeleton = motion.skeleton
    return set(ROOT_BLOCK) <= set(motion.channels) and skeleton is not None and skeleton.metres_per_unit is not None


def energy(z: Array, fps: float) -> float:
    """Motion energy of frames (T, D) in standard deviations: the mean square of their velocities, 1/s^2."""
    return float(((np.diff(z, axis=0) * fps) ** 2).mean()) if len(z) > 1 else 0.0


def last_energy(z: Array, fps: float) -> float:
    """:func:`energy` of the last second, or of all where there is less."""
    return energy(z[-1 - round(fps) :], fps)


def quiet_energy(motions: Sequence[Motion], contract: MotionContract) -> float:
    """The energy of the last second below which one motion in twenty is: it counts as frozen."""
    ends = [last_energy(contract.normalised(contract.frames(motion)), contract.fps) for motion in motions]
    return float(np.percentile(ends, 5))


def speed(motion: Motion) -> float:
    """Mean speed over the ground, m/s, of a motion with the root block."""
    velocity = motion.select(ROOT_BLOCK[:2], ("m/s", "m/s")).values
    return float(np.hypot(*velocity[1:].T).mean()) if len(motion) > 1 else 0.0


def skate(motion: Motion) -> float:
    """How fast the joints of feet slide, m/s, while they are no higher than 5 cm above the ground: of several the
    slowest. NaN where none ever is."""
    skeleton = skeleton_of(motion)
    feet = positions(from_root_block(motion))[:, feet_of(skeleton)] * skeleton.unit_factor(1.0)
    return places.skate(feet, feet[..., 1] - ground_of(feet[..., 1]), 0.05, motion.fps, slowest=True)


@dataclass(frozen=True, eq=False)
class Looks:
    """The features of motions, seen from the training motions of a corpus."""

    corpus: SplitStore

    def features(self, motions: Sequence[Motion]) -> Array:
        """(N, F): mean and standard deviation over time of what is :meth:`seen` of motions, in standard deviations from
        the mean of the training motions; each array of it weighs the same in distances, however many features it has.
        """
        mean, scale = self._training
        return (self._statistics(motions) - mean) / scale

    def seen(self, motion: Motion) -> tuple[Array, ...]:
        """The joints' places seen from where the root is and faces (T, 3 J) in metres; their speeds, as seen from there
        (T, J), m/s; and how the root goes forward and left and turns (T, 3). Of a motion that does not tell this, its
        channels (T, D) in standard deviations from the mean of the training motions."""
        if not moves(motion):
            contract = self.corpus.contract
            return (contract.normalised(contract.frames(motion)),)
        path = motion.select(ROOT_BLOCK[:3], ROOT_BLOCK_UNITS[:3]).values
        on_the_spot = motion.values.copy()
        on_the_spot[:, [motion.channels.index(name) for name in ROOT_BLOCK[:3]]] = 0
        placed = positions(from_root_block(replace(motion, values=on_the_spot)))
        joints = placed * skeleton_of(motion).unit_factor(1.0)
        speeds = places.length(np.diff(joints, axis=0, prepend=joints[:1])) * motion.fps
        return joints.reshape(len(joints), -1), speeds, path

    @cached_property
    def _training(self) -> tuple[Array, Array]:
        """Mean (F,), and by what features are divided (F,): at least by .001, what differs by less is the same."""
        motions = self.corpus.motions(self.corpus.parts.train)
        found = self._statistics(motions)
        sizes = [frames.shape[1] for frames in self.seen(motions[0])]
        weights = np.repeat(1 / np.sqrt(sizes), [2 * size for size in sizes])
        return found.mean(axis=0), np.maximum(found.std(axis=0), 1e-3) / weights

    def _statistics(self, motions: Sequence[Motion]) -> Array:
        """(N, F): for each array its means, then its standard deviations."""
        rows = [[np.r_[frames.mean(axis=0), frames.std(axis=0)] for frames in self.seen(motion)] for motion in motions]
        return np.array([np.concatenate(row) for row in rows])
