"""Live figures: the pose of characters at one moment, for engines."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.figures.humanoid import BONES, HUMANOID
from motet.motion.rotations import Array, quat_product, quat_rotated, wrapped
from motet.motion.scalar_or_batch import Quaternion, Vector, parts, plus, product, rotated
from motet.steering.events import Event

Floats = NDArray[np.float32]
Values = NDArray[Any]


BONE_JOINTS = [HUMANOID.index(bone) for bone in BONES]
"""The joints of the humanoid at which its bones begin."""


@dataclass(frozen=True, eq=False, repr=False)
class Pose:
    """The pose of B characters on the humanoid; metres, y up. World positions are float64, all else float32.

    ground: (B, 3) x, z, and the facing in radians: 0 along z, positive to the left. rotations: (B, J, 4) quaternions
    (x, y, z, w) of the bones (:data:`motet.motion.BONES`) in their parents' frames; of the hips in the frame of the
    facing. height: (B,) of the hips above y = 0. contacts: (B, 2) from 0 to 1, ground contact of the left and the
    right foot. events: what has happened since the pose before, such as footsteps.
    """

    ground: Array
    rotations: Floats
    height: Floats
    contacts: Floats
    events: tuple[Event, ...] = ()

    def read_only(self) -> "Pose":
        """The same pose with read-only arrays: they are the state from which a session goes on."""
        views = {name: getattr(self, name).view() for name in ("ground", "rotations", "height", "contacts")}
        for view in views.values():
            view.flags.writeable = False
        return replace(self, **views)

    def __len__(self) -> int:
        """B."""
        return len(self.ground)

    def __repr__(self) -> str:
        return f"Pose({len(self)} characters)"

    @property
    def place(self) -> Array:
        """Positions of the characters (B, 3): on the ground under the hips."""
        return np.insert(self.ground[:, :2], 1, 0.0, axis=1)

    @property
    def heading(self) -> Floats:
        """Quaternions (B, 4), (x, y, z, w), of the facing: with :attr:`place` the transform of an engine's root."""
        half = (self.ground[:, 2] / 2).astype(np.float32)
        zero = np.zeros_like(half)
        return np.stack([zero, np.sin(half), zero, np.cos(half)], axis=1)

    def moved_since(self, before: "Pose") -> Array:
        """Root motion (B, 3) since an earlier pose: forward and to the left in metres, seen from the facing then, and
        the turn to the left in radians."""
        step = self.ground - before.ground
        left, forward = seen(step[:, :2], before.ground[:, 2]).T
        return np.stack([forward, left, wrapped(step[:, 2])], axis=1)

    def positions(self) -> Array:
        """Positions (B, J', 3) of all joints of the humanoid in the world, in the order of ``HUMANOID.names``."""
        return self.global_transforms()[1]

    def global_transforms(self) -> tuple[Floats, Array]:
        """Rotations (B, J', 4) and positions (B, J', 3) of all joints of the humanoid in the world."""
        # rotations in the parents' frames, none for joints that are no bones
        count = len(HUMANOID.names)
        turned = np.zeros((count, len(self), 4), dtype=np.float32)
        turned[..., 3] = 1
        turned[BONE_JOINTS] = np.swapaxes(self.rotations, 0, 1)
        places = np.empty((count, len(self), 3))
        # the hips stand in the world
        turned[0] = quat_product(self.heading, turned[0])
        places[0] = self.place
        places[0, :, 1] = self.height
        offsets = HUMANOID.offsets.astype(np.float32)[:, None]
        # then level by level, each joint from its parent
        for level in HUMANOID.levels:
            parents = HUMANOID.parents[level]
            places[level] = places[parents] + quat_rotated(turned[parents], offsets[level])
            turned[level] = quat_product(turned[parents], turned[level])
        return np.swapaxes(turned, 0, 1), np.swapaxes(places, 0, 1)

    def towards(self, other: "Pose", part: float) -> "Pose":
        """The pose ``part`` (0 to 1) of the way to another nearby pose, for frame rates other than the model's; nothing
        happens on the way."""
        share = np.float32(part)
        step = other.ground - self.ground
        step[:, 2] = wrapped(step[:, 2])
        signs = np.where((self.rotations * other.rotations).sum(axis=-1, keepdims=True) < 0, np.float32(-1), 1)
        mixed = self.rotations + share * (signs * other.rotations - self.rotations)
        return replace(
            self,
            ground=self.ground + part * step,
            rotations=mixed / np.linalg.norm(mixed, axis=-1, keepdims=True),
            height=self.height + share * (other.height - self.height),
            contacts=self.contacts + share * (other.contacts - self.contacts),
            events=(),
        )


def seen(vectors: Array, facing: Array) -> Array:
    """Vectors (n, 2) over the ground, x and z, as left and forward (n, 2) of a facing (n,)."""
    x, z = vectors.T
    cos = np.cos(facing)
    sin = np.sin(facing)
    return np.stack([cos * x - sin * z, sin * x + cos * z], axis=1)


def hips_of(pose: Pose) -> Vector:
    """Where the hips are in the world."""
    x, z, _ = parts(pose.ground)
    (height,) = parts(pose.height[:, None])
    return x, height, z


def frame_of(pose: Pose, bones: Sequence[str]) -> tuple[Vector, Quaternion]:
    """Place and rotation in the world of the last of bones, each of which carries the next, and the hips the first."""
    place = hips_of(pose)
    rotation = product(parts(pose.heading), parts(pose.rotations[:, 0]))
    for bone in bones:
        place = plus(place, rotated(rotation, HUMANOID.joints[HUMANOID.index(bone)].offset))
        rotation = product(rotation, parts(pose.rotations[:, BONES.index(bone)]))
    return place, rotation
