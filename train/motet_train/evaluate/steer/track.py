"""What figures did, steered or recorded, as all measures see it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.motion.humanoid import sole_points
from motet.motion.pose import Pose
from motet.motion.rotations import Array, quat_to_rotmat
from motet.representation.root_sixd import ROOT_SIXD
from motet_train.data.matching_rows import MatchingRows, Recording
from motet_train.data.sixd_windows import poses_of


@dataclass(frozen=True, eq=False)
class Track:
    """B figures in T frames; metres, y up. ground: (T, B, 3) x, z and facing in radians, float64. rotations:
    (T, B, J, 4) quaternions (x, y, z, w) and height (T, B) as :class:`motet.motion.pose.Pose` has them."""

    ground: Array
    rotations: Floats
    height: Floats
    fps: float

    @staticmethod
    def of(poses: Sequence[Pose], fps: float) -> "Track":
        """What poses that follow each other show."""
        columns = ([getattr(pose, name) for pose in poses] for name in ("ground", "rotations", "height"))
        ground, rotations, height = map(np.stack, columns)
        return Track(ground, rotations, height, fps)

    def __len__(self) -> int:
        """T."""
        return len(self.ground)

    def __getitem__(self, frames: slice) -> "Track":
        """Some of the frames."""
        return Track(self.ground[frames], self.rotations[frames], self.height[frames], self.fps)

    def seen(self) -> "Track":
        """The same as the figures themselves see it: all at the origin, and facing z."""
        return replace(self, ground=np.zeros_like(self.ground))

    @cached_property
    def transforms(self) -> tuple[Floats, Array]:
        """Rotations (T, B, J', 4) and places (T, B, J', 3) of all joints of the humanoid in the world."""
        ground, rotations, height = _flat(self.ground), _flat(self.rotations), _flat(self.height)
        turned, places = Pose(ground, rotations, height, np.zeros((len(height), 2), np.float32)).global_transforms()
        return turned.reshape(*self.height.shape, -1, 4), places.reshape(*self.height.shape, -1, 3)

    @property
    def places(self) -> Array:
        """Places (T, B, J', 3) of all joints of the humanoid in the world."""
        return self.transforms[1]

    @cached_property
    def soles(self) -> Array:
        """Points (T, B, 6, 3): heel, ball and tip of the left sole, then of the right one."""
        turned, places = (_flat(part).astype(np.float64) for part in self.transforms)
        found = sole_points(quat_to_rotmat(turned), places)
        return found.reshape(*self.height.shape, -1, 3)


def tracks_of(found: Sequence[Recording], rows: MatchingRows) -> list[Track]:
    """What recordings show, each as one figure; ``rows`` are those of all of them."""
    tracks, start = [], 0
    for one in found:
        part = slice(start, start := start + len(one.features))
        way = poses_of(one.features.select(ROOT_SIXD).values, one.features.fps)
        parts = (way[:, None], rows.poses[part, :-1].reshape(len(way), 1, -1, 4), rows.poses[part, -1:])
        ground, rotations, height = parts
        tracks.append(Track(ground, rotations.astype(np.float32), height.astype(np.float32), one.features.fps))
    return tracks


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Values (T, B, ...) as (T B, ...)."""
    return values.reshape(-1, *values.shape[2:])
