"""Measures of acts, points and paths, on figures that do what they are told in a known way."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from steer_puppets import FPS, resting

from motet.figures.humanoid.bones import BONES
from motet.steering.acts import Act, ActSettings
from motet.steering.pose import Pose
from motet_train.evaluate.steer import following, paths
from motet_train.evaluate.steer.commands import act_figures, begins, from_path, going_figures
from motet_train.evaluate.steer.paths import chase_figures, path_figures, slow_point_figures

ARM = BONES.index("leftUpperArm")


def raised(degrees: Any, count: int = 1) -> Any:
    """Rotations (T, J, 4) of the T-pose with an arm turned."""
    half = np.radians(np.broadcast_to(degrees, (count,))) / 2
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (count, len(BONES), 1))
    turns[:, ARM, 2:] = np.stack([np.sin(half), np.cos(half)], axis=1)
    return turns


def act_of(degrees: Any) -> Act:
    """An act that turns an arm, a frame each."""
    turns, count = raised(degrees, len(degrees)).reshape(len(degrees), -1), len(degrees)
    numbers = np.column_stack([turns, np.zeros((count, 3)), np.full(count, 0.98)])
    return Act.of("raise", numbers.astype(np.float32), FPS, ActSettings(rest=0.0))


@dataclass(eq=False)
class Told:
    """A model of figures that act at once, or ``late`` ticks after, and go straight to points at ``pace`` m/s, but
    stand ``short`` metres before them."""

    late: int = 0
    pace: float = 2.0
    short: float = 0.0
    fps: float = FPS

    @property
    def usual(self) -> dict[str, float]:
        return {"walk": 2.0}

    def start(self, gait: str | None = None, characters: int = 1, places: Any = None) -> "Session":
        return Session(self, np.zeros((characters, 3)))


@dataclass(eq=False)
class Session:
    model: Told
    ground: Any
    path: Any = None
    acts: list[Act] = field(default_factory=list)
    frame: int = -1

    def control(self, **_: Any) -> None:
        pass

    def act(self, acts: list[Act]) -> None:
        self.acts = acts

    def go_to(self, points: Any, speed: float | None = None) -> None:
        self.path = [points]

    def go_along(self, points: Any, gait: str | None = None) -> None:
        self.path = list(np.atleast_3d(points.T).T.swapaxes(0, 1))

    @property
    def acting(self) -> Any:
        return [("raise", (len(act) - 1 - self.frame) / FPS) if self.frame < len(act) else None for act in self.acts]

    @property
    def arrived(self) -> Any:
        return np.full(len(self.ground), len(self.path) == 0)

    def tick(self) -> Pose:
        if self.path:
            off = self.path[0] - self.ground[:, :2]
            far = np.hypot(*off.T)[:, None]
            least = self.model.short if len(self.path) == 1 else 0.0
            self.ground[:, :2] += off / far.clip(1e-9) * np.minimum(self.model.pace / FPS, (far - least).clip(0))
            if (far < least + 1e-6).all():
                self.path = self.path[1:]
        pose = resting(self.ground)
        if self.acts:
            self.frame += 1
            for k, act in enumerate(self.acts):
                if self.model.late <= self.frame < len(act):
                    pose.rotations[k] = act.rotations[self.frame]
        return pose


def test_an_act_has_begun_half_way() -> None:
    act = act_of(np.full(40, 80.0))
    shown = np.concatenate([raised(0.0), raised(np.arange(1, 81, 4.0), 20), raised(80.0, 20)])
    # more than 40 of 80 degrees are turned in the eleventh tick, and frames before the first one do not count
    assert begins(act, shown, range(1, 35)) == 11
    assert begins(act, np.repeat(shown[:1], 41, axis=0), range(1, 35)) == np.inf


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "PHASES", 1)
    monkeypatch.setattr(following, "SETTLE", 0.2)


def test_leaps_are_what_neither_recordings_nor_acts_have() -> None:
    acts: Any = [act_of(np.linspace(60, 70, 40)), act_of(np.linspace(90, 100, 30))]
    limits = np.full(27, 0.02)
    found = act_figures(Told(late=6), acts, limits, "walk")
    assert found["begun"] == found["begun_worst"] == pytest.approx(7 / FPS)
    # each arm leaps up once, and back when its act is over
    assert found["leaps"] == 4
    assert found["largest_leap"] > 10
    calm = act_figures(Told(late=6), acts, np.full(27, 2.0), None)
    assert calm["leaps"] == 0
    assert calm["largest_leap"] < 1


def test_figures_that_stand_before_their_points_are_off() -> None:
    found = going_figures(Told(short=0.03), "walk")
    assert found["never"] == 0
    assert [found["off_cm"], found["off_worst_cm"], found["path_end_cm"]] == pytest.approx([3, 3, 3], abs=1e-3)
    assert found["path_p95_cm"] == pytest.approx(0, abs=1e-6)
    assert going_figures(Told(pace=0.25), "walk")["never"] == 32  # 14 s are too short for the farthest


def test_ends_of_paths_are_reached_late_or_never(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "PATH_SECONDS", 12.0)
    usual = path_figures(Told(), "walk")
    assert usual["zigzag_never"] == usual["circles_never"] == 0
    # corners end ticks early
    assert 0 <= usual["zigzag_late_s"] == usual["zigzag_late_worst_s"] < 7 / FPS
    assert usual["zigzag_p95_cm"] == pytest.approx(0, abs=1e-6)
    slow = path_figures(Told(pace=1.0), "walk")
    assert slow["zigzag_late_s"] == pytest.approx(paths.length(np.diff(paths.ZIGZAG, axis=0)).sum() / 2, abs=7 / FPS)
    still = path_figures(Told(pace=0.0), "walk")
    assert (still["polylines_never"], still["polylines_late_s"]) == (40, np.inf)
    assert still["circles_cm"] == 0


def test_points_are_reached_on_the_shortest_way_or_not_and_chased() -> None:
    straight = slow_point_figures(Told())
    assert (straight["never"], straight["long_way"]) == (0, 0)
    assert straight["way_worst"] == pytest.approx(1, abs=0.3)  # but for the first tick
    assert chase_figures(Told())["behind_worst_m"] < 0.05
    assert chase_figures(Told(pace=0.0))["behind_m"] == pytest.approx(2)


def test_how_far_a_path_is_left() -> None:
    corners = np.array([[0.0, 0.0], [0.0, 4.0], [4.0, 4.0]])
    places = np.array([[0.1, 2.0], [-0.3, 4.4], [2.0, 3.5], [5.0, 4.0]])
    np.testing.assert_allclose(from_path(places, corners), [0.1, 0.5, 0.5, 1.0])
