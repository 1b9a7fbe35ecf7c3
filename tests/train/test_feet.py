"""Measures of feet that stand, against a naive twin, figures that can be reckoned, and recorded clips."""

from dataclasses import replace

import numpy as np
import pytest

from motet.figures.feet.contacts import smoothed
from motet.formats import read_motion
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet_train.data.cmu_trials import CMU_CLIPS, cmu_trial
from motet_train.evaluate.positions import acceleration, leap, slide, speed, stances

Array = np.ndarray
FPS = 40.0


def steps(slip: float = 0.0, seconds: float = 6.0) -> tuple[Array, Array]:
    """Two feet of a root that goes at 1 m/s: each stands for half a second, then swings half a second to where it is
    half a metre ahead again. slip: m/s at which feet that stand go along."""
    time = np.arange(round(seconds * FPS)) / FPS
    root = np.stack([0 * time, 1 + 0 * time, time], axis=1)
    feet = []
    for late in (0.0, 0.5):
        count, phase = np.divmod(time + late, 1.0)
        swing = np.clip(phase - 0.5, 0, None) * 2
        forward = count + slip * np.minimum(phase, 0.5) + swing * (1 - 0.5 * slip) - late
        feet.append(np.stack([0.1 * (1 - 4 * late) + 0 * time, 0.2 * np.sin(np.pi * swing), forward], axis=1))
    return np.stack(feet, axis=1), root


def naive(points: Array, root: Array) -> list[list[Array]]:
    """The stances of each point, frame by frame."""
    calm, way = smoothed(points, 0.05, FPS), smoothed(root[:, None], 0.05, FPS)[:, 0]
    last, every = len(root) - 1, []
    for k in range(points.shape[1]):
        ground, found, now = np.percentile(calm[:, k, 1], 10), [], []
        for t in range(last + 1):
            a, b = max(t - 1, 0), min(t + 1, last)
            going, body = ((path[b] - path[a])[[0, 2]] / (b - a) for path in (calm[:, k], way))
            if calm[t, k, 1] <= ground + 0.03 and np.dot(going, body) <= np.dot(body, body) / 2:
                now.append(points[t, k])
            else:
                found, now = [*found, now], []
        every.append([np.array(one) for one in [*found, now] if len(one) >= 0.1 * FPS])
    return every


@pytest.mark.parametrize("slip", [0.0, 0.1, 0.3])
def test_feet_slide_as_far_as_they_slip(slip: float) -> None:
    points, root = steps(slip)
    assert slide(stances(points, root, FPS)) == pytest.approx(0.5 * slip, abs=0.06)
    assert speed(points, root, FPS) == pytest.approx(slip, abs=1e-6)
    assert len(stances(points, root, FPS)) == 12


def test_stances_are_those_of_a_loop_over_frames() -> None:
    points, root = steps(0.2)
    points = points + np.random.default_rng(0).normal(0, 0.01, points.shape)
    expected = naive(points, root)
    found = stances(points, root, FPS)
    assert len(found) == sum(map(len, expected)) > 10
    for one, other in zip(found, (stance for each in expected for stance in each), strict=True):
        np.testing.assert_array_equal(one, other)
    places = [stance[:, [0, 2]] for each in expected for stance in each]
    farthest = [max(np.hypot(*(a - b)) for a in place for b in place) for place in places]
    assert slide(stances(points, root, FPS)) == pytest.approx(np.mean(farthest))
    paces = [np.hypot(*step) * FPS for place in places for step in np.diff(place, axis=0)]
    assert speed(points, root, FPS) == pytest.approx(np.median(paces))


def test_who_never_stands_has_no_figures() -> None:
    _, root = steps()
    glides = root[:, None] * [1, 0, 1]
    assert np.isnan([slide(stances(glides, root, FPS)), speed(glides, root, FPS)]).all()
    assert np.isnan(acceleration(root[:2, None], root[:2], FPS))


def test_acceleration_of_a_fall_beside_the_root() -> None:
    time = np.arange(50) / FPS
    root = np.random.default_rng(0).normal(size=(50, 3))
    falling = root + np.outer(-0.5 * 9.81 * time**2, [0, 1, 0])
    assert acceleration(np.stack([root, falling, falling], axis=1), root, FPS) == pytest.approx(9.81)


@pytest.mark.parametrize(("label", "most"), [("walk", 0.035), ("run", 0.04)])
def test_recorded_feet_stand_and_feet_that_are_made_to_slide_do_not(label: str, most: float) -> None:
    motion = read_motion(cmu_trial(CMU_CLIPS[label])).resample(FPS)
    places = positions(motion) * motion.skeleton.metres_per_unit
    points, root = places[:, [motion.skeleton.index(name) for name in ("ltoes", "rtoes")]], places[:, 0]
    assert 0.02 < slide(stances(points, root, FPS)) < most
    assert 0.1 < speed(points, root, FPS) < 0.2
    forward = np.outer(np.arange(len(root)) / FPS * 0.5, (root[-1] - root[0]) * [1, 0, 1])
    forward /= np.linalg.norm(root[-1] - root[0])
    assert slide(stances(points + forward[:, None], root + forward, FPS)) > most + 0.05
    assert speed(points + forward[:, None], root + forward, FPS) == pytest.approx(0.5, abs=0.15)


def test_a_leap_is_the_angle_that_a_joint_turns_by() -> None:
    motion = read_motion(cmu_trial(CMU_CLIPS["bend"])).resample(FPS)
    still = replace(motion, values=np.repeat(motion.values[:1], 5, axis=0))
    values = np.array(still.values)
    values[3:, motion.channels.index("ltibia.rx")] += 71
    values[3:, motion.channels.index("rtibia.rx")] += 20
    assert leap(still) == pytest.approx(0, abs=1e-4)
    assert leap(replace(still, values=values)) == pytest.approx(71)
    assert leap(Motion(values[:1], motion.channels, motion.units, FPS, motion.skeleton)) == 0
