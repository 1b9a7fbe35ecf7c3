"""How the motions of a corpus become sequences to train on: which representation, frame rate, and part of a motion."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.figures.feet.contacts import ADULT_HEIGHT
from motet.figures.floor import above_floor
from motet.figures.humanoid import on_humanoid
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array

SHORTEST = 0.5
"""Seconds: less shows no action, and gives less than five frames at 10 fps."""


@dataclass(frozen=True)
class Preparation:
    """representation: its name. humanoid: retarget every figure to the humanoid, instead of keeping one figure.

    trim: cut off idle frames and T-poses at both ends (:func:`trim`). floor: nothing is under the floor
    (:func:`motet.figures.floor.above_floor`). fps: of the frames.
    longest: seconds from which on a motion is cut into pieces where ``cut`` is set, and else refused
    (Plappert et al. 2017, section 5.1).
    """

    representation: str
    humanoid: bool
    trim: bool
    cut: bool
    floor: bool = False
    fps: float = 10.0
    longest: float = 30.0

    def pieces(self, motion: Motion) -> list[Motion]:
        """The motion to train on, in equal pieces shorter than ``longest``; MotionError where it is unfit."""
        motion = _brought(motion, self.humanoid, self.trim, self.floor)
        if motion.duration < SHORTEST or not (self.cut or motion.duration < self.longest):
            limits = f"at least {SHORTEST:g} s" + ("" if self.cut else f" and less than {self.longest:g} s")
            raise MotionError(f"{motion.duration:.3g} s ({len(motion)} frames): a training motion has {limits}")
        count = math.floor(motion.duration / self.longest) + 1
        bounds = np.linspace(0, len(motion), count + 1).round().astype(int).tolist()
        return [motion[start:stop] for start, stop in pairwise(bounds)]


@lru_cache(maxsize=1)  # the parts of a store retarget each motion once
def _brought(motion: Motion, humanoid: bool, trimmed: bool, floor: bool) -> Motion:
    motion = on_humanoid(motion) if humanoid else motion
    motion = above_floor(motion) if floor else motion
    return trim(motion) if trimmed else motion


def repeated(features: Motion, seconds: float = 3.5) -> Motion:
    """Features (T, D) of one period, whose last frame is the first again, as often as fills so many seconds. Their root
    channels are changes, so its path goes on."""
    period = features.values[1:]
    more = max(0, math.ceil(seconds * features.fps / max(1, len(period))) - 1)
    return replace(features, values=np.concatenate([features.values, *[period] * more]))


def trim(motion: Motion) -> Motion:
    """The motion without a lead-in that leaps to the action, and with at most half a second of stillness at its ends.

    A held pose counts as stillness like standing about; a motion that is still throughout stays as it is, and nothing
    between two movements is touched. A skeleton of unknown unit is taken for a person of 1.7 m. Of 256 CMU trials of
    2,857 s this shortens 41, by 61 s: five that leap to the action from a few frames of another pose, standing about
    around karate, jumps and songs, and dancers who hold their last pose for up to eleven seconds.
    """
    skeleton = skeleton_of(motion)
    places = positions(motion) * (skeleton.metres_per_unit or ADULT_HEIGHT / skeleton.height)

    def speed(places: Array, frames: int) -> Array:
        """Of joints (T, J, 3) from each frame to the one ``frames`` later: (T - frames, J) in m/s."""
        found: Array = np.linalg.norm(places[frames:] - places[:-frames], axis=-1) * motion.fps / frames
        return found

    # above 10 m/s on average, joints do not move: the recording leaps, here within half a second of an end
    leaps = np.flatnonzero(speed(places, 1).mean(axis=1) > 10.0) + 1
    half = round(0.5 * motion.fps)
    start = int(max((leap for leap in leaps if leap <= half), default=0))
    stop = int(min((leap for leap in leaps if leap > max(start, len(places) - 1 - half)), default=len(places)))
    # still is a figure whose fastest joint stays below 0.2 m/s over a quarter of a second
    width = max(1, round(0.25 * motion.fps))
    moving = start + np.flatnonzero(speed(places[start:stop], width).max(axis=1) > 0.2)
    if not len(moving):
        return motion[start:stop]
    return motion[max(start, int(moving[0]) - half) : min(stop, int(moving[-1]) + width + 1 + half)]


ANGLES = Preparation("angles", humanoid=False, trim=False, cut=False)
"""The paper's: joint angles alone, every motion as it is."""

FULL = Preparation("root_angles", humanoid=True, trim=True, cut=True)
"""Joint angles and the root block of the humanoid, so that any figure can be used, and generated ones travel."""

SIXD = Preparation("root_sixd", humanoid=True, trim=True, cut=True, floor=True, fps=30.0)
"""Smooth root paths and the axes of joints, at a rate that shows feet standing: for motion codes."""

VECTORS = Preparation("root_vectors", humanoid=True, trim=True, cut=False, fps=30.0, longest=math.inf)
"""The root block and exponential maps: for predictors."""

ALL = {one.representation: one for one in (FULL, SIXD, VECTORS)}
"""The parts of a store that every verb is trained on."""

FIGURES = ("humanoid", "own")


def preparation(verb: str, kit: bool, figure: str | None = None, fps: float | None = None) -> Preparation:
    """How a corpus is prepared for a verb: "describe", "generate", "codes" or "predict".

    kit: whether it is the KIT Motion-Language data, which is prepared as in the paper if no figure is asked for.
    figure: one of :data:`FIGURES`, by default the humanoid. fps: of the frames, by default the verb's.
    """
    found = {"predict": VECTORS, "codes": SIXD}.get(verb, FULL)
    if kit and verb != "predict" and figure != "humanoid":
        found = ANGLES
    elif figure == "own":
        found = replace(found, humanoid=False)
    return found if fps is None else replace(found, fps=fps)
