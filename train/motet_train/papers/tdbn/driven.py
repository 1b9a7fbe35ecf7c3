"""A net of the thesis' family, steered as a figure of motion matching is, so that the same measures see it.

Each tick a small rule turns speed, direction and facing into the six control values of the net
(:mod:`motet_train.papers.tdbn.courses`): the velocity as the figure sees it, and a turn by how far its facing is off.
What the net says of the velocities of the root is where the figure goes.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from motet.bundle.graph import Floats
from motet.models.tdbn_control import TdbnModel
from motet.motion.feet.contacts import ContactSettings, standing
from motet.motion.feet.lock import FootLock
from motet.motion.humanoid import sole_points
from motet.motion.pose import Pose
from motet.motion.rotations import Array, quat_to_rotmat, rotmat_to_quat, wrapped
from motet.representation.root_sixd import ROOT_SIXD, sixd_to_rotmat
from motet_train.papers.tdbn.courses import LABELS, controls_of

TURN_RATE = 3.0
"""1/s: how fast a figure is told to turn, for each radian that its facing is off."""

SOLE_CONTACTS = ContactSettings(heights=(0.03, 0.03))
"""A foot stands, for the foot lock, by the height of its lowest point: the net says nothing of contacts."""

GAIT_SPEEDS = {"walk": (0.3, 1.8), "run": (1.8, 4.0)}
"""m/s. The net has no gaits: it walks or runs as the speed asks."""


@dataclass(frozen=True, eq=False)
class Driven:
    """A control model with the labels of :mod:`motet_train.papers.tdbn.courses`, to be measured in place of
    :class:`motet.models.steer.SteerModel`: the part of it that measures use."""

    model: TdbnModel
    gaits: tuple[str, ...] = tuple(GAIT_SPEEDS)

    @staticmethod
    def fits(model: TdbnModel) -> bool:
        """Whether a model is such a net."""
        return model.labels == LABELS and model.contract.representation == "root_sixd"

    @property
    def fps(self) -> float:
        """Ticks a second."""
        return self.model.fps

    @property
    def speeds(self) -> dict[str, tuple[float, float]]:
        """The slowest and the fastest that each gait is asked for, m/s."""
        return GAIT_SPEEDS

    def start(self, start: str | None = None, *, characters: int = 1, hold_feet: bool = True) -> "DrivenSession":
        """A session of figures that stand, whatever the gait. hold_feet: with the foot lock."""
        return DrivenSession(self.model, characters, hold_feet)


class DrivenSession:
    """Figures that are told what :class:`motet.models.steer_session.SteerSession` is told."""

    def __init__(self, model: TdbnModel, characters: int, hold_feet: bool) -> None:
        self.session, self.fps = model.start(characters=characters), model.fps
        self.ground = np.zeros((characters, 3))
        self.told = np.zeros((3, characters))
        self.lock = FootLock(characters, 1 / self.fps) if hold_feet else None

    def control(
        self,
        *,
        gait: str | Sequence[str] | None = None,
        speed: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        facing: ArrayLike | None = None,
    ) -> None:
        """As a steered figure is told; the gait says nothing to the net."""
        if speed is not None:
            self.told[0] = speed
        for row, angles in ((1, direction), (2, direction if facing is None else facing)):
            if angles is not None:
                self.told[row] = np.radians(angles)

    @property
    def target(self) -> Array:
        """What the figures were told (B, 3): velocity along x and z, m/s, and facing, radians."""
        speed, direction, facing = self.told
        return np.stack([speed * np.sin(direction), speed * np.cos(direction), facing], axis=1)

    def tick(self) -> Pose:
        """The next pose of all figures."""
        speed, direction, facing = self.told
        aside, off = direction - self.ground[:, 2], wrapped(facing - self.ground[:, 2])
        velocities = np.stack([speed * np.cos(aside), speed * np.sin(aside), TURN_RATE * off], axis=-1)
        self.session.set_control(controls_of(velocities))
        pose = self.pose(self.session.step())
        return pose if self.lock is None else self.lock.held(pose)

    def pose(self, frames: Floats) -> Pose:
        """The pose of frames (B, D), one tick after the last."""
        values = frames.astype(np.float64)
        self.ground = moved(self.ground, values[:, : len(ROOT_SIXD) - 1] / self.fps)
        quats = rotmat_to_quat(sixd_to_rotmat(values[:, len(ROOT_SIXD) :].reshape(len(values), -1, 6)))
        flat = np.zeros((len(values), 2), dtype=np.float32)
        pose = Pose(self.ground, quats.astype(np.float32), frames[:, len(ROOT_SIXD) - 1], flat)
        return Pose(pose.ground, pose.rotations, pose.height, _contacts(pose))


def moved(ground: Array, steps: Array) -> Array:
    """Places (B, 3), x, z and facing, after steps (B, 3), forward, to the left and turned, as the figures see them."""
    forward, left, turn = steps.T
    sin, cos = np.sin(ground[:, 2]), np.cos(ground[:, 2])
    found: Array = ground + np.stack([forward * sin + left * cos, forward * cos - left * sin, turn], axis=-1)
    return found


def _contacts(pose: Pose) -> Floats:
    """Which feet (B, 2) stand, by how high their soles are."""
    turned, places = (part.astype(np.float64) for part in pose.global_transforms())
    heights = sole_points(quat_to_rotmat(turned), places)[..., 1].reshape(len(pose), 2, 3).min(axis=2)
    return standing(heights, None, SOLE_CONTACTS).astype(np.float32)
