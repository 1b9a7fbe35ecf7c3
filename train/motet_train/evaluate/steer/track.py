"""What figures did, steered or recorded, as all measures see it, and how well they stand and how calmly they move."""

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
from motet_train.evaluate.positions import BALLS, acceleration, length, running_mean, slide, speed, spells, stances


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
        return sole_points(quat_to_rotmat(turned), places).reshape(*self.height.shape, -1, 3)


def tracks_of(found: Sequence[Recording], rows: MatchingRows) -> list[Track]:
    """What recordings show, each as one figure; ``rows`` are those of all of them."""
    tracks, start = [], 0
    for one in found:
        own = rows.poses[start : (start := start + len(one.features))].astype(np.float32)
        ground = poses_of(one.features.select(ROOT_SIXD).values, one.features.fps)[:, None]
        tracks.append(Track(ground, own[:, :-1].reshape(len(own), 1, -1, 4), own[:, -1:], one.features.fps))
    return tracks


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Values (T, B, ...) as (T B, ...)."""
    return values.reshape(-1, *values.shape[2:])


def stretches(track: Track, pace: float) -> list[Track]:
    """The parts of a recording, of a second at least, whose mean speed over half a second is within a fifth of
    ``pace``, m/s."""
    steps = length(np.gradient(track.ground[:, 0, :2], axis=0)).astype(np.float64) * track.fps
    paces = running_mean(steps, min(round(0.5 * track.fps), len(steps)))
    inside = spells(np.abs(paces - pace) <= 0.2 * pace)
    return [track[start:stop] for start, stop in inside if stop - start >= track.fps]


def standing(tracks: Sequence[Track]) -> dict[str, float]:
    """By the measures of :mod:`motet_train.evaluate.positions`: how far the balls of the feet and the points of the
    soles slide in a stance, cm; how fast the balls are while they stand, m/s; and the acceleration of all joints,
    m/s^2. Means over stances or frames."""
    stood, soles_stood, speeds, calm, frames = list[Array](), list[Array](), list[float](), list[float](), list[int]()
    for track in tracks:
        for figure in range(track.height.shape[1]):
            places, soles = (of[:, figure].astype(np.float64) for of in (track.places, track.soles))
            root = places[:, 0]
            stood += stances(places[:, BALLS], root, track.fps)
            soles_stood += stances(soles, root, track.fps)
            speeds.append(speed(places[:, BALLS], root, track.fps))
            calm.append(acceleration(places, root, track.fps))
            frames.append(len(places))
    return {
        "slide_cm": 100 * slide(stood),
        "sole_slide_cm": 100 * slide(soles_stood),
        "toe_speed": _mean(speeds, frames),
        "acceleration": _mean(calm, frames),
    }


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """The weighed mean of the values that are numbers; NaN where none is."""
    known = np.array([pair for pair in zip(values, weights, strict=True) if np.isfinite(pair[0]) and pair[1]])
    return float(np.average(known[:, 0], weights=known[:, 1])) if len(known) else np.nan
