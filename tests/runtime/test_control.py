import json
import threading
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnxruntime
import pytest

from motet.bundle.bundle import list_bundles
from motet.errors import ControlError, MotionError
from motet.formats import read_motion, write_motion
from motet.models.load import load
from motet.motion.kinematics import positions
from motet.motion.motion import Motion
from motet.papers.control_script import control_track, parse_segments
from motet.papers.tdbn_control import TdbnModel

pytestmark = pytest.mark.numeric

SCRIPT = "walk .5s, walk>run .5s, run .5s, bend .5s"


@pytest.fixture(scope="module")
def model() -> TdbnModel:
    return load("tdbn")


def test_the_documented_loop_gives_the_same_frames(model: TdbnModel) -> None:
    """docs/reference/bundle.md in plain onnxruntime: no code of motet between the bundle and the frames."""
    with zipfile.ZipFile(list_bundles()["tdbn"]) as archive:
        manifest = json.loads(archive.read("manifest.json"))
        encoder, step = (
            onnxruntime.InferenceSession(
                archive.read(manifest["graphs"][role]["file"]), providers=["CPUExecutionProvider"]
            )
            for role in ("encoder", "step")
        )
    start = np.array(manifest["control"]["starts"]["walk"], np.float32)
    history = encoder.run(["codes"], {"frames": start})[0][None]
    column = np.ones((1, 1), np.float32)
    frames = []
    for control in control_track(parse_segments(SCRIPT, model.labels), model.labels, manifest["motion"]["fps"]):
        feeds = {
            "history": history,
            "control": control[None],
            "noise": np.zeros((1, history.shape[2]), np.float32),
            "variety": column * 0,
            "temperature": column * manifest["defaults"]["temperature"],
        }
        frame, history = step.run(["frame", "next_history"], feeds)
        frames.append(frame[0])
    found = model.start(smooth=False).run(SCRIPT, in_place=True)[0]
    np.testing.assert_array_equal(found.values, np.stack(frames))


def test_each_character_has_its_own_control(model: TdbnModel) -> None:
    session = model.start("walk", characters=3)
    session.control(walk=[1, 0, 0.5], run=[0, 1, 0.5])
    mixed = np.stack([session.step() for _ in range(60)], axis=1)
    for row, values in enumerate(({"walk": 1.0}, {"run": 1.0}, {"walk": 0.5, "run": 0.5})):
        alone = model.start("walk")
        alone.control(**values)
        np.testing.assert_allclose(mixed[row], np.concatenate([alone.step() for _ in range(60)]), atol=1e-3)


