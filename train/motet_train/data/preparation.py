"""How the motions of a corpus become sequences to train on: which representation, frame rate, and part of a motion."""

from collections.abc import Iterator
from dataclasses import dataclass

from motet.errors import MotionError
from motet.motion.motion import Motion
from motet.representation.contract import sequences
from motet_train.data.trim import trim

SHORTEST = 0.5
"""Seconds: less than this shows no action, and gives less than five frames at 10 fps."""


@dataclass(frozen=True)
class Preparation:
    """representation: its name. trim: cut off idle frames and T-poses at both ends (:mod:`motet_train.data.trim`).

    fps: of the frames. longest: seconds from which on a motion is refused (Plappert et al. 2017, section 5.1).
    """

    representation: str
    trim: bool
    fps: float = 10.0
    longest: float = 30.0

    def sequences(self, motion: Motion, like: Motion | None = None) -> Iterator[Motion]:
        """The features of a motion in all phases, in the channels of ``like`` where that is given.

        MotionError for a motion that is too short or too long, or lacks what the representation needs.
        """
        motion = trim(motion) if self.trim else motion
        if not SHORTEST <= motion.duration < self.longest:
            limits = f"at least {SHORTEST:g} s and less than {self.longest:g} s"
            raise MotionError(f"{motion.duration:.3g} s ({len(motion)} frames): a training motion has {limits}")
        return sequences(self.representation, motion, self.fps, like)


ANGLES = Preparation("angles", trim=False)
"""The paper's: joint angles alone, every motion as it is."""

FULL = Preparation("root_angles", trim=True)
"""Joint angles and the root block, so that generated figures travel and turn."""
