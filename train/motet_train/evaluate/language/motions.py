"""Measures of motions, generated or recorded alike: speed, motion energy, foot skate, stillness at the end."""

from collections.abc import Sequence

import numpy as np

from motet.motion.feet.contacts import ContactSettings, feet_of, ground_of, ground_speeds, standing
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, from_root_block

LOW_FEET_STAND = ContactSettings(heights=(0.05, 0.05))
"""Joints of feet, by their heights alone."""


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
    """How fast feet on the ground slide, m/s: the mean over all steps from one frame to the next.

    A joint of a foot counts that stands before and after the step; of several the slowest does,
    since the others roll. NaN where none ever is.
    """
    skeleton = skeleton_of(motion)
    feet = positions(from_root_block(motion))[:, feet_of(skeleton)] * skeleton.unit_factor(1.0)
    low = standing(feet[..., 1] - ground_of(feet[..., 1]), None, LOW_FEET_STAND)
    slides = ground_speeds(feet, motion.fps)
    slides[~(low[1:] & low[:-1])] = np.inf
    slowest = slides.min(axis=1)
    stands = np.isfinite(slowest)
    return float(slowest[stands].mean()) if stands.any() else np.nan
