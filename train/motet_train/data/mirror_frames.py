"""Left-right mirroring of a model's frames: an exchange of columns and signs, found once for a contract."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.motion.mirror import lateral_axis, mirror
from motet.motion.motion import Motion
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK
from motet_train.data.errors import DataError

NEGATED = ("root.left", "root.turn", "root.roll")
"""The channels of the root block that change their sign."""


@dataclass(frozen=True, eq=False)
class FrameMirror:
    """Column d of a mirrored frame is column ``columns[d]`` of the frame times ``signs[d]``; both (D,)."""

    columns: NDArray[np.intp]
    signs: NDArray[np.float32]

    def __call__(self, frames: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mirror frames (T, D) float32."""
        return frames[:, self.columns] * self.signs


def frame_mirror(contract: MotionContract) -> FrameMirror:
    """How frames of a contract are mirrored, by the rule of :mod:`motet.motion.mirror`.

    DataError without a skeleton, and for one whose joints are not in pairs with mirrored axes.
    """
    if contract.skeleton is None:
        raise DataError("the motions have no skeleton, so they cannot be mirrored: train without mirroring")
    columns = np.arange(len(contract.channels))
    signs = np.array([-1.0 if name in NEGATED else 1.0 for name in contract.channels], dtype=np.float32)
    joints = np.array([d for d, name in enumerate(contract.channels) if name not in ROOT_BLOCK], dtype=np.intp)
    names, units = (tuple(values[d] for d in joints) for values in (contract.channels, contract.units))
    # each column of a probe frame holds its own number: where mirroring puts it, and with which sign, can be read off
    probe = Motion(np.arange(1.0, len(joints) + 1)[None], names, units, contract.fps, contract.skeleton)
    try:
        mirrored = mirror(probe)
        if lateral_axis(contract.skeleton) != 0 and len(joints) < len(columns):
            raise MotionError("left and right of its rest pose do not lie along x, as the root block needs")
    except MotionError as error:
        raise DataError(f"the motions cannot be mirrored ({error}): train without mirroring") from error
    found = np.abs(mirrored.values[0])
    if mirrored.channels != names or not np.array_equal(np.sort(found), probe.values[0]):
        raise DataError("joints of the two sides turn about other axes, so frames cannot be mirrored by their columns")
    columns[joints] = joints[found.astype(np.intp) - 1]
    signs[joints] = np.sign(mirrored.values[0])
    return FrameMirror(columns, signs)
