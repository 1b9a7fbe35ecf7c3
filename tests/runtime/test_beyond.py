"""What follows a motion beyond a predictor's horizon: alive, at its pace, on the ground, the same for the same seed."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet.bundle.manifest import Manifest
from motet.errors import DecodingError, MotionError
from motet.figures.humanoid.bones import HUMANOID
from motet.generate.codec import Inertialization
from motet.generate.continuation import Continuation, at_rate, levelled, paced
from motet.generate.continue_codes import ContinuationSettings, Pace
from motet.generate.model import CodesModel
from motet.motion.kinematics import positions, skeleton_of
from motet.motion.motion import Motion
from motet.predict.model import SURE, PredictModel
from motet.representation.contract import MotionContract

RULES = ContinuationSettings()


@cache
def predictor() -> PredictModel:
    return motet.load("predict")


@cache
def writer() -> CodesModel:
    found = motet.load("generate")
    assert isinstance(found, CodesModel)
    return found


def metres(motion: Motion) -> Any:
    return positions(motion) * skeleton_of(motion).unit_factor(1.0)


def paces(motion: Motion) -> Any:
    return np.linalg.norm(np.diff(metres(motion)[:, 0, [0, 2]], axis=0), axis=1) * motion.fps


def test_a_walk_walks_on_as_fast_and_as_lively_and_on_the_ground(walk: Motion) -> None:
    given = walk.resample(30.0, to_end=True)
    found = predictor().predict(walk, frames=300, beyond=writer())
    assert (len(found), round(found.fps, 6), found.channels) == (300, 30.0, walk.channels)
    asked = paces(given[-61:]).mean()
    for start in range(0, 300, 100):
        assert paces(found[start : start + 100]).mean() == pytest.approx(asked, rel=0.15)
    toes = [skeleton_of(walk).index(name) for name in ("ltoes", "rtoes")]
    heights, before = (metres(one)[:, toes, 1] for one in (found, given))
    assert (np.ptp(heights, axis=0) > 0.06).all()  # each foot is lifted
    lowest = [heights[start : start + 60].min() for start in range(0, 300, 60)]
    np.testing.assert_allclose(lowest, before.min(), atol=0.04)
    energies = [np.abs(np.diff(metres(one) - metres(one)[:, :1], axis=0)).mean() for one in (found[200:], given[-60:])]
    assert energies[0] == pytest.approx(energies[1], rel=0.3)


def test_it_does_not_leap_where_the_writer_takes_over(walk: Motion) -> None:
    given = walk.resample(30.0, to_end=True)
    whole = metres(predictor().predict(walk, frames=90, append=True, beyond=writer()))
    leaps = np.linalg.norm(np.diff(whole, n=2, axis=0), axis=-1).mean(axis=1) * 900
    usual, seam = leaps[: len(given) - 2].max(), len(given) + round(SURE * 30)
    assert leaps[len(given) - 3 : len(given) + 3].max() < 1.5 * usual
    assert leaps[seam - 4 : seam + 4].max() < 1.5 * usual
    np.testing.assert_allclose(whole[: len(given)], metres(given), atol=1e-6)


def test_within_the_horizon_a_writer_changes_nothing_and_at_first_little(walk: Motion) -> None:
    alone = predictor().predict(walk, frames=25)
    np.testing.assert_array_equal(predictor().predict(walk, frames=25, beyond=writer()).values, alone.values)
    longer = predictor().predict([walk], frames=40, beyond=writer())[0]
    off = metres(longer)[:15] - metres(alone)[:15]
    assert np.abs(off[:, 0, [0, 2]]).max() < 0.002  # the root is the predictor's but for its height, the feet are held
    assert np.linalg.norm(off[:, 0], axis=-1).max() < 0.03
    assert np.linalg.norm(off, axis=-1).mean() < 0.02


def test_samples_differ_and_each_is_what_its_seed_gives_alone(walk: Motion) -> None:
    done = list[tuple[int, int]]()
    found = predictor().futures(
        walk, frames=45, beyond=writer(), samples=3, seed=5, progress=lambda *one: done.append(one)
    )
    assert done == [(1, 3), (2, 3), (3, 3)]
    (alone,) = predictor().futures(walk, frames=45, beyond=writer(), seed=7)
    np.testing.assert_array_equal(alone.values, found[2].values)
    places = [metres(one)[-1] for one in found]
    assert min(np.linalg.norm(places[i] - places[j], axis=-1).mean() for i, j in ((0, 1), (0, 2), (1, 2))) > 0.01
    (whole,) = predictor().futures(walk, frames=45, beyond=writer(), seed=5, append=True)
    np.testing.assert_allclose(whole.values[-45:], found[0].values, atol=1e-9)
    assert len(whole) == len(walk.resample(30.0, to_end=True)) + 45


def test_who_stands_may_stand(walk: Motion) -> None:
    standing = replace(walk, values=np.repeat(walk.values[:1], 240, axis=0))
    found = predictor().predict(standing, frames=150, beyond=writer(), seed=1)
    way = metres(found)[:, 0, [0, 2]]
    assert np.linalg.norm(way - way[0], axis=1).max() < 1.5


def test_another_frame_rate_and_length_unit_go_on_alike(walk: Motion) -> None:
    (found,) = predictor().futures(walk, frames=30, beyond=writer())
    (other,) = predictor().futures(walk.scaled(1.0), frames=30, beyond=writer())
    np.testing.assert_allclose(metres(other), metres(found), atol=0.02)
    line = Motion(np.arange(11.0)[:, None], ("a.tx",), ("m",), 10.0, None)
    np.testing.assert_allclose(at_rate(line[:4], line[4:], 20.0).values[:, 0], 3 + np.arange(1, 15) / 2)


def test_what_cannot_be_gone_on_with_is_refused(walk: Motion) -> None:
    for samples in (0, 101):
        with pytest.raises(DecodingError, match=f"samples must be a whole number from 1 to 100, not {samples}"):
            predictor().futures(walk, beyond=writer(), samples=samples)
    for frames in (0, 100_001):
        with pytest.raises(DecodingError, match=f"frames must be a whole number from 1 to 100000, not {frames}"):
            predictor().futures(walk, beyond=writer(), frames=frames)
    with pytest.raises(DecodingError, match="frames must be a whole number"):
        predictor().predict(walk, beyond=writer(), frames=100_001)
    with pytest.raises(DecodingError, match="expected a seed"):
        predictor().futures(walk, beyond=writer(), seed=-1)
    with pytest.raises(DecodingError, match=r"motion-code model such as motet\.load\('generate'\)"):
        predictor().predict(walk, beyond=motet.load("language-to-motion"), frames=30)
    with pytest.raises(MotionError, match="a motion of 7 frames is too short to continue: 8 are needed"):
        predictor().futures(walk.resample(30.0)[:7], beyond=writer())
    with pytest.raises(MotionError, match="needs 10 frames"):
        predictor().predict(walk.resample(30.0)[:7], beyond=writer(), frames=30)


def curve(start: int, stop: int) -> Any:
    """Channels of a smooth motion: three rates, and poses."""
    time = np.arange(start, stop)[:, None] / 30
    return np.concatenate([1 + 0 * time, 0 * time, 0.1 * np.cos(time), np.sin(3 * time), time**2], axis=1)


def test_what_is_not_quite_the_motion_is_joined_to_it() -> None:
    given, fps = curve(0, 20), 3000.0
    beside = np.array([0.2, 0.0, 0.1, 0.3, -0.2]) + 0.01 * np.arange(3000)[:, None] * [0, 0, 0, 1, 1]
    shown = curve(0, 3000) + beside
    join = Inertialization(given[-2:], shown[18:20], fps, 0.1)
    pieces = [join(shown[start:stop]) for start, stop in ((20, 23), (23, 23), (23, 3000))]
    seam, exact = np.concatenate([given, *pieces]), curve(0, 3000)
    for order, leap in ((0, 1e-3), (1, 1e-3)):  # neither a pose nor a velocity leaps
        found, wanted = np.diff(seam, order, axis=0)[18:22], np.diff(exact, order, axis=0)[18:22]
        np.testing.assert_allclose(found[:, 3:], wanted[:, 3:], atol=leap)
    np.testing.assert_allclose(seam[20, :3], exact[20, :3], atol=0.01)
    np.testing.assert_allclose(seam[-1], shown[-1], atol=1e-3)
    same = Inertialization(given[-2:], given[-2:], 30.0, 0.1)
    np.testing.assert_array_equal(same(curve(20, 80)), curve(20, 80))


@pytest.mark.parametrize(
    ("speed", "kept"), [(1.0, 1.1), (1.2, 1.1), (2.0, 2.0 / RULES.tempo), (0.5, 0.5 * RULES.tempo)]
)
def test_what_is_off_the_pace_is_played_quicker_or_slower(speed: float, kept: float) -> None:
    frames = np.zeros((301, 5))
    frames[:, 0], frames[:, 3] = speed, np.arange(301)
    found = paced(frames, Pace(1.1, 0.0), 30.0, RULES)
    assert found[60:200, 0] == pytest.approx(kept)
    np.testing.assert_allclose(np.diff(found[60:200, 3]), kept / speed)
    np.testing.assert_allclose(np.cumsum(found[:, 0]), speed * found[:, 3], rtol=0.01)  # as far as its frames went
    np.testing.assert_array_equal(paced(frames, Pace(1.1, None), 30.0, RULES), frames[1:])


def test_feet_come_down_to_the_ground_that_was_given() -> None:
    contract = writer().contract
    frames = np.repeat(contract.mean[None], 200, axis=0)
    frames[:, 3] += np.where(np.arange(200) < 60, 0.0, np.minimum(0.001 * (np.arange(200) - 60), 0.05))
    found = levelled(contract, frames, 30, RULES)
    np.testing.assert_array_equal(found[:, [0, 1, 2, *range(4, 136)]], frames[:, [0, 1, 2, *range(4, 136)]])
    assert np.abs(found[:, 3] - contract.mean[3])[: 60 - round(2 * RULES.ground_reach * 30)].max(initial=0) < 1e-9
    assert np.abs(found[-40:, 3] - contract.mean[3]).max() < 1e-6
    high = np.array(frames)
    high[100:, 3] += 2.0  # no floor: it stays as high as it is, but for what a floor may be off
    assert (levelled(contract, high, 30, RULES)[150:, 3] > contract.mean[3] + 1.9).all()
    assert isinstance(contract, MotionContract)
    assert contract.skeleton == HUMANOID


def test_a_shorter_continuation_is_the_beginning_of_a_longer_one(walk: Motion) -> None:
    standing = replace(walk, values=np.repeat(walk.values[-1:], 240, axis=0))
    for motion in (walk, standing, walk.scaled(0.3)):
        long, short, one = (
            predictor().futures(motion, frames=frames, beyond=writer(), seed=2)[0].values for frames in (150, 61, 1)
        )
        np.testing.assert_allclose(long[:61], short, atol=1e-9)
        np.testing.assert_allclose(long[:1], one, atol=1e-9)
    long, short = (predictor().predict(walk, frames=frames, beyond=writer()).values for frames in (150, 40))
    np.testing.assert_allclose(long[:40], short, atol=1e-9)


def test_a_bundle_has_settings_of_its_own(walk: Motion) -> None:
    model = writer()
    source = {**model.manifest.source, "settings": {"continuation": {"tempo": 1.0, "half_life": 0.3}}}
    own = CodesModel(Manifest.from_json(source), model.graphs, model.tables)
    assert own.settings(ContinuationSettings) == replace(RULES, tempo=1.0, half_life=0.3)
    assert own.codec.half_life == 0.3
    rules = Continuation(own, walk.resample(30.0)).rules
    assert (rules.tempo, rules.rows) == (1.0, 12)


def test_the_command_line_gives_what_python_gives(tmp_path: Path, clips: Path, walk: Motion) -> None:
    result = run("predict", clips / "39_14.amc", "-o", tmp_path / "a.npz", "--frames", 30, "--samples", 2, "--json")
    (row,) = json.loads(result.stdout)
    outs = [str(tmp_path / f"a-{number}.npz") for number in (1, 2)]
    assert row == {
        "input": str(clips / "39_14.amc"),
        "in_place": False,
        "fps": 30.0,
        "frames": 30,
        "seconds": 1.0,
        "start": 0,
        "samples": [{"output": outs[0], "seed": 0}, {"output": outs[1], "seed": 1}],
        "beyond": "generate",
    }
    for place, future in zip(outs, predictor().futures(walk, frames=30, beyond=writer(), samples=2), strict=True):
        np.testing.assert_allclose(motet.read(place).values, future.values, atol=1e-6)
    run("predict", clips / "39_14.amc", "-o", tmp_path / "b.npz", "--frames", 30, "--seed", 3)
    expected = predictor().predict(walk, frames=30, beyond=writer(), seed=3)
    np.testing.assert_allclose(motet.read(tmp_path / "b.npz").values, expected.values, atol=1e-6)
    run("predict", clips / "39_14.amc", "-o", tmp_path / "c.npz", "--frames", 30, "--beyond", "none")
    alone = predictor().predict(walk, frames=30)
    np.testing.assert_allclose(motet.read(tmp_path / "c.npz").values, alone.values, atol=1e-6)
    several = run("predict", clips / "39_14.amc", clips / "02_06.amc", "-o", tmp_path / "{name}.npz", "--samples", 2)
    assert [line.partition(":")[0] for line in several.stdout.splitlines()] == [
        str(tmp_path / f"{name}-{number}.npz") for name in ("39_14", "02_06") for number in (1, 2)
    ]


@pytest.mark.parametrize(("frames", "known"), [((), 25), (("--frames", 7), 7), (("--frames", 40), 15)])
def test_errors_are_told_of_the_predictors_own_frames(
    frames: tuple[Any, ...], known: int, tmp_path: Path, clips: Path, walk: Motion
) -> None:
    (row,) = json.loads(run("predict", clips / "39_14.amc", "-o", tmp_path / "a.npz", *frames, "--json").stdout)
    expected = predictor().expected_errors(walk)[:known]
    np.testing.assert_allclose(row["expected_error_cm"], expected, atol=0.006)
    assert (np.diff(expected) > 0).mean() > 0.9


@pytest.mark.parametrize(
    ("code", "options", "said"),
    [
        (2, ["--samples", "0"], "range 1<=x<=100"),
        (2, ["--samples", "2", "--beyond", "none"], "a predictor has one future"),
        (2, ["--samples", "2", "--beyond", "language-to-motion"], "need one that is a CodesModel"),
        (2, ["--frames", "26", "--beyond", "control"], "is for 'control'"),
        (2, ["--frames", "26", "--beyond", "no-such"], "unknown bundle 'no-such'"),
        (1, ["--samples", "1"], "short.npz: a motion of 7 frames is too short to continue: 8 are needed (--beyond"),
    ],
)
def test_refusals_of_the_command_line_write_nothing(
    code: int, options: list[str], said: str, tmp_path: Path, walk: Motion
) -> None:
    short, out = tmp_path / "short.npz", tmp_path / "out.npz"
    motet.write(short, walk.resample(30.0)[:7])
    result = run("predict", short, "-o", out, *options)
    assert (result.exit_code, said in result.stderr) == (code, True), result.stderr
    assert not list(tmp_path.glob("out*"))