def test_many_threads_share_a_model_bit_for_bit(model: TdbnModel) -> None:
    expected = model.start(characters=4, seed=1, variety=1.0).frames(_track(model))
    results: list[np.ndarray] = []
    threads = [
        threading.Thread(
            target=lambda: results.append(model.start(characters=4, seed=1, variety=1.0).frames(_track(model)))
        )
        for _ in range(8)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(results) == 8
    for result in results:
        np.testing.assert_array_equal(result, expected)


def test_walking_and_running_have_their_training_periods(model: TdbnModel, clips: Path) -> None:
    for label, file in (("walk", "39_14.amc"), ("run", "09_07.amc")):
        knee = model.start(label).run(f"{label} 20s")[0].select(("rtibia.rx",)).values[400:, 0]
        data = read_motion(clips / file).select(("rtibia.rx",)).resample(model.fps).values[:, 0]
        assert _period(knee) == pytest.approx(_period(data), abs=1.0)


def test_a_motion_is_carried_on(model: TdbnModel, clips: Path) -> None:
    walk = read_motion(clips / "39_14.amc")
    session = model.start(walk)
    session.control(walk=1.0)
    first = model.contract.features(session.step())
    last = walk.resample(model.fps).select(first.channels)[-1:]
    moving = model.contract.std > 1
    difference = (first.values - last.values)[0, moving] / model.contract.std[moving]
    # the root's heading is taken out, all other angles go on where they were
    assert np.sqrt(np.mean(difference[3:] ** 2)) < 0.6


def test_a_late_turn_does_not_turn_the_start(model: TdbnModel, clips: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten seconds straight on and a quarter turn in the last one: what is carried on faces where the last frames do."""
    walk = read_motion(clips / "39_14.amc")
    values = np.tile(walk.values, (4, 1))[:1320]
    # round the vertical, the root's order being zyx, and its other angles small
    values[:, walk.channels.index("root.ry")] += np.concatenate([np.zeros(1200), np.linspace(0, 90, 120)])
    seen: list[np.ndarray] = []
    encode = model.encode
    monkeypatch.setattr(model, "encode", lambda frames: seen.append(np.asarray(frames)) or encode(frames))
    model.start(replace(walk, values=values))
    turned = seen[0][:, model.contract.channels.index("root.ry")]
    assert turned.shape == (model.taps,)
    assert np.abs(turned).max() < 3 * 3.3  # three deviations of training


def test_a_run_is_written_as_it_is(model: TdbnModel, tmp_path: Path) -> None:
    motion = model.start("walk").run("walk 2s")[0]
    write_motion(tmp_path / "x.bvh", motion)
    root = positions(read_motion(tmp_path / "x.bvh"))[:, 0]
    assert np.linalg.norm((root[-1] - root[0])[[0, 2]]) > 1.5
    np.testing.assert_allclose(root, positions(motion)[:, 0], atol=1e-6)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"characters": 0}, "characters must be a whole number from 1 to 100000, not 0"),
        ({"characters": 10**12}, "from 1 to 100000"),
        ({"characters": 2.5}, "not 2.5"),
        ({"start": 3}, "cannot start from 3"),
        ({"characters": 2, "seed": [1]}, "one for each of 2"),
        ({"seed": 1.5}, "not 1.5"),
        ({"seed": -1}, "seed of 0 or more"),
        ({"variety": 1.5}, "between 0 and 1"),
        ({"variety": float("nan")}, "between 0 and 1"),
        ({"temperature": 0}, "between 0.01 and 100"),
        ({"iterations": 1.5}, "iterations must be a whole number"),
        ({"iterations": 2}, "without free hidden units"),
        ({"start": "swim"}, "expected one of walk, run, bend"),
    ],
)
def test_a_start_out_of_range_is_refused(model: TdbnModel, options: dict[str, object], reason: str) -> None:
    with pytest.raises(ControlError, match=reason):
        model.start(**options)  # type: ignore[arg-type]


def test_a_control_out_of_range_changes_nothing(model: TdbnModel) -> None:
    session = model.start(characters=2)
    session.control(run=0.5)
    before = session.snapshot().control
    for values, reason in (
        ({"fly": 1.0}, "unknown control fly; expected one of walk, run, bend"),
        ({"walk": 1.1}, "between 0 and 1"),
        ({"walk": [0.1, float("nan")]}, "between 0 and 1"),
        ({"walk": [0.1, 0.2, 0.3]}, "2 characters"),
        ({"walk": "fast"}, "needs a number"),
    ):
        with pytest.raises(ControlError, match=reason):
            session.control(**values)
    np.testing.assert_array_equal(session.snapshot().control, before)
    with pytest.raises(ControlError, match="shape"):
        session.set_control(np.zeros((3, 3)))
    with pytest.raises(ControlError, match="one value for each"):
        session.set_control([1.0])


def test_a_control_is_copied(model: TdbnModel) -> None:
    session, control = model.start(), np.array([[1.0, 0.0, 0.0]], dtype=np.float32)
    session.set_control(control)
    control[:] = 5.0
    np.testing.assert_array_equal(session.snapshot().control, [[1, 0, 0]])


def test_one_figure_runs_a_script_in_one_call(model: TdbnModel) -> None:
    motion = model.run("run .2s, walk .1s", seed=np.int64(3), variety=0.5)
    session = model.start("run", seed=3, variety=0.5)
    np.testing.assert_array_equal(motion.values, session.run("run .2s, walk .1s")[0].values)
    assert repr(session) == "TdbnSession(1 characters, tick 12, TdbnModel('tdbn', 59 channels, 40 fps))"
    assert repr(session.snapshot()) == "TdbnSnapshot(1 characters, tick 12)"


def test_a_motion_that_does_not_fit_is_refused(model: TdbnModel, clips: Path) -> None:
    walk = read_motion(clips / "39_14.amc")
    with pytest.raises(MotionError, match="needs 3 frames at 40 fps, this motion has 1"):
        model.start(walk[:3])
    with pytest.raises(MotionError, match=r"lacks 1 of 59 channels: rtoes.rx"):
        model.start(walk.select(tuple(name for name in walk.channels if name != "rtoes.rx")))


def test_frames_come_in_the_contract(model: TdbnModel) -> None:
    session = model.start(characters=3)
    frame = session.step()
    assert frame.dtype == np.float32
    assert frame.shape == (3, 59)
    motions = session.run("walk 1s")
    assert [type(motion) for motion in motions] == [Motion] * 3
    assert (motions[0].fps, len(motions[0]), set(motions[0].units)) == (40.0, 40, {"deg", "length"})
    assert set(session.run("walk 1s", in_place=True)[0].units) == {"deg"}
    assert session.frames(np.zeros((0, 3))).shape == (3, 0, 59)


@pytest.mark.parametrize("variety", [0.0, 0.7])
def test_the_net_runs_as_it_does_whatever_is_shown(model: TdbnModel, variety: float) -> None:
    smooth, plain = (model.start(characters=2, seed=1, variety=variety, smooth=s) for s in (True, False))
    changes = np.random.default_rng(0).uniform(size=(12, 2, 3))
    for control in changes.repeat([1, 1, 2, 3, 5, 1, 8, 2, 1, 1, 4, 9], axis=0):
        for session in (smooth, plain):
            session.set_control(control)
            session.step()
        np.testing.assert_allclose(smooth.snapshot().history, plain.snapshot().history, atol=1e-6)


def test_a_smooth_frame_is_the_mean_of_those_around_it(model: TdbnModel) -> None:
    """Under one control, against a loop over frames; before the first are those of the start."""
    plain = model.start(smooth=False).frames(np.eye(3)[[0] * 60])[0].astype(np.float64)
    shown = model.start().frames(np.eye(3)[[0] * 50])[0]
    every = np.concatenate([np.array(model.starts["walk"]), plain])
    weights = [np.exp(-0.5 * (apart / model.fps / 0.04) ** 2) for apart in range(-3, 4)]
    for frame, found in enumerate(shown, start=len(model.starts["walk"])):
        around = zip(weights, every[frame - 3 : frame + 4], strict=True)
        np.testing.assert_allclose(found, sum(w * f for w, f in around) / sum(weights), atol=1e-3)


def test_no_joint_leaps_when_the_control_does(model: TdbnModel) -> None:
    track = np.random.default_rng(0).uniform(size=(60, 3)).repeat(10, axis=0)
    leaps = [np.abs(np.diff(model.start(smooth=s).frames(track)[0], axis=0)).max() for s in (True, False)]
    assert leaps[0] <= 1.8 * 360 / 40 + 1e-3
    assert leaps[1] > 40
    # what is held back comes all the same
    held = model.start()
    held.frames(track)
    last, plain = (session.frames(np.eye(3)[[0] * 400])[0, -100:] for session in (held, model.start(smooth=False)))
    assert np.abs(last.max(axis=0) - plain.max(axis=0)).max() < 15


def test_frames_that_were_given_can_be_changed(model: TdbnModel) -> None:
    first, other = model.start(), model.start()
    for _ in range(5):
        frame = first.step()
        np.testing.assert_array_equal(frame, other.step())
        frame += 100


def test_what_is_shown_is_not_late(model: TdbnModel) -> None:
    smooth, plain = (model.start("run", smooth=s).frames(np.eye(3)[[1] * 400])[0, 200:] for s in (True, False))
    moving = model.contract.std > 5
    apart = [np.square(smooth[10:-10] - np.roll(plain, lag, axis=0)[10:-10])[:, moving].mean() for lag in range(-3, 4)]
    assert int(np.argmin(apart)) - 3 == 0


def test_a_snapshot_knows_what_has_been_run_ahead(model: TdbnModel) -> None:
    session = model.start(characters=2, seed=4, variety=0.3)
    session.frames(_track(model)[:13])
    saved, after = session.snapshot(), []
    for _ in range(2):
        session.restore(saved)
        session.control(run=[1.0, 0.5])
        after.append([session.step() for _ in range(20)])
    np.testing.assert_array_equal(*after)
    plain = model.start(characters=2, smooth=False)
    plain.restore(saved)
    plain.step()
    with pytest.raises(ControlError, match="not smooth does not fit"):
        session.restore(plain.snapshot())


def test_a_snapshot_of_the_first_tick_is_restored_where_another_began(model: TdbnModel) -> None:
    walking, running = model.start("walk"), model.start("run")
    running.restore(walking.snapshot())
    for _ in range(10):
        np.testing.assert_array_equal(running.step(), walking.step())


def _track(model: TdbnModel) -> np.ndarray:
    return control_track(parse_segments(SCRIPT, model.labels), model.labels, model.fps)


def _period(values: np.ndarray) -> float:
    """Frames to the highest peak of the autocorrelation beyond a quarter of a second."""
    signal = values - values.mean()
    curve = np.array([np.mean(signal[lag:] * signal[: len(signal) - lag]) for lag in range(min(50, len(signal) - 8))])
    return float(10 + np.argmax(curve[10:]))
