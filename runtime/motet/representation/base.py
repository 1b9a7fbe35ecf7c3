"""What representations offer, and what they share: mirroring by columns, down-sampling in phases, rest."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.motion.kinematics import channels_of, skeleton_of
from motet.motion.mirroring import lateral_axis
from motet.motion.motion import Motion, is_whole
from motet.motion.rotations import Array, Indices
from motet.motion.skeleton import Names, Skeleton, partners_of


class Representation(ABC):
    """What the channels of a model mean. *Features* are a motion in these channels, frame for frame a model's frames.

    required: channels that features always have.
    """

    required: Names = ()

    @abstractmethod
    def features(self, motion: Motion, like: Motion | None = None) -> Motion:
        """The features of a continuous motion at the model's frame rate; features are given back as they are.

        like: features whose channels, units and joints are wanted; else all that the motion has. MotionError names
        what the motion lacks.
        """

    def planted(self, features: Motion) -> Motion:
        """Features of a generated motion whose feet stand where they are on the ground, where that can be said."""
        return features

    @abstractmethod
    def motion(self, features: Motion, after: Motion | None = None) -> Motion:
        """A motion that can be played, from features: from the origin, or as the continuation of another motion."""

    @abstractmethod
    def mirror(self, features: Motion) -> "FrameMirror":
        """How frames of such features are mirrored; MotionError where they cannot be."""


@dataclass(frozen=True, eq=False)
class FrameMirror:
    """Column d of a mirrored frame is column ``columns[d]`` of the frame times ``signs[d]``; both (D,)."""

    columns: Indices
    signs: NDArray[np.float32]

    def __call__(self, frames: NDArray[Any]) -> NDArray[Any]:
        """Mirror frames (..., D)."""
        return frames[..., self.columns] * self.signs


def phases(motion: Motion, fps: float) -> Iterator[Motion]:
    """The motion at another frame rate, leaps taken out, in all phases (Plappert et al. 2017, section 5.1).

    Where every n-th frame is picked, that can begin at each of n frames: 120 Hz to 10 fps gives 12 motions. Else it
    gives one. The first one begins with the motion.
    """
    ratio = motion.fps / fps
    smooth = motion.continuous()
    return (smooth[offset:].resample(fps) for offset in range(round(ratio) if is_whole(ratio) else 1))


def root_signs(channels: Sequence[str]) -> NDArray[np.float32]:
    """The signs (D,) by which channels of the root change in a mirror image; 1 for all others."""
    turned = ("root.left", "root.turn", "root.roll")
    return np.array([-1.0 if name in turned else 1.0 for name in channels], dtype=np.float32)


def joint_channels(joints: Iterable[str], kinds: Sequence[str]) -> Names:
    """The channels of these kinds of joints, one joint after the other."""
    return tuple(f"{joint}.{kind}" for joint, kind in product(joints, kinds))


def root_places(motion: Motion) -> Array:
    """The places (T, 3) in metres of the root; MotionError where its channels or the unit of length are missing."""
    return motion.select(channels_of(skeleton_of(motion).names[0], "t"), ("m",) * 3).values


def joints_with(channels: Sequence[str], kind: str) -> Names:
    """The joints that have a channel of a kind."""
    return tuple(name.rpartition(".")[0] for name in channels if name.endswith(f".{kind}"))


def mirror_by_joints(features: Motion, signs: Mapping[str, float]) -> FrameMirror:
    """The mirror of features that have the same kinds of channels for every joint, by the ``signs`` of these."""
    lateral_x(features)
    joints = joints_with(features.channels, next(iter(signs)))
    places = {name: column for column, name in enumerate(features.channels)}
    # a joint's columns come from its partner's, with the sign of their kind
    columns = np.arange(len(places))
    signs_of_columns = root_signs(features.channels)
    for joint, partner in zip(joints, partners_of(joints), strict=True):
        for kind, sign in signs.items():
            columns[places[f"{joint}.{kind}"]] = places[f"{joints[partner]}.{kind}"]
            signs_of_columns[places[f"{joint}.{kind}"]] = sign
    return FrameMirror(columns, signs_of_columns)


def lateral_x(features: Motion) -> Skeleton:
    """The skeleton, whose left and right lie along x, as the root block needs; else MotionError."""
    skeleton = skeleton_of(features)
    if lateral_axis(skeleton) != 0:
        raise MotionError("left and right of the rest pose must lie along x for the root block")
    return skeleton


def at_rest(features: Motion, joints: Sequence[str]) -> Motion:
    """One frame of the features' figure at rest at the origin: the root's place and Euler angles of some joints."""
    skeleton = skeleton_of(features)
    channels = channels_of(skeleton.names[0], "t") + joint_channels(joints, ("rx", "ry", "rz"))
    units = ("length",) * 3 + ("deg",) * (3 * len(joints))
    return Motion(np.zeros((1, len(channels))), channels, units, features.fps, skeleton)


def in_units(motion: Motion, change: Callable[[str], str]) -> Motion:
    """The motion with the units of its channels changed one by one, lengths to metres where their unit is known."""
    known = motion.skeleton is not None and motion.skeleton.metres_per_unit is not None
    units = ("m" if known and unit == "length" else change(unit) for unit in motion.units)
    return motion.select(motion.channels, tuple(units))
