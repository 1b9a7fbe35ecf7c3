"""Acts: short motions of the humanoid that a steered figure can play (:mod:`motet.steering.action_layer`).

Letters in shapes: T frames, J bones, J' joints, F features as in :mod:`motet.steering.matching`.
"""

from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import ControlError
from motet.figures.feet.contacts import SOLES, ContactSettings, contacts_of
from motet.figures.humanoid import BONES, HUMANOID, ground_under, sole_points
from motet.motion.rotations import Array, quat_to_rotmat
from motet.settings import Range, Settings
from motet.steering.pose import Pose, seen
from motet.steering.settings import HalfLife, Metres, Radians


@dataclass(frozen=True)
class ActSettings(Settings):
    """Settings of acts."""

    FEATURE: ClassVar[str] = "acting"

    blend: HalfLife = 0.12
    """Half-life of the inertialization offset where an act begins or ends."""
    far: Annotated[float, Range(0.01, 3.15, "rad")] = 0.7
    """Largest turn of a bone that is blended in that time; larger ones take proportionally longer."""
    height_weight: Annotated[float, Range(0, 100, "rad/m")] = 10.0
    """Weight of hip height against rotation."""
    longest: Annotated[float, Range(1, 10)] = 1.75
    """Largest stretch of the blend time."""
    entry: Annotated[float, Range(0, 10, "s")] = 0.5
    """How much of an act may be skipped to begin it at the pose that fits best, at most a third of it."""
    rest: Annotated[float, Range(0, 100, "m/s")] = 0.25
    """The beginning and the end of an act are left out where no joint is faster than this."""
    moves: Annotated[float, Range(0, 10, "s")] = 1.0
    """Shortest movement of an act whose rest is left out; a shorter one is a held pose."""
    bent: Metres = 0.25
    """An act is one of the legs where the heights of the hips, and of a straight stance, differ by more than this,"""
    raised: Metres = 0.3
    """or the ball of a foot is higher than this above the ground,"""
    turned: Radians = float(np.radians(150))
    """or the figure turns by more than this."""


LEAST_ACT_FRAMES = 3
"""Frames of an act."""

STANDING_HIPS = float(HUMANOID.offsets[0, 1])
"""Height of the hips of a figure that stands straight."""

WIDTH = 4 * len(BONES) + 4
"""Numbers of a frame: quaternions (x, y, z, w) of the bones, the hips' in the frame of the facing; x and z of the root
in metres, its facing in radians, and the height of the hips in metres."""

LARGEST_COORDINATE = 1e4  # of these numbers


@dataclass(frozen=True, eq=False, repr=False)
class Act:
    """A motion that can be played by a steered figure, a frame in each of its ticks. All arrays float64."""

    name: str
    rotations: Array
    """(T, J, 4) unit quaternions of the bones, the hips' in the frame of the facing."""
    height: Array
    """(T,) of the hips."""
    ground: Array
    """(T, 3) x, z in metres and the facing in radians."""
    contacts: Array
    """(T, 2) of the left and the right foot."""
    features: Array
    """(T, 21) of the pose (:func:`pose_features`)."""
    legs: bool
    """Whether it is done by the legs: it bends them, jumps, raises a foot, or turns around."""

    @staticmethod
    def of(name: str, numbers: Floats | Array, fps: float, settings: ActSettings) -> "Act":
        """The act of frames (T, :data:`WIDTH`), without the rest at both ends. ControlError for fewer than
        :data:`LEAST_ACT_FRAMES` frames, and for numbers that are not finite or too large."""
        values = _checked(numbers)
        quats = values[:, :-4].reshape(len(values), -1, 4)
        quats = quats / np.maximum(np.linalg.norm(quats, axis=2, keepdims=True), 1e-6)
        ground = values[:, -4:-1]
        height = values[:, -1]
        # where joints are, and what follows from that
        features, contacts, kept = _measured(quats, height, ground, fps, settings)
        # without the rest at both ends
        legs = _uses_legs(height[kept], ground[kept], features[kept], settings)
        return Act(name, quats[kept], height[kept], ground[kept], contacts[kept], features[kept], legs)

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

    @property
    def reach(self) -> float:
        """Metres from where it begins to where it ends."""
        return float(np.hypot(*(self.ground[-1] - self.ground[0])[:2]))

    def step(self, frame: int, facing: float) -> Array:
        """The move (3,) over the ground to a frame from the one before it, for a figure with a facing: x, z, turn."""
        before = self.ground[frame - 1]
        x, z, turn = self.ground[frame] - before
        angle = facing - before[2]
        cos = np.cos(angle)
        sin = np.sin(angle)
        return np.array([cos * x + sin * z, cos * z - sin * x, turn])


