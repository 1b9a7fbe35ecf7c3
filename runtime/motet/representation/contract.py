"""Representations by name, and the motion contract of a bundle: what the frames are that a model takes and gives."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import BundleError, MotionError
from motet.figures.humanoid import Figure, to_humanoid
from motet.files import Json
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Names, Skeleton
from motet.representation.base import FrameMirror, Representation, phases
from motet.representation.retargeting import (
    foreign,
    in_joints_of,
    in_known_unit,
    to_model_figure,
)
from motet.representation.root_block import Angles, RootAngles, RootVectors
from motet.representation.root_sixd import RootSixd

REPRESENTATIONS: dict[str, Representation] = {
    "angles": Angles(),
    "root_angles": RootAngles(),
    "root_sixd": RootSixd(),
    "root_vectors": RootVectors(),
}
"""By the names that manifests have."""


def named(name: str) -> Representation:
    """The representation of a name as manifests have it; BundleError for another."""
    if name not in REPRESENTATIONS:
        raise BundleError(f"representation must be one of {', '.join(REPRESENTATIONS)}, not {name!r}")
    return REPRESENTATIONS[name]


Z_LIMIT = 50.0
"""Standard deviations: z is clipped to this, in the nets' graphs too. Of 256 of CMU's trials one frame in a thousand
is further than 36 from the mean in any channel, and two of them, by glitches of the recording, further than 50."""

LIVING_STD = {
    "deg": 0.25,
    "rad": np.radians(0.25),
    "deg/s": 1.0,
    "rad/s": np.radians(1.0),
    "m": 1e-3,
    "m/s": 0.01,
    "length": 1e-4,
    "1": 1e-4,
}
"""Standard deviations, by unit, from which on a channel lives. CMU's fingers, which only single T-poses bend otherwise,
have up to .12 degrees; the stillest channel that means something, the bend of the upper back in a single walk, has .41.
"length" and "1" are in units of files, of which nothing is known: under 1e-4 there is rounding alone."""


@dataclass(frozen=True, eq=False)
class MotionContract:
    """What the frames (T, D) of a model mean.

    representation: a name of ``REPRESENTATIONS``. channels, units: D each. fps: frames per second. mean, std: (D,) of
    the training data; a channel of std 0 is dead: always at its mean. skeleton: the figure that the frames move.
    """

    representation: str
    channels: Names
    units: Names
    fps: float
    mean: Array
    std: Array
    skeleton: Skeleton | None

    @cached_property
    def mirror(self) -> FrameMirror:
        """How frames are mirrored; MotionError where they cannot be."""
        return named(self.representation).mirror(self._like)

    @cached_property
    def _like(self) -> Motion:
        return self.features(np.empty((0, len(self.channels))))

    def features(self, frames: ArrayLike, plant: bool = False) -> Motion:
        """Frames (T, D) as a motion in the contract's own channels, frame for frame.

        plant: let the feet say where the figure goes, in representations of generated motions.
        """
        features = Motion(
            np.asarray(frames, dtype=np.float64),
            self.channels,
            self.units,
            self.fps,
            self.skeleton,
        )
        return named(self.representation).planted(features) if plant else features

    def frames(self, motion: Motion) -> Array:
        """The frames (T, D) float64 of a motion, of any length, or of features.

        Angles are made continuous, in the order and axes of the contract's joints, and the motion brought to the
        contract's frame rate, beginning with its first frame. A motion of another human figure is brought onto the
        contract's (:meth:`on_figure`). MotionError names what the motion lacks.
        """
        return next(sequences(self.representation, self.on_figure(motion), self.fps, self._like)).values

    def on_figure(self, motion: Motion, figure: Figure | None = None) -> Motion:
        """A motion of any human figure on the contract's skeleton; as it is where it has the joints or channels, with
        the length unit that its skeleton tells where the file does not.

        One that is brought there comes at the contract's frame rate where its own is higher, beginning with its first
        frame; joints of which the humanoid says nothing, such as thumbs, stand as they do on average. MotionError, with
        the reason, where that cannot be done.
        figure: its figure as :meth:`measured` finds it, where more than one motion of it is brought.
        """
        if self._is_own(motion) or self.skeleton is None:
            return motion
        # a figure whose angles mean the same is taken as it is
        reason = foreign(motion, self.skeleton, self._joints)
        if reason is None:
            return in_known_unit(motion, self.skeleton)
        if named(self.representation).required and not any(channel.endswith(".tx") for channel in motion.channels):
            raise MotionError("this motion lacks the root's tx, ty and tz, the path of the figure")
        # brought to the humanoid, and from there to the model's figure
        slower = motion.continuous().resample(self.fps) if motion.fps > self.fps else motion
        average = self.motion(self.mean[None], plant=False)
        return to_model_figure(slower, average, reason, figure)

    def measured(self, motion: Motion) -> Figure | None:
        """The figure of a motion that :meth:`on_figure` brings to the humanoid, measured for more of it; None of one
        that is taken as it is. MotionError as there."""
        if self._is_own(motion) or self.skeleton is None or not foreign(motion, self.skeleton, self._joints):
            return None
        return to_humanoid(motion).logged().figure

    def _is_own(self, motion: Motion) -> bool:
        """Whether a motion is of the contract's own figure, in a known unit, or features."""
        known = self.skeleton is not None and self.skeleton.metres_per_unit is not None
        return (known and motion.skeleton == self.skeleton) or set(self.channels) <= set(motion.channels)

    @cached_property
    def _joints(self) -> Names:
        """The joints that the channels speak of, but for the root where its block does."""
        block = named(self.representation).required
        names = (channel.rpartition(".")[0] for channel in self.channels if channel not in block)
        return tuple(name for name in dict.fromkeys(names) if self.skeleton and name in self.skeleton.places)

    def motion(self, frames: ArrayLike, after: Motion | None = None, plant: bool = True) -> Motion:
        """Frames (T, D) as a motion that can be played and written, at the contract's frame rate.

        after: a motion to be continued, at the same frame rate, in its channels where the representation can; else
            the figure starts at the origin and faces z.
        plant: as :meth:`features`.
        """
        return named(self.representation).motion(self.features(frames, plant), after)

    def normalised(self, frames: ArrayLike) -> Array:
        """Frames (..., D) in standard deviations from the mean: 0 in dead channels, and within Z_LIMIT."""
        # dead channels are divided by infinity
        scale = np.where(self.std > 0, self.std, np.inf)
        return np.clip(
            (np.asarray(frames, dtype=np.float64) - self.mean) / scale,
            -Z_LIMIT,
            Z_LIMIT,
        )

    def denormalised(self, z: ArrayLike) -> Array:
        """The inverse: frames (..., D), dead channels at their mean."""
        return np.asarray(z, dtype=np.float64) * self.std + self.mean

    def to_json(self) -> Json:
        """A JSON object; :func:`motet.bundle.manifest.read_contract` is the inverse."""
        return {
            "representation": self.representation,
            "channels": list(self.channels),
            "units": list(self.units),
            "fps": self.fps,
            "mean": [round(float(value), 9) for value in self.mean],
            "std": [round(float(value), 9) for value in self.std],
            "skeleton": None if self.skeleton is None else self.skeleton.to_json(),
        }


def sequences(representation: str, motion: Motion, fps: float, like: Motion | None = None) -> Iterator[Motion]:
    """The features of a motion at a frame rate, in all phases (:func:`motet.representation.base.phases`).

    like: features whose channels, units and joints are wanted; else all that the motion has. MotionError names what the
    motion lacks.
    """
    if like is not None:
        motion = in_joints_of(motion, like.skeleton)
    return (named(representation).features(phase, like) for phase in phases(motion, fps))


def living(std: ArrayLike, units: Sequence[str]) -> Array:
    """Standard deviations (D,) of training data, 0 where they are under the floor of their unit."""
    floors = np.array([LIVING_STD[unit] for unit in units])
    return np.where(np.asarray(std, dtype=np.float64) < floors, 0.0, std)
