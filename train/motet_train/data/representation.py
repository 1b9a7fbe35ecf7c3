"""How motions become a model's frames: which channels, at which frame rate, and which part of a motion."""

from dataclasses import dataclass

from motet.errors import MotionError
from motet.motion.motion import TURN, Motion
from motet.representation.root_block import to_root_block
from motet_train.data.trim import trim

SHORTEST = 0.5
"""Seconds: less than this shows no action, and gives less than five frames at 10 fps."""


@dataclass(frozen=True)
class Representation:
    """root_block: put the root block in front, and all angles in degrees; else the root is left out.

    trim: cut off idle frames and T-poses at both ends (:mod:`motet_train.data.trim`).
    fps: of the frames. longest: seconds from which on a motion is refused (Plappert et al. 2017, section 5.1).
    """

    root_block: bool
    trim: bool
    fps: float = 10.0
    longest: float = 30.0

    def sequences(self, motion: Motion) -> list[Motion]:
        """The motion at ``fps``, once for each down-sampling offset (Plappert et al. 2017, section 5.1).

        120 Hz to 10 fps gives 12 sequences; a rate that is no multiple of ``fps`` gives one, interpolated. MotionError
        for a motion that is too short or too long, or lacks what the root block needs.
        """
        motion = trim(motion) if self.trim else motion
        if not SHORTEST <= motion.duration < self.longest:
            limits = f"at least {SHORTEST:g} s and less than {self.longest:g} s"
            raise MotionError(f"{motion.duration:.3g} s ({len(motion)} frames): a motion to train on has {limits}")
        smooth = motion.continuous()
        ratio = motion.fps / self.fps
        offsets = round(ratio) if abs(ratio - round(ratio)) < 1e-9 else 1
        return [self._channels(smooth[offset:].resample(self.fps)) for offset in range(offsets)]

    def _channels(self, motion: Motion) -> Motion:
        if self.root_block:
            motion = to_root_block(motion)
            return motion.select(motion.channels, tuple("deg" if unit in TURN else unit for unit in motion.units))
        root = "root" if motion.skeleton is None else motion.skeleton.names[0]
        return motion.select(tuple(name for name in motion.channels if name.rpartition(".")[0] != root))


ANGLES = Representation(root_block=False, trim=False)
"""The paper's: joint angles alone, every motion as it is."""

FULL = Representation(root_block=True, trim=True)
"""Joint angles and the root block, so that generated figures travel and turn."""
