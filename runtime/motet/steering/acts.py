"""Acts: short motions of the humanoid that a steered figure can be told to do (:mod:`motet.steering.action_layer`).

Letters in shapes: T frames, J bones, J' joints, F features as in :mod:`motet.steering.matching`.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import ControlError
from motet.figures.feet.contacts import SOLES, ContactSettings, contacts_of
from motet.figures.humanoid import BONES, HUMANOID, LEFT_RIGHT, ground_under, sided, sole_points
from motet.motion.rotations import Array, quat_to_rotmat
from motet.settings import Range, Settings
from motet.steering.pose import Pose
from motet.steering.settings import HalfLife


@dataclass(frozen=True)
class ActSettings(Settings):
    """Settings of acts.

    blend: half-life of what the pose loses where an act begins or ends. far: where a bone turns by more than this, or
    the hips rise or fall by more than a tenth of it in metres, that takes as much longer, at most 1.75 times. entry:
    how much of an act may be left out to begin it at the pose that fits best, at most a third of it. rest: the
    beginning and the end of an act in which no joint is faster are left out.
    """

    FEATURE: ClassVar[str] = "acting"

    blend: HalfLife = 0.12
    far: Annotated[float, Range(0.01, 3.15, "rad")] = 0.7
    entry: Annotated[float, Range(0, 10, "s")] = 0.5
    rest: Annotated[float, Range(0, 100, "m/s")] = 0.25


SHORTEST = 3
"""Frames of an act."""

STANDS = float(HUMANOID.offsets[0, 1])
"""The height of the hips of a figure that stands straight."""

BENT, RAISED, TURNED = 0.25, 0.3, np.radians(150)
"""Metres between the highest and the lowest that hips are, or would be standing, metres above the ground of a ball of a
foot, and radians of a turn, beyond which an act is one of the legs."""

MOVES = 1.0
"""Seconds of an act of which the rest at both ends is left out: less is a pose that is held."""

WIDTH = 4 * len(BONES) + 4
"""Numbers of a frame: quaternions (x, y, z, w) of the bones, the hips' in the frame of the facing; x and z of the root
in metres, its facing in radians, and the height of the hips in metres."""

LARGEST = 1e4  # of these numbers


@dataclass(frozen=True, eq=False, repr=False)
class Act:
    """A motion that can be played by a figure that is steered, a frame in each of its ticks.

    rotations: (T, J, 4) unit quaternions of the bones, the hips' in the frame of the facing. height: (T,) of the hips.
    ground: (T, 3) x, z in metres and the facing in radians. contacts: (T, 2). features: (T, 21) how it is
    (:func:`pose_features`). All float64.
    """

    name: str
    rotations: Array
    height: Array
    ground: Array
    contacts: Array
    features: Array

    @staticmethod
    def of(name: str, numbers: Floats, fps: float, how: ActSettings) -> "Act":
        """The act of frames (T, :data:`WIDTH`), without what it rests at both ends. ControlError for fewer than
        :data:`SHORTEST` frames, and for numbers that are not finite or too large."""
        if numbers.ndim != 2 or numbers.shape[1] != WIDTH or len(numbers) < SHORTEST:
            raise ControlError(f"an act needs {SHORTEST} or more frames of {WIDTH} numbers, not {numbers.shape}")
        if not (np.abs(numbers) <= LARGEST).all():
            raise ControlError(f"an act must be finite numbers, no larger than {LARGEST:g}")
        values = numbers.astype(np.float64)
        quats, ground, height = values[:, :-4].reshape(len(values), -1, 4), values[:, -4:-1], values[:, -1]
        quats = quats / np.maximum(np.linalg.norm(quats, axis=2, keepdims=True), 1e-6)
        single = quats.astype(np.float32), height.astype(np.float32)
        turned, places = Pose(ground, *single, np.ones((len(ground), 2), np.float32)).global_transforms()
        contacts = foot_contacts(quat_to_rotmat(turned.astype(np.float64)), places, fps)
        speeds = np.linalg.norm(np.gradient(places, axis=0), axis=2).max(axis=1) * fps
        moving = np.flatnonzero(speeds > how.rest)
        moves = len(moving) > 0 and np.ptp(moving) >= round(MOVES * fps)
        within = slice(moving[0], moving[-1] + 1) if moves else slice(None)
        parts = quats, height, ground, contacts, pose_features(places, ground, fps)
        return Act(name, *(part[within] for part in parts))

    def __len__(self) -> int:
        """T."""
        return len(self.height)

    def __repr__(self) -> str:
        return f"Act({self.name!r}, {len(self)} frames)"

    @property
    def numbers(self) -> Floats:
        """Its frames (T, :data:`WIDTH`)."""
        quats = self.rotations.reshape(len(self), -1)
        return np.column_stack([quats, self.ground, self.height]).astype(np.float32)

    @cached_property
    def legs(self) -> bool:
        """Whether it is done by the legs: it bends them, jumps, raises a foot, or turns around."""
        balls, turned = self.features[:, [1, 4]], np.ptp(np.unwrap(self.ground[:, 2]))
        return bool(np.ptp([STANDS, *self.height]) > BENT or balls.max() > RAISED or turned > TURNED)

    @property
    def reach(self) -> float:
        """Metres from where it begins to where it ends."""
        return float(np.hypot(*(self.ground[-1] - self.ground[0])[:2]))

    def step(self, frame: int, facing: float) -> Array:
        """The move (3,) over the ground to a frame from the one before it, for a figure with a facing: x, z, turn."""
        before, after = self.ground[frame - 1], self.ground[frame]
        (x, z, turn), about = after - before, facing - before[2]
        cos, sin = np.cos(about), np.sin(about)
        return np.array([cos * x + sin * z, cos * z - sin * x, turn])


_TRACKED = ["hips", *(sided(side, part) for part in ("Toes", "Hand") for side in LEFT_RIGHT)]


def pose_features(places: Array, way: Array, fps: float) -> Array:
    """The features (T, 21) of how a figure is, not scaled: those after the trajectory's.

    places: (T, J', 3) of the humanoid's joints in the world. way: (T, 3) x, z and the facing.
    """
    points = places[:, [HUMANOID.index(joint) for joint in _TRACKED]]
    speeds = np.gradient(points, axis=0) * fps
    from_root = points - np.insert(way[:, None, :2], 1, 0.0, axis=2)
    now = np.concatenate([from_root[:, 1:3], speeds[:, 1:3], speeds[:, :1], from_root[:, 3:]], axis=1)
    for joint in range(now.shape[1]):
        now[:, joint, [0, 2]] = seen(now[:, joint][:, [0, 2]], way[:, 2])
    return now.reshape(len(now), -1)


def seen(vectors: Array, facing: Array) -> Array:
    """Vectors (T, 2) over the ground, x and z, as left and forward (T, 2) of a facing (T,)."""
    cos, sin = np.cos(facing), np.sin(facing)
    return np.stack([cos * vectors[:, 0] - sin * vectors[:, 1], sin * vectors[:, 0] + cos * vectors[:, 1]], axis=1)


def foot_contacts(turned: Array, places: Array, fps: float, settings: ContactSettings = SOLES) -> Array:
    """How much the left and the right foot stand (T, 2), 0 to 1, of rotations (T, J', 3, 3) and places (T, J', 3) of
    the humanoid's joints in the world."""
    soles = sole_points(turned, places)
    soles[..., 1] -= ground_under(soles)
    touch = contacts_of(soles, fps, settings).reshape(-1, 2, 3).max(axis=2)
    found: Array = np.concatenate([touch[:1], touch])
    return found
