"""How the motions of a corpus become sequences to train on: which representation, frame rate, and part of a motion."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.motion.humanoid import on_humanoid
from motet.motion.motion import Motion
from motet.representation.contract import sequences
from motet_train.data.trim import trim

SHORTEST = 0.5
"""Seconds: less than this shows no action, and gives less than five frames at 10 fps."""


@dataclass(frozen=True)
class Preparation:
    """representation: its name. humanoid: bring every figure to the humanoid, instead of taking motions of one figure.

    trim: cut off idle frames and T-poses at both ends (:mod:`motet_train.data.trim`). fps: of the frames.
    longest: seconds from which on a motion is cut into pieces where ``cut`` is set, and else refused
    (Plappert et al. 2017, section 5.1).
    """

    representation: str
    humanoid: bool
    trim: bool
    cut: bool
    fps: float = 10.0
    longest: float = 30.0

    def pieces(self, motion: Motion) -> list[Motion]:
        """The motion that is trained on, in equal pieces shorter than ``longest``; MotionError where it is unfit."""
        motion = _brought(motion, self.humanoid, self.trim)
        if motion.duration < SHORTEST or not (self.cut or motion.duration < self.longest):
            limits = f"at least {SHORTEST:g} s" + ("" if self.cut else f" and less than {self.longest:g} s")
            raise MotionError(f"{motion.duration:.3g} s ({len(motion)} frames): a training motion has {limits}")
        count = math.floor(motion.duration / self.longest) + 1
        bounds = np.linspace(0, len(motion), count + 1).round().astype(int).tolist()
        return [motion[start:stop] for start, stop in pairwise(bounds)]

    def sequences(self, piece: Motion, like: Motion | None = None) -> Iterator[Motion]:
        """The features of a piece in all phases, in the channels of ``like`` where that is given.

        MotionError where it lacks what the representation needs.
        """
        return sequences(self.representation, piece, self.fps, like)


@lru_cache(maxsize=1)  # the parts of a store bring each motion to the humanoid once
def _brought(motion: Motion, humanoid: bool, trimmed: bool) -> Motion:
    motion = on_humanoid(motion) if humanoid else motion
    return trim(motion) if trimmed else motion


ANGLES = Preparation("angles", humanoid=False, trim=False, cut=False)
"""The paper's: joint angles alone, every motion as it is."""

FULL = Preparation("root_angles", humanoid=True, trim=True, cut=True)
"""Joint angles and the root block of the humanoid, so that any figure counts, and generated ones travel and turn."""

SIXD = Preparation("root_sixd", humanoid=True, trim=True, cut=True, fps=30.0)
"""Smooth ways and the axes of joints, at a rate that shows feet standing: what motion codes are made of."""

VECTORS = Preparation("root_vectors", humanoid=True, trim=True, cut=False, fps=30.0, longest=math.inf)
"""The root block and exponential maps: what predictors continue."""

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
