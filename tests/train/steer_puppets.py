"""Figures that do what they are told in a known way, in place of a model that is steered."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from motet.figures.humanoid.bones import BONES
from motet.steering.pose import Pose

FPS = 30.0

Bend = Callable[[Pose, int], Pose]
"""What else becomes of a pose in a tick."""


@dataclass(eq=False)
class Puppets:
    """In place of a model. gain: how fast they go, of what they are told. turning: degrees a second by which the
    direction of travel comes to where it is told. askew: degrees by which they then face elsewhere. late: seconds until
    they go as fast as they are told.
    """

    gain: float = 1.0
    turning: float = 1e6
    askew: float = 0.0
    late: float = 0.0
    bend: Bend = lambda pose, tick: pose
    fps: float = FPS
    gaits: tuple[str, ...] = ("walk", "run")

    @property
    def speeds(self) -> dict[str, tuple[float, float]]:
        return dict.fromkeys(self.gaits, (0.0, 4.0))

    def start(self, gait: str = "walk", characters: int = 1, hold_feet: bool = True) -> "Session":
        return Session(self, np.zeros((characters, 3)), *np.zeros((4, characters)))


@dataclass(eq=False)
class Session:
    model: Puppets
    ground: Any
    speed: Any
    wanted: Any
    way: Any
    before: Any
    ticks: int = 0
    since: int = 0

    def control(self, *, speed: Any, direction: Any, facing: Any = None, gait: Any = None) -> None:
        self.before, self.since = self.speed, self.ticks
        self.speed, self.wanted = speed * np.ones(len(self.ground)), direction * np.ones(len(self.ground))
        self.ground[:, 2] = np.radians((self.wanted if facing is None else facing) + self.model.askew)

    @property
    def target(self) -> Any:
        way = np.radians(self.wanted)
        return np.stack([self.speed * np.sin(way), self.speed * np.cos(way), self.ground[:, 2]], axis=1)

    def tick(self) -> Pose:
        off = (self.wanted - self.way + 180) % 360 - 180
        most = self.model.turning / self.model.fps
        self.way = self.way + np.clip(off, -most, most)
        waits = self.ticks - self.since < self.model.late * self.model.fps
        pace = (self.before if waits else self.speed) * self.model.gain / self.model.fps
        self.ground[:, 0] += pace * np.sin(np.radians(self.way))
        self.ground[:, 1] += pace * np.cos(np.radians(self.way))
        self.ticks += 1
        return self.model.bend(resting(self.ground), self.ticks)


def resting(ground: Any) -> Pose:
    """The T-pose at places (B, 3), soles on the ground."""
    count = len(ground)
    rotations = np.tile(np.array([0, 0, 0, 1], np.float32), (count, len(BONES), 1))
    contacts = np.ones((count, 2), np.float32)
    return Pose(np.array(ground, dtype=np.float64), rotations, np.full(count, 0.98, np.float32), contacts)


def turned(pose: Pose, bone: str, degrees: float) -> Pose:
    """A pose in which one bone is turned about its x axis."""
    rotations, half = pose.rotations.copy(), np.radians(degrees) / 2
    rotations[:, BONES.index(bone)] = [np.sin(half), 0, 0, np.cos(half)]
    return replace(pose, rotations=rotations)