def _checked(numbers: Floats | Array) -> Array:
    """Frames (T, :data:`WIDTH`) in float64; ControlError if they are no act."""
    if numbers.ndim != 2 or numbers.shape[1] != WIDTH or len(numbers) < LEAST_ACT_FRAMES:
        raise ControlError(f"an act needs {LEAST_ACT_FRAMES} or more frames of {WIDTH} numbers, not {numbers.shape}")
    if not (np.abs(numbers) <= LARGEST_COORDINATE).all():
        raise ControlError(f"an act must be finite numbers, no larger than {LARGEST_COORDINATE:g}")
    return numbers.astype(np.float64)


def _measured(
    quats: Array, height: Array, ground: Array, fps: float, settings: ActSettings
) -> tuple[Array, Array, slice]:
    """The features and contacts of all frames, and the frames without the rest at both ends."""
    both_stand = np.ones((len(height), 2), np.float32)
    pose = Pose(ground, quats.astype(np.float32), height.astype(np.float32), both_stand)
    turned, places = pose.global_transforms()
    contacts = foot_contacts(quat_to_rotmat(turned.astype(np.float64)), places, fps)
    return pose_features(places, ground, fps), contacts, _moving_part(places, fps, settings)


def _moving_part(places: Array, fps: float, settings: ActSettings) -> slice:
    """The frames (T, J', 3) of an act without the rest at both ends."""
    speeds = np.linalg.norm(np.gradient(places, axis=0), axis=2).max(axis=1) * fps
    moving = np.flatnonzero(speeds > settings.rest)
    if len(moving) > 0 and np.ptp(moving) >= round(settings.moves * fps):
        return slice(moving[0], moving[-1] + 1)
    return slice(None)


def _uses_legs(height: Array, ground: Array, features: Array, settings: ActSettings) -> bool:
    """Whether an act bends the legs, jumps, raises a foot, or turns around."""
    bends = np.ptp([STANDING_HIPS, *height]) > settings.bent
    raises = features[:, [1, 4]].max() > settings.raised
    turns = np.ptp(np.unwrap(ground[:, 2])) > settings.turned
    return bool(bends or raises or turns)


_TRACKED = ("hips", "leftToes", "rightToes", "leftHand", "rightHand")


def pose_features(places: Array, way: Array, fps: float) -> Array:
    """The features (T, 21) of poses, not scaled: those after the trajectory's.

    places: (T, J', 3) of the humanoid's joints in the world. way: (T, 3) x, z and the facing.
    """
    points = places[:, [HUMANOID.index(joint) for joint in _TRACKED]]
    speeds = np.gradient(points, axis=0) * fps
    from_root = points - np.insert(way[:, None, :2], 1, 0.0, axis=2)
    now = np.concatenate([from_root[:, 1:3], speeds[:, 1:3], speeds[:, :1], from_root[:, 3:]], axis=1)
    for joint in range(now.shape[1]):
        now[:, joint, [0, 2]] = seen(now[:, joint][:, [0, 2]], way[:, 2])
    return now.reshape(len(now), -1)


def foot_contacts(turned: Array, places: Array, fps: float, settings: ContactSettings = SOLES) -> Array:
    """Contacts of the left and the right foot (T, 2), 0 to 1, of rotations (T, J', 3, 3) and places (T, J', 3) of
    the humanoid's joints in the world."""
    soles = sole_points(turned, places)
    soles[..., 1] -= ground_under(soles)
    touch = contacts_of(soles, fps, settings).reshape(-1, 2, 3).max(axis=2)
    contacts: Array = np.concatenate([touch[:1], touch])
    return contacts
