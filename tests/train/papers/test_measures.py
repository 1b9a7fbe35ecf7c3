import numpy as np
import pytest

from motet_train.evaluate.positions import arrival
from motet_train.papers.tdbn.clips import body_parts, is_periodic, period, read_clips
from motet_train.papers.tdbn.study import ARRIVED, Reference, upsample


def wave(frames: int, cycle: float, phase: float = 0.0) -> np.ndarray:
    """Two joint angles on an ellipse, and a third that does not move."""
    at = 2 * np.pi * np.arange(frames) / cycle + phase
    return np.stack([30 * np.cos(at), 10 * np.sin(at), np.full(frames, 5.0)], axis=1)


@pytest.fixture
def reference() -> Reference:
    return Reference({"walk": [wave(133, 42.3), wave(133, 42.3, 0.1)]}, legs=np.array([0, 2]))


@pytest.mark.parametrize("cycle", [12.5, 29.6, 42.3])
def test_a_period_is_found_between_frames(cycle: float) -> None:
    assert period(wave(400, cycle)) == pytest.approx(cycle, abs=0.1)


def test_what_does_not_come_back_has_no_period() -> None:
    once = np.hanning(120)[:, None] * [1.0, 2.0]
    assert not is_periodic([once])
    assert np.isnan(period(np.ones((100, 2))))
    assert is_periodic([wave(100, 30)])


def test_distance_against_loops(reference: Reference) -> None:
    rng = np.random.default_rng(0)
    frames, points = rng.normal(0, 20, (6, 2, 3)), wave(50, 42.3)
    std = np.concatenate(list(reference.motions["walk"])).std(axis=0)
    expected = [
        [min(np.sqrt(np.mean(((frame - point)[:2] / std[:2]) ** 2)) for point in points) for frame in row]
        for row in frames
    ]
    np.testing.assert_allclose(reference.distance(frames, points), expected)
    frames[2, 1, 0] = np.nan
    assert np.isinf(reference.distance(frames, points)[2, 1])


def test_jumps_and_energy(reference: Reference) -> None:
    clip = reference.motions["walk"][0]
    assert reference.largest_jump == pytest.approx(reference.jumps(clip).max(), rel=0.01)
    assert reference.energy_ratio(clip, "walk") == pytest.approx(1, abs=0.02)
    assert reference.energy_ratio(clip * 0.5, "walk") == pytest.approx(0.25, abs=0.01)
    assert reference.period("walk") == pytest.approx(42.3, abs=0.2)


def test_upsample_keeps_the_frames_and_lines_between() -> None:
    frames = wave(5, 42.3)
    fine = upsample(frames)
    np.testing.assert_allclose(fine[::4], frames)
    np.testing.assert_allclose(fine[2], (frames[0] + frames[1]) / 2)


def test_arrival_counts_only_what_stays() -> None:
    inside = np.array([[1, 0, 0, 0], [0, 0, 1, 0], [1, 1, 0, 0], [1, 1, 1, 0]], dtype=bool)
    np.testing.assert_array_equal(arrival(inside, fps=40.0), [3 / 40, 3 / 40, 4 / 40, np.inf])
    np.testing.assert_array_equal(arrival(np.ones((4, 1), dtype=bool), fps=40.0), [1 / 40])


def test_a_pose_has_arrived_when_it_is_as_near_as_the_recorded_cycles_are_to_each_other() -> None:
    clips = read_clips()
    motions = clips.frames(40)
    parts = body_parts(clips.skeleton, clips.channels)
    reference = Reference(motions, np.flatnonzero(np.isin(parts.of_channel, parts.legs)))
    walk, half = motions["walk"][0], reference.period("walk") / 2
    fine, time = upsample(walk), np.arange(4 * (len(walk) - 1) + 1) / 4
    apart = [reference.distance(walk[[i]], fine[np.abs(time - i) > half])[0] for i in range(len(walk))]
    assert np.median(apart) == pytest.approx(ARRIVED, abs=0.01)
