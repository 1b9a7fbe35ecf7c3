"""The motion contract of a bundle: which channels, in which units, at which frame rate a model takes and gives."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import BundleError, MotionError
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.root_block import ROOT_BLOCK, to_root_block


@dataclass(frozen=True, eq=False)
class MotionContract:
    """Channels (D names), units (D), fps, mean and std of the training data (D,) and the skeleton, if any."""

    channels: tuple[str, ...]
    units: tuple[str, ...]
    fps: float
    mean: Array
    std: Array
    skeleton: Skeleton | None

    def motion(self, frames: ArrayLike) -> Motion:
        """Frames (T, D) of a model as a motion."""
        return Motion(np.asarray(frames, dtype=np.float64), self.channels, self.units, self.fps, self.skeleton)

    def frames(self, motion: Motion) -> Array:
        """The frames (T, D) float64 of a motion with the contract's channels, units and frame rate.

        Where the contract has the root block (:mod:`motet.representation.root_block`) and the motion has the root's
        path and rotation, the block is computed at the contract's frame rate, from continuous angles. MotionError names
        the channels that the motion lacks.
        """
        if set(ROOT_BLOCK) & set(self.channels) - set(motion.channels):
            motion = to_root_block(motion.continuous().resample(self.fps))
        return motion.select(self.channels, self.units).resample(self.fps).values

    def to_json(self) -> dict[str, Any]:
        """A JSON object; :meth:`from_json` is the inverse."""
        return {
            "channels": list(self.channels),
            "units": list(self.units),
            "fps": self.fps,
            "mean": [round(float(value), 9) for value in self.mean],
            "std": [round(float(value), 9) for value in self.std],
            "skeleton": None if self.skeleton is None else self.skeleton.to_json(),
        }

    @staticmethod
    def from_json(data: Mapping[str, Any]) -> "MotionContract":
        """Read what :meth:`to_json` wrote; BundleError where it is no contract."""
        try:
            mean, std = (np.array(data[key], dtype=np.float64) for key in ("mean", "std"))
            channels, units = tuple(data["channels"]), tuple(data["units"])
            skeleton = None if data["skeleton"] is None else Skeleton.from_json(data["skeleton"])
            return MotionContract(channels, units, float(data["fps"]), mean, std, skeleton)
        except (KeyError, TypeError, ValueError, MotionError) as error:
            raise BundleError(f"no motion contract: {error}") from error
