"""Measures of joints that jump, on figures whose arm turns in a known way."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from steer_puppets import FPS, resting
from test_steer_commands import ARM, act_of, raised

from motet.steering.acts import Act
from motet.steering.pose import Pose
from motet_train.evaluate.steer import following, limbs


@dataclass(eq=False)
class Arms:
    """A model of figures whose arm is as the name of their act says, and ``jump`` degrees higher with a point ahead."""

    jump: float = 0.0
    fps: float = FPS

    def start(self, gait: str | None = None, characters: int = 1) -> "Session":
        return Session(self, np.zeros(characters), np.zeros((characters, 3)))


@dataclass(eq=False)
class Session:
    model: Arms
    degrees: Any
    points: Any
    cut: list[int] = field(default_factory=list)
    tick_number: int = 0

    def control(self, **_: Any) -> None:
        pass

    def act(self, acts: list[Act], ids: list[int] | None = None) -> None:
        self.degrees[ids if ids is not None else slice(None)] = [len(act) for act in acts]
        self.cut += ids or []

    def reach(self, hand: str, points: Any) -> None:
        assert hand == "left"
        self.points = points

    def tick(self) -> Pose:
        self.tick_number += 1
        pose = resting(np.zeros((len(self.degrees), 3)))
        rotations = np.stack(
            [raised(degrees)[0] for degrees in self.degrees + self.model.jump * (self.points[:, 2] > 0)]
        )
        return Pose(pose.ground, rotations.astype(np.float32), pose.height, pose.contacts)


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "SETTLE", 0.1)
    monkeypatch.setattr(limbs, "SHOWN", 0.2)


def test_every_act_is_cut_by_every_act_at_ticks_of_its_own(monkeypatch: pytest.MonkeyPatch) -> None:
    sessions = []
    start = Arms.start
    monkeypatch.setattr(Arms, "start", lambda *a, **k: sessions.append(start(*a, **k)) or sessions[-1])
    acts = [act_of(np.linspace(0, 19, count)) for count in (20, 50)]
    figures = limbs.cut_figures(Arms(), acts, "walk")  # type: ignore[arg-type]
    assert sorted(sessions[0].cut) == [0, 1, 2, 3]
    assert sessions[0].degrees.tolist() == [20, 50, 20, 50]
    assert figures["turn"] == pytest.approx(50, abs=1e-3)  # where the longer act is begun
    assert figures["acts"] == pytest.approx(1, abs=1e-3)
    assert figures["velocity"] > 0
    assert limbs.cut_figures(Arms(), acts[:1], None)["turn"] == pytest.approx(20, abs=1e-3)  # type: ignore[arg-type]


def test_hands_reach_for_points_ahead_and_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limbs, "REACHED_POINTS", 12)
    assert limbs.reach_figures(Arms(jump=40.0))["turn"] == pytest.approx(40, abs=1e-3)  # type: ignore[arg-type]
    assert limbs.reach_figures(Arms())["turn"] == 0  # type: ignore[arg-type]
    assert ARM > 0
