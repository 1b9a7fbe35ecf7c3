"""Predictions by graphs that can be seen through: one that goes on as it went, frame for frame."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_models import FakeGraph, manifest, spec
from figures import walker

import motet
from motet.decode.loop import advance
from motet.errors import BundleError, DecodingError, MotionError
from motet.formats import read_motion, write_motion
from motet.motion.kinematics import local_rotations, positions
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat
from motet.predict.free_run import free_run
from motet.predict.model import PredictModel
from motet.representation.contract import MotionContract
from motet.representation.root_block import RootVectors, joints_of, to_joint_vectors

pytestmark = pytest.mark.numeric

SEED, HORIZON = 4, 3
FPS = 30.0


def graphs(channels: int, change: float = 1.0) -> dict[str, Any]:
    """A direct predictor: the last frame, and ``change`` times the last step added for each frame."""
    sizes = {"L": SEED, "N": HORIZON, "C": channels}

    def encode(frames: Any) -> tuple[Any]:
        step = change * (frames[:, -1:] - frames[:, -2:-1])
        return (frames[:, -1:] + step * np.arange(1, HORIZON + 1)[:, None],)

    def step(trajectory: Any) -> tuple[Any, Any]:
        return trajectory[:, 0], np.concatenate([trajectory[:, 1:], trajectory[:, -1:]], axis=1)

    encoder = spec({"frames": "batch L C"}, {"trajectory": "batch N C"}, sizes)
    stepper = spec({"trajectory": "batch N C"}, {"frame": "batch C", "next_trajectory": "batch N C"}, sizes)
    return {"encoder": FakeGraph(encoder, encode), "step": FakeGraph(stepper, step)}


def model_of(motion: Motion, change: float = 1.0) -> PredictModel:
    """A model whose contract is the channels of a motion."""
    zeros = np.zeros(len(motion.channels))
    name = "root_vectors" if joints_of(motion.channels) else "angles"
    contract = MotionContract(name, motion.channels, motion.units, motion.fps, zeros, zeros + 1, motion.skeleton)
    found = manifest("predict", "free_run", contract, {"horizon": HORIZON})
    return PredictModel(found, graphs(len(motion.channels), change))


def circle(frames: int = 12, fps: float = FPS) -> Motion:
    """A person stiff as a board that goes around in a circle, at a constant speed, seen from a place off the centre."""
    time = np.arange(frames) / fps
    angle = 0.7 + 1.3 * time
    values = np.zeros((frames, 6))
    values[:, 0], values[:, 1], values[:, 2] = 3 - 2 * np.cos(angle), 0.9, -1 + 2 * np.sin(angle)
    values[:, 4] = np.degrees(angle)
    arm = np.full((frames, 3), 20.0)
    names = [f"hips.{kind}{axis}" for kind in "tr" for axis in "xyz"] + [f"left_arm.r{axis}" for axis in "xyz"]
    units = ("length",) * 3 + ("deg",) * 6
    return Motion(np.concatenate([values, arm], axis=1), tuple(names), units, fps, walker().skeleton)


def test_a_free_run_asks_again_after_each_horizon() -> None:
    made, seed = graphs(2), np.random.default_rng(0).normal(size=(5, SEED, 2)).astype(np.float32)
    found = free_run(made["encoder"], made["step"], seed, 7, HORIZON)
    assert (made["encoder"].calls, made["step"].calls, found.shape) == (3, 0, (5, 7, 2))
    frames = list(np.moveaxis(seed, 1, 0))
    for _ in range(7):  # this predictor asked about its own frames says what it said before
        frames.append(2 * frames[-1] - frames[-2])
    np.testing.assert_allclose(found, np.stack(frames[SEED:], axis=1), atol=1e-4)


def test_a_circle_goes_on_where_it_ended() -> None:
    whole = circle(30)
    model = model_of(to_joint_vectors(whole), change=0.0)  # root block held: the same step and turn again and again
    found = model.predict(whole[:12], frames=18)
    assert (found.channels, found.units, found.fps) == (whole.channels, whole.units, whole.fps)
    np.testing.assert_allclose(found.values, whole.values[12:], atol=1e-3)
    np.testing.assert_allclose(model.predict(whole[:12], frames=18, append=True).values, whole.values, atol=1e-3)


def test_what_is_appended_does_not_leap() -> None:
    whole = circle(240, fps=120.0)
    column = whole.channels.index("hips.ry")
    leaping = np.array(whole.values)
    leaping[:, column] = (leaping[:, column] + 180) % 360 - 180
    assert np.abs(np.diff(leaping[:, column])).max() > 300
    model = model_of(to_joint_vectors(circle()), change=0.0)
    found = model.predict(replace(whole, values=leaping), frames=18, append=True)
    assert np.abs(np.diff(found.values[:, column])).max() < 5


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_a_figure_and_back_is_the_motion_whatever_its_channels(scale: float) -> None:
    whole = walker(40, metres_per_unit=1 / scale, scale=scale)
    figure = to_joint_vectors(whole)
    assert joints_of(figure.channels) == ("left_leg", "left_shin", "right_leg", "right_shin", "spine", "left_arm",
                                          "right_arm", "head")  # fmt: skip
    back = RootVectors().motion(figure[25:], whole[:25])
    np.testing.assert_allclose(local_rotations(back), local_rotations(whole[25:]), atol=1e-9)
    np.testing.assert_allclose(positions(back), positions(whole[25:]), atol=1e-9)


def test_a_bvh_made_from_an_amc_gives_equal_frames(clips: Path, tmp_path: Path) -> None:
    motion = read_motion(clips / "39_14.amc")
    write_motion(tmp_path / "a.bvh", motion.scaled(1.0))
    other = read_motion(tmp_path / "a.bvh").with_unit(1.0)
    figure = to_joint_vectors(motion)
    np.testing.assert_allclose(to_joint_vectors(other, joints_of(figure.channels)).values, figure.values, atol=1e-4)


def test_exponential_maps_do_not_leap() -> None:
    turning = walker(60, fps=10.0)
    values = np.array(turning.values)
    column = turning.channels.index("left_arm.ry")
    values[:, column - 1 : column + 2] = np.column_stack([np.zeros(60), 20.0 * np.arange(60), np.zeros(60)])
    figure = to_joint_vectors(replace(turning, values=values))
    smooth = figure.continuous()
    place = figure.channels.index("left_arm.ex")
    assert np.abs(np.diff(figure.values[:, place : place + 3], axis=0)).max() > 3
    assert np.abs(np.diff(smooth.values[:, place : place + 3], axis=0)).max() < 0.5
    np.testing.assert_array_equal(smooth.values[-1], figure.values[-1])


def test_a_stream_gives_what_the_whole_motion_gives() -> None:
    whole = walker(80, fps=120.0)
    model = model_of(to_joint_vectors(whole).resample(FPS, to_end=True), change=0.5)
    session = model.stream(whole[:30])
    session.push(whole.values[30])
    session.push(whole.values[31:70])
    np.testing.assert_allclose(session.predict(5).values, model.predict(whole[:70], frames=5).values, atol=1e-3)
    with pytest.raises(MotionError, match="not finite"):
        session.push(np.full(len(whole.channels), np.nan))
    with pytest.raises(MotionError, match=r"shape \(3,\) does not fit 24 channels"):
        session.push([1.0, 2.0, 3.0])
    np.testing.assert_allclose(session.predict(5).values, model.predict(whole[:70], frames=5).values, atol=1e-3)
    kept = repr(session)
    session.push(np.tile(whole.values, (10, 1)))
    assert repr(session) == kept  # it says how many frames are kept


def test_golden_vectors_are_no_endless_run() -> None:
    model = model_of(to_joint_vectors(circle()))
    seed = {"frames": model.contract.frames(to_joint_vectors(circle()))[-model.seed_frames :]}
    assert len(model.replay(seed, {"frames": 1000})["frames"]) == 1000
    with pytest.raises(BundleError, match="at most 1000 frames, not 1001"):
        model.replay(seed, {"frames": 1001})


def test_a_stream_without_a_start_takes_the_contracts_channels() -> None:
    model = model_of(to_joint_vectors(circle()))
    session = model.stream()
    with pytest.raises(MotionError, match="has 0"):
        session.predict()
    session.push(to_joint_vectors(circle()).values)
    assert len(session.predict()) == HORIZON
    assert session.predict().channels == model.contract.channels


def test_a_length_in_seconds_is_one_in_frames() -> None:
    whole = circle()
    model = model_of(to_joint_vectors(whole))
    assert len(model.predict(whole)) == HORIZON
    for seconds, frames in ((0.2, 6), (np.float64(1 / 30), 1), (0.001, 1)):
        found, expected = model.predict(whole, seconds=seconds), model.predict(whole, frames=frames)
        np.testing.assert_array_equal(found.values, expected.values)
        assert len(model.stream(whole).predict(seconds=seconds)) == frames
    for given in (
        {"seconds": 0},
        {"seconds": 1e9},
        {"seconds": "1"},
        {"seconds": np.nan},
        {"seconds": 1, "frames": 30},
    ):
        with pytest.raises(DecodingError, match=r"give seconds, more than 0 and at most 3333.33, or frames"):
            model.predict(whole, **given)  # type: ignore[call-overload]


def test_what_does_not_fit_is_refused() -> None:
    whole = circle()
    model = model_of(to_joint_vectors(whole))
    with pytest.raises(MotionError, match=r"needs 4 frames at 30 fps, but the motion has 3 \(9 at 90 fps\)"):
        model.predict(circle(9, fps=90.0))
    with pytest.raises(MotionError, match="the motion has 0"):
        model.predict(whole[:0])
    skeleton = whole.skeleton
    assert skeleton is not None
    joints = tuple(replace(j, name=j.name.replace("_arm", "_wing")) for j in skeleton.joints)
    channels = tuple(name.replace("_arm", "_wing") for name in whole.channels)
    winged = replace(whole, channels=channels, skeleton=replace(skeleton, joints=joints))
    with pytest.raises(MotionError, match="lacks joints of the model's figure: left_arm, right_arm"):
        model.predict(winged)
    with pytest.raises(MotionError, match=r"hips\.tx"):
        model.predict(whole.select(whole.channels[3:]))
    with pytest.raises(MotionError, match="length unit of this skeleton is unknown"):
        model.predict(replace(whole, skeleton=walker(metres_per_unit=None, scale=0.3).skeleton))
    for frames in (0, 2.5, True, "two"):
        with pytest.raises(DecodingError, match=f"frames must be a whole number from 1 to 100000, not {frames!r}"):
            model.predict(whole, frames=frames)  # type: ignore[call-overload]
    for frame in ("x", [None] * 9, np.zeros(4)):
        with pytest.raises(MotionError, match="9"):
            model.stream(whole).push(frame)
    with pytest.raises(MotionError, match="finite"):
        model.next_frames(np.full((1, model.seed_frames, len(model.contract.channels)), np.nan))
    with pytest.raises(MotionError, match="do not fit"):
        model.next_frames(np.zeros((1, SEED, 5)))
    with pytest.raises(BundleError, match=r"manifest, defaults.horizon: is missing"):
        PredictModel(replace(model.manifest, defaults={}), model.graphs)


def test_the_root_faces_where_it_faced() -> None:
    whole = circle(30)
    turned = replace(whole, values=whole.values + np.array([5.0, 0, 2, 0, 90, 0, 0, 0, 0]))
    model = model_of(to_joint_vectors(whole))
    found, other = model.predict(whole[:10], frames=5), model.predict(turned[:10], frames=5)
    step, other_step = (np.diff(positions(m)[:, 0], axis=0) for m in (found, other))
    # the path does not turn with the figure: it goes sideways now
    assert np.linalg.norm(other_step, axis=1) == pytest.approx(np.linalg.norm(step, axis=1), abs=1e-3)
    turn = axis_to_rotmat("y", np.radians(90.0))
    np.testing.assert_allclose(local_rotations(other)[:, 0], turn @ local_rotations(found)[:, 0], atol=1e-5)


def test_what_knows_its_errors_tells_them_in_centimetres() -> None:
    motion = circle()
    model = model_of(motion)
    assert not model.knows_errors
    with pytest.raises(DecodingError, match="does not estimate its errors"):
        model.expected_errors(motion)
    sizes = {"L": SEED, "N": HORIZON, "C": len(motion.channels)}

    def telling(sizes: dict[str, int]) -> PredictModel:
        told = spec({"frames": "batch L C"}, {"error": "batch N"}, sizes)
        errors = np.arange(1, sizes["N"] + 1)
        graph = FakeGraph(told, lambda frames: (np.abs(frames[:, -1, :1]) * errors,))
        return PredictModel(model.manifest, {**model.graphs, "error": graph})

    sure = telling(sizes)
    np.testing.assert_array_equal(sure.predict(motion).values, model.predict(motion).values)
    expected = 100 * np.abs(motion.values[-1, 0]) * np.arange(1, HORIZON + 1)
    np.testing.assert_allclose(sure.expected_errors(motion), expected, rtol=1e-6)
    np.testing.assert_array_equal(sure.expected_errors([motion[:-1], motion])[1], sure.expected_errors(motion))
    assert sure.expected_errors([]).shape == (0, HORIZON)
    with pytest.raises(BundleError, match="4 errors for a horizon of 3"):
        telling({**sizes, "N": HORIZON + 1})


def test_the_step_hands_out_frame_by_frame_what_is_taken_at_once() -> None:
    model = motet.load("predict")
    contract = model.contract
    noise = np.random.default_rng(0).normal(size=(5, model.seed_frames, len(contract.channels)))
    seeds = contract.mean + contract.std * 0.3 * noise
    state = {"trajectory": model.graphs["encoder"]({"frames": seeds.astype(np.float32)})["trajectory"]}
    for frame in model.next_frames(seeds, model.horizon).swapaxes(0, 1):
        stepped, state = advance(model.graphs["step"], state, {})
        np.testing.assert_array_equal(stepped["frame"], frame)


def test_a_stream_of_another_figure_gives_what_the_whole_motion_gives(clips) -> None:
    """The figure and its ground are those of the motion that the session starts with, not of the frames it keeps."""
    model, walk = motet.load("predict"), read_motion(clips / "39_14.amc")
    whole = model.predict(walk, frames=5)
    np.testing.assert_allclose(model.stream(walk).predict(5).values, whole.values, atol=1e-4)
