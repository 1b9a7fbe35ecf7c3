"""What is predicted for half a minute: which recordings are gone on with, and the figures of puppets that are known."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from motet.figures.humanoid.bones import HUMANOID
from motet.motion.motion import Motion
from motet_train.evaluate.predict.liveliness import SPANS, Trajectory, alive_table, figures, gait, going, measured
from motet_train.evaluate.tables import json_ready

FPS = 30.0
CHANNELS = ("hips.tx", "hips.ty", "hips.tz", "leftUpperLeg.rx", "rightUpperLeg.rx")


def puppet(seconds: float, speed: float, swing: float = 20.0, start: float = 0.0) -> Motion:
    """The humanoid, which glides along z at a speed from a moment on and swings its legs."""
    time = start + np.arange(round(seconds * FPS)) / FPS
    zero, legs = np.zeros_like(time), swing * np.sin(6 * time)
    values = np.column_stack([zero, zero + 0.98, speed * time, legs, -legs])
    return Motion(values, CHANNELS, ("m",) * 3 + ("deg",) * 2, FPS, HUMANOID)


def seen(*parts: Motion) -> Trajectory:
    return Trajectory(np.concatenate([Trajectory.of(part).points for part in parts]), FPS)


@pytest.mark.parametrize(
    ("seconds", "speed", "kind"),
    [(3, 1.2, "walks"), (1.2, 1.2, "walks"), (0.8, 1.2, None), (3, 0.45, None), (3, 2.1, "runs"), (3, 0.0, None)],
)
def test_who_goes_walks_or_runs(seconds: float, speed: float, kind: str | None) -> None:
    assert gait(Trajectory.of(puppet(seconds, speed))) == kind


def test_who_stops_at_the_end_does_not_go_but_who_stood_before_does() -> None:
    stands = puppet(0.6, 0.0)
    walks = puppet(4, 1.2)
    assert gait(seen(walks, stands)) is None
    assert gait(seen(stands, stands, walks)) == "walks"


def test_recordings_that_the_writer_knows_are_left_out() -> None:
    trials = {"1_1": puppet(3, 1.0), "1_2": puppet(3, 3.0), "2_1": puppet(3, 1.0), "3_1": puppet(3, 0.0)}

    def names(**training: Any) -> dict[str, list[str]]:
        writer: Any = SimpleNamespace(manifest=SimpleNamespace(training=training))
        return {kind: list(found) for kind, found in going(trials, writer).items()}

    assert names() == {"walks": ["1_1", "2_1"], "runs": ["1_2"]}
    assert names(split={"test": ["1_1.1", "1_1.2", "1_2", "3_1"]}) == {"walks": ["1_1"], "runs": ["1_2"]}


def test_the_figures_of_a_puppet_are_known() -> None:
    given = Trajectory.of(puppet(3, 1.0))

    def followed(speed: float, swing: float) -> Trajectory:
        points = Trajectory.of(puppet(30, speed, swing, start=3.0)).points
        points[..., 2] += given.points[-1, 0, 2] + speed / FPS - points[0, 0, 2]
        return Trajectory(np.concatenate([given.points[-1:], points]), FPS)

    same, slow = followed(1.0, 20.0), followed(0.8, 10.0)
    found = figures([(given, same), (given, same), (given, slow)])
    for start, stop in SPANS:
        key = f"{start}_{stop}_s"
        assert found[f"speed_{key}"] == pytest.approx(1.0, abs=1e-6)
        assert found[f"kept_{key}"] == pytest.approx(2 / 3)
        assert found[f"energy_{key}"] == pytest.approx(1.0, abs=0.25 if stop == 1 else 0.05)
    halved = figures([(given, slow)])
    assert halved["speed_5_30_s"] == pytest.approx(0.8)
    assert halved["energy_5_30_s"] == pytest.approx(0.5, abs=0.03)
    assert halved["kept_5_30_s"] == 0.0


def fake_model() -> Any:
    """A predictor that stops, or that goes on at 1.1 times the speed where there is a writer; its samples go 0, 1 and 2
    metres to the side."""

    def beyond(motion: Motion, frames: int, aside: float) -> Motion:
        speed = 1.1 * (motion.values[-1, 2] - motion.values[-2, 2]) * FPS
        found = puppet(frames / FPS, speed)
        values = found.values + np.array([aside, 0, motion.values[-1, 2] + speed / FPS, 0, 0])
        return Motion(values, CHANNELS, found.units, FPS, HUMANOID)

    def predict(motion: Motion, frames: int, beyond: Any) -> Motion:
        last = Motion(np.repeat(motion.values[-1:], frames, axis=0), CHANNELS, motion.units, FPS, HUMANOID)
        return last if beyond is None else go(motion, frames, 0.0)

    go = beyond
    return SimpleNamespace(
        fps=FPS, predict=predict, futures=lambda m, frames, beyond, samples: [go(m, frames, i) for i in range(samples)]
    )


def test_all_systems_stand_beside_each_other() -> None:
    writer: Any = SimpleNamespace(manifest=SimpleNamespace(training={}))
    found = measured(fake_model(), writer, {"a": puppet(3, 1.0), "b": puppet(3, 1.3), "c": puppet(3, 0.1)})
    report = found["walks"]
    assert set(found) == {"walks"}
    assert report["recorded"]["recordings"] == 2
    for start, stop in SPANS:
        speeds = [report[system][f"speed_{start}_{stop}_s"] for system in ("still", "alone", "beyond")]
        assert speeds == [0.0, pytest.approx(0.0), pytest.approx(1.1)]
        assert [report[system][f"kept_{start}_{stop}_s"] for system in ("still", "alone", "beyond")] == [0.0, 0.0, 1.0]
    assert report["samples"]["place_cm_1_s"] == pytest.approx(100 * 4 / 3)  # 1, 1 and 2 metres
    assert report["samples"]["pose_cm_5_s"] == pytest.approx(0.0)
    table = alive_table({"runs/some": found})
    assert "2 walks continued; after 0-1, 1-5, 5-30 s" in table
    (line,) = (line for line in table.splitlines() if "some, then the writer" in line)
    assert "1.10  1.10  1.10" in line
    (line,) = (line for line in table.splitlines() if "some after 1, 5 s" in line)
    assert line.split()[-4:] == ["133", "133", "0", "0"]
    assert json.loads(json.dumps(json_ready(report)))["samples"]["place_cm_1_s"] == pytest.approx(133.333)


def test_where_nothing_goes_there_is_no_table() -> None:
    writer: Any = SimpleNamespace(manifest=SimpleNamespace(training={}))
    assert measured(fake_model(), writer, {"a": puppet(3, 0.0)}) == {}
    assert alive_table({"some": {}}) == ""
