"""Measures of crowds, on figures that walk straight to their points, or wait in files for those ahead."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from steer_puppets import FPS, resting

from motet.motion.rotations import Array
from motet.steering.pose import Pose
from motet_train.evaluate.steer import crowds


@dataclass(eq=False)
class Walkers:
    """Figures that go straight to their points at ``speed`` m/s, or stay where they are if they keep apart."""

    speed: float = 1.0
    fps: float = FPS

    def start(self, gait: str, characters: int, places: Array) -> "Session":
        assert len(places) == characters
        return Session(self, places.copy(), places[:, :2].copy())


@dataclass(eq=False)
class Session:
    model: Walkers
    places: Array
    points: Array
    room: float | None = None

    @property
    def characters(self) -> int:
        return len(self.places)

    def keep_apart(self, room: float | None) -> None:
        self.room = room

    def go_to(self, points: Array) -> None:
        self.points = points

    @property
    def arrived(self) -> Any:
        return np.linalg.norm(self.points - self.places[:, :2], axis=1) < 1e-6

    def tick(self) -> Pose:
        way = self.points - self.places[:, :2]
        far = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        step = np.minimum(self.model.speed / self.model.fps, far)
        if self.room is None:
            self.places[:, :2] += way / far * step
        return resting(self.places)


@pytest.fixture
def figures(monkeypatch: pytest.MonkeyPatch) -> dict[str, float]:
    """Of two that meet head on, each a metre from the middle; a second figure each is a metre beside it."""
    begins = np.array([[0.0, 1.0], [1.0, 1.0], [0.0, -1.0], [1.0, -1.0]])
    ways = (lambda rng: begins, np.array([1.0, -1.0]))
    monkeypatch.setattr(crowds, "CROWDS", {"pairs": ways})
    monkeypatch.setattr(crowds, "CROWD_SECONDS", 4.0)
    return crowds.crowd_figures(Walkers(), "pairs")  # type: ignore[arg-type]


def test_those_that_meet_are_near_while_they_pass(figures: dict[str, float]) -> None:
    # at 2 m/s towards each other they are within .4 m for .4 s of 4
    assert figures["free_near"] == pytest.approx(0.1, abs=0.02)
    assert figures["free_near_worst"] == figures["free_near"]
    assert figures["free_nearest_m"] == pytest.approx(0, abs=0.05)


def test_who_arrives_and_when(figures: dict[str, float]) -> None:
    assert figures["free_never"] == 0
    assert figures["free_s"] == pytest.approx(2, abs=0.05)
    assert figures["never"] == 4 * len(crowds.CROWD_SEEDS)
    assert figures["s"] == np.inf


def test_those_that_stay_are_as_near_as_they_began(figures: dict[str, float]) -> None:
    assert figures["near"] == 0
    assert figures["nearest_m"] == pytest.approx(1)


@pytest.mark.parametrize("crowd", crowds.CROWDS)
def test_figures_begin_with_room_and_go_to_where_there_is_room(crowd: str) -> None:
    begins, mirrors = crowds.CROWDS[crowd]
    for seed in range(20):
        places = begins(np.random.default_rng(seed))
        for spots in (places, mirrors * places):
            distances = np.linalg.norm(spots[:, None] - spots, axis=2) + 9 * np.eye(len(spots))
            assert distances.min() > crowds.ROOM
