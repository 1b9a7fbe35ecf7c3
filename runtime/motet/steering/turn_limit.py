"""Joints that turn no faster than people's: what is left after a jump of the pose is made up for in the next ticks.

Acts that cut each other, and hands and feet that are led elsewhere, can ask a joint to be elsewhere at once. Each joint
but the hips, which an act may turn over, goes there at its limit. Letters in shapes: B figures, J bones.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np

from motet.figures.humanoid import BONES
from motet.motion.rotations import Array
from motet.settings import Range, Settings
from motet.steering.pose import Floats, Pose

DegreesPerSecond = Annotated[float, Range(1, 5400, "deg/s")]


@dataclass(frozen=True)
class TurnSettings(Settings):
    """How fast the joints of a bone and its fellows turn at most: about what is passed in a thousandth of the frames of
    CMU's and ACCAD's recordings, or by no recording of a gait. 30 degrees in a tick of 1/30 s are 900 a second."""

    FEATURE: ClassVar[str] = "turns"

    trunk: DegreesPerSecond = 540.0
    """Of the spine."""
    head: DegreesPerSecond = 450.0
    """Of neck and head."""
    shoulder: DegreesPerSecond = 360.0
    """Of the collar bones."""
    upper_arm: DegreesPerSecond = 960.0
    """Of the upper arms."""
    lower_arm: DegreesPerSecond = 960.0
    """Of the forearms."""
    hand: DegreesPerSecond = 1035.0
    """Of the hands."""
    upper_leg: DegreesPerSecond = 780.0
    """Of the thighs."""
    lower_leg: DegreesPerSecond = 990.0
    """Of the shins."""
    foot: DegreesPerSecond = 1020.0
    """Of the feet."""
    toes: DegreesPerSecond = 1035.0
    """Of the toes."""


BONES_OF_LIMIT = {
    "trunk": ("spine", "chest", "upperChest"),
    "head": ("neck", "head"),
    "shoulder": ("leftShoulder", "rightShoulder"),
    "upper_arm": ("leftUpperArm", "rightUpperArm"),
    "lower_arm": ("leftLowerArm", "rightLowerArm"),
    "hand": ("leftHand", "rightHand"),
    "upper_leg": ("leftUpperLeg", "rightUpperLeg"),
    "lower_leg": ("leftLowerLeg", "rightLowerLeg"),
    "foot": ("leftFoot", "rightFoot"),
    "toes": ("leftToes", "rightToes"),
}
"""Setting -> the bones that it is about."""

LIMITED = dict[int, str]()
"""Bone -> its setting."""

for kind, bones in BONES_OF_LIMIT.items():
    LIMITED |= dict.fromkeys(map(BONES.index, bones), kind)


@dataclass(frozen=True, eq=False)
class TurnLimit:
    """The joints of B figures."""

    rotations: Floats
    """(B, J, 4) as they were shown in the last tick, NaN before the first."""

    @staticmethod
    def none(figures: int) -> "TurnLimit":
        """Joints that have not been shown yet, and can be anywhere."""
        return TurnLimit(np.full((figures, len(BONES), 4), np.nan, dtype=np.float32))

    def update(self, pose: Pose, settings: TurnSettings, seconds: float) -> tuple["TurnLimit", Pose]:
        """A tick later, and the pose of that tick with joints that are on their way."""
        half_limits, least_cosines = _limits(settings, seconds)
        # the cosines of half the angles that joints would turn by, of either sign
        part = self.rotations * pose.rotations
        cosines = part[..., 0] + part[..., 1] + part[..., 2] + part[..., 3]
        too_fast = np.abs(cosines) < least_cosines
        if too_fast.any():
            pose = replace(pose, rotations=self._limited(pose.rotations, cosines, too_fast, half_limits))
        return TurnLimit(pose.rotations), pose

    def _limited(self, rotations: Floats, cosines: Floats, too_fast: Array, half_limits: Array) -> Floats:
        """Rotations (B, J, 4) whose joints that are too fast (B, J) turn by their limits."""
        figures, bones = np.nonzero(too_fast)
        before = self.rotations[figures, bones].astype(np.float64)
        after = rotations[figures, bones].astype(np.float64)
        cosine = cosines[figures, bones].astype(np.float64)[:, None]
        # on the shorter way: what of the goal is square to where the joint was, which is the axis of the turn
        aside = after - cosine * before
        aside *= np.where(cosine < 0, -1.0, 1.0) / np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
        half = half_limits[bones][:, None]
        limited = rotations.copy("K")
        limited[figures, bones] = np.cos(half) * before + np.sin(half) * aside
        return limited


@lru_cache
def _limits(settings: TurnSettings, seconds: float) -> tuple[Array, Array]:
    """Half the angles in radians (J,) that joints turn by in a tick at most, and their cosines, -1 for the hips."""
    half = np.full(len(BONES), np.pi)
    for bone, kind in LIMITED.items():
        half[bone] = np.radians(getattr(settings, kind)) * seconds / 2
    return half, np.cos(half)
