"""Measures of figures on ground that is not flat: against puppets that float, sink and slide by known amounts."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from steer_puppets import FPS, resting

import motet
from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet_train.evaluate.steer import following, ground


@dataclass(eq=False)
class Rising:
    """Figures that stay in a pose, in which feet stand, and rise with their ground, and by ``more`` above it."""

    more: float = 0.0
    fps: float = FPS

    def start(self, gait: str, characters: int) -> "Session":
        return Session(self, np.zeros((characters, 3)))


@dataclass(eq=False)
class Session:
    model: Rising
    places: Array
    height: Any = None
    speed: float = 0.0

    def put(self, places: Array) -> None:
        self.places = places

    def set_ground(self, height: Any) -> None:
        self.height = height

    def control(self, speed: float, direction: float) -> None:
        self.speed = speed

    def tick(self) -> Pose:
        pose = resting(self.places)
        under = self.height(pose.ground[:, 0], pose.ground[:, 1])
        return Pose(
            pose.ground,
            pose.rotations,
            (pose.height + under + self.model.more).astype(np.float32),
            np.ones((len(self.places), 2), np.float32),
        )


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "SETTLE", 0.2)
    monkeypatch.setattr(ground, "SETTLE", 0.2)
    monkeypatch.setattr(ground, "GROUND_SECONDS", 1.0)


@pytest.mark.parametrize("more", [0.0, 0.03])
def test_how_far_soles_are_above_their_ground(more: float) -> None:
    level = ground.ground_figures(Rising(), "flat", "walk")  # type: ignore[arg-type]
    figures = ground.ground_figures(Rising(more), "flat", "walk")  # type: ignore[arg-type]
    assert figures["off_cm"] == pytest.approx(abs(level["off_cm"] + 100 * more), abs=0.05)
    assert figures["slide_cm"] == pytest.approx(0, abs=1e-3)
    assert figures["turn"] == 0
    assert figures["hips"] == pytest.approx(0, abs=1e-3)


def test_soles_that_stay_level_are_off_a_slope() -> None:
    # a sole of 20 cm that is level on a slope of 20 degrees under the hips has its lower end in the ground
    level = ground.ground_figures(Rising(), "flat", "walk")["off_cm"]  # type: ignore[arg-type]
    assert ground.ground_figures(Rising(), "up", "walk")["off_cm"] > level + 2  # type: ignore[arg-type]


def test_the_shipped_model_meets_the_goals_on_stairs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ground, "GROUND_SECONDS", 3.0)
    model: SteerModel = motet.load("control")
    figures = ground.ground_figures(model, "stairs_up", "walk")
    assert figures["off_cm"] < 1
    assert figures["slide_cm"] < 3
    assert figures["turn"] < 35
