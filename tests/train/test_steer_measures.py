"""Measures of figures that are steered, on figures that do what they are told in a known way."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from steer_puppets import FPS, Puppets, resting, turned

from motet import to_humanoid
from motet.figures.humanoid.bones import BONES, HUMANOID
from motet.formats import read_motion
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.representation.contract import named
from motet.steering.pose import Pose
from motet.steering.recorded import Recording
from motet.steering.rows import rows_of
from motet.steering.settings import SteeringSettings
from motet_train.data.cmu_trials import CMU_FOLDER
from motet_train.evaluate.positions import mean_and_tail, slides
from motet_train.evaluate.steer import following
from motet_train.evaluate.steer.following import (
    CHANGED_SPEEDS,
    Track,
    aside_errors,
    creep_errors,
    joint_steps,
    speed_errors,
    standing,
    stretches,
    tracks_of,
    turn_errors,
    ways_errors,
)
from motet_train.evaluate.steer.players import STEERED_FIGURES, reversal_figures, stick_figures
from motet_train.evaluate.steer.report import Limits, Watch, astray, broken, frozen, turns, wandering, watched

puppets: Any = Puppets


@pytest.fixture(scope="module")
def walk() -> Motion:
    features = named("root_sixd").features(to_humanoid(read_motion(CMU_FOLDER / "39_14.amc")).motion.resample(FPS))
    return named("root_sixd").planted(features)


@pytest.fixture(scope="module")
def track(walk: Motion) -> Track:
    found = [Recording(walk, frozenset({"walk"}))] * 2
    return tracks_of(found, rows_of(found, ("walk",), SteeringSettings()))[1]


def test_a_track_is_where_the_recording_is(walk: Motion, track: Track) -> None:
    np.testing.assert_allclose(track.places[:, 0], positions(named("root_sixd").motion(walk)), atol=1e-4)
    assert len(track[5:9]) == 4
    moved = track.places - track.ground[:, :, None, [0, 2, 1]] * (1, 0, 1)
    np.testing.assert_allclose(
        np.linalg.norm(moved, axis=3), np.linalg.norm(track.in_place().places, axis=3), atol=1e-4
    )


def test_soles_are_under_the_feet(track: Track) -> None:
    balls = track.places[..., [HUMANOID.index(f"{side}Toes") for side in ("left", "right")], :]
    # the second point of each sole is that under the ball
    np.testing.assert_allclose(np.linalg.norm(track.soles[:, :, [1, 4]] - balls, axis=-1), 0.02, atol=1e-4)


def test_a_root_that_goes_too_far_slides_the_feet(track: Track) -> None:
    found, faster = standing([track]), standing([replace(track, ground=track.ground * np.float32([1.2, 1.2, 1]))])
    assert 0 < found["slide_cm"] < 3
    assert found["toe_speed"] < 0.1
    # a fifth of about 1.2 m/s, in stances of half a second
    assert faster["slide_cm"] - found["slide_cm"] == pytest.approx(12, rel=0.4)
    assert faster["toe_speed"] - found["toe_speed"] == pytest.approx(0.24, rel=0.3)
    assert faster["acceleration"] == pytest.approx(found["acceleration"], rel=0.1)
    assert standing([track, track]) == pytest.approx(found, rel=0.01)  # a percentile of twice as many lies elsewhere
    assert np.isnan(standing([])["slide_cm"])


def test_stretches_are_as_fast_as_asked() -> None:
    speeds = np.repeat([0.0, 1.4, 3.0, 1.4, 0.0], [30, 60, 60, 15, 30])
    ground = np.zeros((len(speeds), 1, 3))
    ground[:, 0, 1] = np.cumsum(speeds) / FPS
    whole = Track.of([resting(place) for place in ground], FPS)
    for pace in (1.4, 3.0):
        (found,) = stretches(whole, pace)
        assert len(found) == pytest.approx(60, abs=15)
        gone = np.linalg.norm(np.diff(found.ground[:, 0, :2], axis=0), axis=1) * FPS
        assert np.median(gone) == pytest.approx(pace, rel=1e-3)
    assert stretches(whole, 2.2) == []


def test_speed_errors_are_shares() -> None:
    found = speed_errors(puppets(gain=0.9))
    assert [found["mean"], found["worst"]] == pytest.approx([0.1, 0.1], abs=1e-4)
    assert found["to_0.6"] == pytest.approx(0.1, abs=1e-4)
    assert found["rest"] == 0
    # only what is between 1 and 2 s after a change counts
    assert speed_errors(puppets(late=0.9))["worst"] == pytest.approx(0, abs=1e-4)
    assert speed_errors(puppets(late=1.2))["rest"] == pytest.approx(0.2 * np.mean(CHANGED_SPEEDS[1:]), rel=0.01)


def test_turns_take_as_long_as_a_figure_takes() -> None:
    found = turn_errors(puppets(turning=90.0, askew=3.0), "walk", 1.4)
    for turn in (45, 90, 135, 180):
        # the mean over a step smooths the end, and a tick has to be over
        assert 0 <= found[f"s_{turn}"] - (turn - 10) / 90 < 0.1
    assert found["facing_90"] == pytest.approx(3, abs=1e-3)
    # a slower one has not turned in time, and from 2 to 3 s it is still turning
    slow = turn_errors(puppets(turning=15.0), "walk", 1.4)
    assert slow["s_90"] == slow["worst_s_180"] == np.inf
    assert slow["direction_90"] == pytest.approx(90 - 15 * 2.5, abs=1)
    assert turn_errors(puppets(), "run", 3.0)["worst_s_90"] < 0.31


def test_side_steps_have_errors_of_their_own() -> None:
    found = aside_errors(puppets(gain=0.5, askew=-4.0))
    for name in ("left", "right", "back"):
        assert found[f"{name}_direction"] == pytest.approx(0, abs=1e-3)
        assert found[f"{name}_facing"] == pytest.approx(4, abs=1e-3)
        assert found[f"{name}_speed"] == pytest.approx(0.5, abs=1e-3)
    assert aside_errors(puppets(gain=0.0))["left_direction"] == 180


def test_ways_are_measured_from_the_facing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(following, "PHASES", 1)
    found = ways_errors(puppets(gain=0.9, askew=3.0), "walk")
    found = [found[name] for name in ("direction_worst", "facing", "speed", "speed_least")]
    assert found == pytest.approx([0, 3, 0.1, 0.9], abs=1e-3)
    # at 20 degrees a second those that turn by most have not turned half way in the first four seconds
    slow = ways_errors(puppets(turning=20.0), "run")
    assert 0 < slow["direction"] < slow["direction_p95"] < slow["direction_worst"]
    assert slow["direction_worst"] == pytest.approx(180 - 20 * 4, abs=2)


def test_slow_walks_are_measured_in_metres_a_second() -> None:
    found = creep_errors(puppets(gain=0.9))
    assert [found["speed"], found["speed_worst"]] == pytest.approx([0.035, 0.06], abs=1e-4)


def test_a_player_reverses_walks_and_weaves() -> None:
    told: Any = []

    class Told(Puppets):
        def start(self, *given: Any, **how: Any) -> Any:
            session = super().start(*given, **how)
            control, session.control = session.control, lambda **asked: (told.append(asked), control(**asked))[1]
            return session

    model: Any = Told()
    assert reversal_figures(model)["slide_p95_cm"] > 5  # soles glide along
    ways = np.unique([asked["direction"] for asked in told])
    assert ways.tolist() == [0, 180]
    changes = np.diff([asked["direction"] for asked in told], axis=0) != 0
    assert changes.sum() == pytest.approx(STEERED_FIGURES * 23.0 / 2.0, rel=0.1)
    told.clear()
    stick_figures(model)
    speeds, ways = (np.array([asked[name] for asked in told]) for name in ("speed", "direction"))
    assert len(told) == round(23 * FPS)
    assert (speeds.min(), speeds.max()) == (pytest.approx(0.72, abs=1e-3), pytest.approx(1.28, abs=1e-3))
    turns = np.diff(ways, axis=0) * FPS
    assert turns.std() == pytest.approx(85, rel=0.1)
    assert np.corrcoef(turns[:-15].ravel(), turns[15:].ravel())[0, 1] == pytest.approx(np.exp(-1), abs=0.1)


def test_the_tail_of_slides_is_told_beside_their_mean() -> None:
    stances = [np.array([[0.0, 0, 0], [0.01 * n, 0, 0]]) for n in range(101)]
    assert mean_and_tail(slides(stances)) == pytest.approx((0.5, 0.95))
    assert np.isnan(mean_and_tail(slides([]))).all()


def test_turns_and_leaps_are_those_of_the_bones() -> None:
    poses = [turned(resting(np.array([[0.1 * i, 0, 0.3 * i]])), "leftLowerLeg", 10 * i) for i in range(4)]
    track = Track.of(poses, FPS)
    expected = np.zeros(len(BONES))
    expected[BONES.index("leftLowerLeg")] = 10
    np.testing.assert_allclose(turns(track), np.broadcast_to(expected, (3, 1, len(BONES))), atol=1e-4)
    # the ankle goes along a circle around the knee, whatever the figure does over the ground
    moved = joint_steps(track)
    assert moved[0, 0, HUMANOID.index("leftFoot")] == pytest.approx(2 * 0.42 * np.sin(np.radians(5)), abs=1e-5)
    assert moved[..., HUMANOID.index("leftLowerLeg")].max() < 1e-6


def still_limits(turn: float = 5.0, leap: float = 0.12) -> Limits:
    return Limits(np.full(len(BONES), turn), np.full(len(HUMANOID.names), leap), 0.9, 1.0)


def test_limits_hold_for_both_sides() -> None:
    poses = [turned(resting(np.zeros((1, 3))), "leftLowerLeg", 7 * i) for i in range(3)]
    found = Limits.of([Track.of(poses, FPS)])
    assert found.turn[BONES.index("rightLowerLeg")] == pytest.approx(7, abs=1e-3)
    assert found.leap[HUMANOID.index("rightFoot")] == found.leap[HUMANOID.index("leftFoot")] > 0.01
    assert found.low == found.high == pytest.approx(0.98)


def sway(pose: Pose, tick: int) -> Pose:
    return turned(pose, "spine", tick % 2)


def kicks(pose: Pose, tick: int) -> Pose:
    return turned(sway(pose, tick), "rightUpperLeg", 30.0 * (tick % 50 == 0))


def sinks(pose: Pose, tick: int) -> Pose:
    down = 0.14 if tick % 20 == 0 else 0.01
    return replace(sway(pose, tick), height=pose.height - np.float32(down))


@pytest.mark.parametrize(
    ("how", "expected"),
    [
        ({"bend": sway}, {"broken": 0, "frozen": 0, "leaps": 0, "under_ground": 0}),
        # a leg that kicks turns there and back, the foot leaps; both are those of 3 figures
        ({"bend": kicks}, {"broken": 3 * 12, "frozen": 0, "leaps": 3 * 12, "under_ground": 0}),
        ({"bend": sinks}, {"broken": 3 * 15, "frozen": 0, "leaps": 0, "under_ground": 3 * 15}),
    ],
)
def test_what_breaks_is_counted(how: dict[str, Any], expected: dict[str, int]) -> None:
    found = wandering(puppets(**how), still_limits(), 10.0, 3)
    assert {name: found[name] for name in expected} == expected


def test_figures_that_do_not_go_freeze() -> None:
    fine, slow = (watched(puppets(bend=sway, gain=gain), still_limits(), 60.0, 4) for gain in (0.5, 0.3))
    assert not frozen(fine, FPS).any()
    told_long = (slow.since == 2 * FPS) & (slow.speed > 0.4)
    assert (frozen(slow, FPS) == told_long).all()
    assert told_long.sum() > 10
    # no joint moves: each figure freezes once
    assert frozen(watched(puppets(gain=0.5), still_limits(), 60.0, 4), FPS).sum() == 4


def test_figures_go_astray_that_turn_too_slowly() -> None:
    fine, slow = (watched(puppets(turning=rate), still_limits(), 60.0, 4) for rate in (360.0, 20.0))
    assert astray(fine, FPS) == pytest.approx(0, abs=0.1)
    # most are told to turn by more than 40 degrees, which is what they can in two seconds
    assert len(astray(slow, FPS)) > 10
    assert 20 < np.median(astray(slow, FPS)) < 120


def test_watching_in_chunks_is_watching_at_once() -> None:
    first = watched(puppets(bend=kicks), still_limits(), 5.0, 3)
    second = watched(puppets(bend=kicks), still_limits(), 5.0, 3, chunk=7)
    for name in Watch.__dataclass_fields__:
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))
    assert first.ground.shape == (150, 3, 3)


def test_what_is_not_a_number_is_broken() -> None:
    def spoilt(pose: Pose, tick: int) -> Pose:
        return replace(pose, ground=pose.ground * np.float32(np.nan if tick == 9 else 1))

    watch = watched(puppets(bend=spoilt), still_limits(), 1.0, 2)
    assert broken(watch, still_limits())[:, 0].nonzero()[0].tolist() == [7]
