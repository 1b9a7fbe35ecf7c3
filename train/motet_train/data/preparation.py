"""Prepare motions of a corpus for training: their figure, representation, frame rate, and which parts are used."""

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

SHORTEST_MOTION = 0.5
"""Shortest motion in seconds: a shorter one shows no action, and has less than five frames at 10 fps."""


@dataclass(frozen=True)
class Preparation:
    """Settings of a preparation.

    representation: its name. humanoid: retarget every figure to the humanoid, instead of keeping one figure. trim: cut
    off idle frames and T-poses at both ends (:func:`trim`). floor: lift motions out of the floor
    (:func:`motet.figures.floor.above_floor`). fps: frames per second. longest: motions of this many seconds and more
    are cut into pieces if ``cut`` is set, else refused (Plappert et al. 2017, section 5.1).
    """

    representation: str
    humanoid: bool
    trim: bool
    cut: bool
    floor: bool = False
    fps: float = 10.0
    longest: float = 30.0

    def pieces(self, motion: Motion) -> list[Motion]:
        """The motion to train on, in equal pieces shorter than ``longest``; MotionError if it is too short or long."""
        motion = _cleaned(motion, self.humanoid, self.trim, self.floor)
        if motion.duration < SHORTEST_MOTION or not (self.cut or motion.duration < self.longest):
            limits = f"at least {SHORTEST_MOTION:g} s" + ("" if self.cut else f" and less than {self.longest:g} s")
            raise MotionError(f"{motion.duration:.3g} s ({len(motion)} frames): a training motion has {limits}")
        # equal pieces, as few as are short enough
        count = math.floor(motion.duration / self.longest) + 1
        bounds = np.linspace(0, len(motion), count + 1).round().astype(int).tolist()
        return [motion[start:stop] for start, stop in pairwise(bounds)]


@lru_cache(maxsize=1)  # the parts of a store share one retargeted motion
def _cleaned(motion: Motion, humanoid: bool, trimmed: bool, floor: bool) -> Motion:
    motion = on_humanoid(motion) if humanoid else motion
    motion = above_floor(motion) if floor else motion
    return trim(motion) if trimmed else motion


def repeated(features: Motion, seconds: float = 3.5) -> Motion:
    """Features (T, D) of one period, repeated to fill at least ``seconds``.

    The last frame of the period is its first again. The root channels are changes, so the path goes on.
    """
    period = features.values[1:]
    times = math.ceil(seconds * features.fps / max(1, len(period)))
    values = np.concatenate([features.values, *[period] * max(0, times - 1)])
    return replace(features, values=values)


def trim(motion: Motion) -> Motion:
    """The motion without lead-ins of another pose, and with at most half a second of stillness at its ends.

    A held pose counts as stillness like standing about; a motion that is still throughout stays as it is, and nothing
    between two movements is touched. A skeleton of unknown unit is taken for a person of 1.7 m. Of 256 CMU trials of
    2,857 s this shortens 41, by 61 s: five that leap to the action from a few frames of another pose, standing about
    around karate, jumps and songs, and dancers who hold their last pose for up to eleven seconds.
    """
    skeleton = skeleton_of(motion)
    places = positions(motion) * (skeleton.metres_per_unit or ADULT_HEIGHT / skeleton.height)
    half = round(0.5 * motion.fps)
    start, stop = _between_leaps(places, motion.fps, half)
    # a still figure's fastest joint stays below 0.2 m/s over a quarter of a second
    width = max(1, round(0.25 * motion.fps))
    speeds = _speeds(places[start:stop], width, motion.fps)
    moving = start + np.flatnonzero(speeds.max(axis=1) > 0.2)
    if not len(moving):
        return motion[start:stop]
    first = int(moving[0]) - half
    last = int(moving[-1]) + width + 1 + half
    return motion[max(start, first) : min(stop, last)]


def _between_leaps(places: Array, fps: float, reach: int) -> tuple[int, int]:
    """The span of frames from the last leap within ``reach`` frames of the start to the first one near the end.

    Joints do not move at more than 10 m/s on average: there the recording leaps to another pose.
    """
    leaps = np.flatnonzero(_speeds(places, 1, fps).mean(axis=1) > 10.0) + 1
    start = int(max((leap for leap in leaps if leap <= reach), default=0))
    last = len(places) - 1
    stop = int(min((leap for leap in leaps if leap > max(start, last - reach)), default=len(places)))
    return start, stop


def _speeds(places: Array, frames: int, fps: float) -> Array:
    """Speeds of joints (T, J, 3) from each frame to the one ``frames`` later: (T - frames, J) in m/s."""
    speeds: Array = np.linalg.norm(places[frames:] - places[:-frames], axis=-1) * fps / frames
    return speeds


ANGLES = Preparation("angles", humanoid=False, trim=False, cut=False)
"""Joint angles only, and every motion as recorded (Plappert et al. 2017)."""

FULL = Preparation("root_angles", humanoid=True, trim=True, cut=True)
"""Joint angles and the root block of the humanoid: any figure can be used, and generated motions travel."""

SIXD = Preparation("root_sixd", humanoid=True, trim=True, cut=True, floor=True, fps=30.0)
"""Root block and 6D rotations, at a rate that shows foot contacts: for motion codes."""

VECTORS = Preparation("root_vectors", humanoid=True, trim=True, cut=False, fps=30.0, longest=math.inf)
"""Root block and exponential maps: for predictors."""

PARTS_OF_ALL_VERBS = {"root_angles": FULL, "root_sixd": SIXD, "root_vectors": VECTORS}
"""The parts of a store for all verbs, by their representation."""

FIGURE_CHOICES = ("humanoid", "own")


def preparation(verb: str, kit: bool, figure: str | None = None, fps: float | None = None) -> Preparation:
    """The preparation of a corpus for a verb: "describe", "generate", "codes" or "predict".

    kit: whether the corpus is the KIT Motion-Language data, which is prepared as in the paper unless the humanoid is
    asked for. figure: one of :data:`FIGURE_CHOICES`, by default the humanoid. fps: frames per second, by default the
    verb's."""
    prepared = {"predict": VECTORS, "codes": SIXD}.get(verb, FULL)
    if kit and verb != "predict" and figure != "humanoid":
        prepared = ANGLES
    elif figure == "own":
        prepared = replace(prepared, humanoid=False)
    return prepared if fps is None else replace(prepared, fps=fps)
