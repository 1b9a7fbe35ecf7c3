"""Prepare motions of a corpus for training: their figure, representation, frame rate, and which parts are used."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from motet.errors import MotionError
from motet.figures.floor import above_floor
from motet.figures.humanoid import on_humanoid
from motet.figures.trimming import trim
from motet.motion.motion import Motion

SHORTEST_MOTION = 0.5
"""Shortest motion in seconds: a shorter one shows no action, and has less than five frames at 10 fps."""


@dataclass(frozen=True)
class Preparation:
    """Settings of a preparation.

    representation: its name. humanoid: retarget every figure to the humanoid, instead of keeping one figure. trim: cut
    off idle frames and T-poses at both ends (:func:`motet.figures.trimming.trim`). floor: lift motions out of the floor
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
