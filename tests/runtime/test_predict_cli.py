"""``motet predict`` with the shipped bundle, as a user meets it."""

from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from figures import walker

from motet.draw.page import write as write_page
from motet.formats import read_motion, write_motion
from motet.models.load import load
from motet.motion.kinematics import positions

WALK = "39_14.amc"


def test_a_walk_goes_on(clips: Path) -> None:
    """Trial 39_14 is none of those that the bundle was trained on."""
    walk = read_motion(clips / WALK).resample(30.0, to_end=True)
    model = load("predict")
    truth = positions(walk)[60:85]
    assert walk.skeleton is not None
    metres = walk.skeleton.unit_factor(1.0)
    off = np.linalg.norm(positions(model.predict(walk[:60])) - truth, axis=-1).mean(axis=1) * metres
    still = np.linalg.norm(positions(walk)[59] - truth, axis=-1).mean(axis=1) * metres
    assert off[0] < 0.02
    assert off[-1] < 0.25 < still[-1]


def test_a_bvh_is_carried_on_as_the_amc_it_was_made_from(tmp_path: Path, clips: Path) -> None:
    assert run("convert", clips / WALK, tmp_path / "a.bvh", "--unit", "m").exit_code == 0
    assert run("predict", tmp_path / "a.bvh", "--unit-in", "m", "-o", tmp_path / "b.bvh").exit_code == 0
    assert run("predict", clips / WALK, "-o", tmp_path / "c.npz").exit_code == 0
    one, other = read_motion(tmp_path / "b.bvh"), read_motion(tmp_path / "c.npz")
    assert one.channels == read_motion(tmp_path / "a.bvh").channels
    assert (one.fps, len(one)) == (pytest.approx(30.0), 25)
    assert other.skeleton is not None
    places = [positions(one), positions(other) * other.skeleton.unit_factor(1.0)]
    # an AMC file has no channel for some turns that the model predicts, by a degree or so
    np.testing.assert_allclose(places[0][0], places[1][0], atol=0.03)


def test_append_writes_the_motion_before_what_follows(tmp_path: Path, clips: Path) -> None:
    out = tmp_path / "out.npz"
    result = run("-v", "predict", clips / WALK, "-o", out, "--frames", 40, "--append")
    assert "resampled 1 of 1 motions to 30 fps" in result.stderr
    motion, walk = read_motion(out), read_motion(clips / WALK).resample(30.0, to_end=True)
    assert (result.exit_code, len(motion)) == (0, len(walk) + 40)
    assert result.stdout.endswith(f"predicted from {walk.duration:.3g} s on (frame {len(walk)}, counted from 0)\n")
    np.testing.assert_allclose(positions(motion)[: len(walk)], positions(walk), atol=1e-5)
    steps = np.linalg.norm(np.diff(positions(motion)[:, 0], axis=0), axis=1)
    assert np.abs(np.diff(steps))[len(walk) - 3 : len(walk) + 3].max() < 0.3 * steps.mean()  # no jolt at the seam


@pytest.fixture(scope="module")
def bad(clips: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of motions that cannot be continued."""
    folder = tmp_path_factory.mktemp("bad")
    walk = read_motion(clips / WALK)
    write_motion(folder / "walker.npz", walker())
    write_motion(folder / "short.npz", walk[:36])
    write_motion(folder / "still.npz", walk.select(walk.channels[3:]))
    write_motion(folder / "nan.bvh", walk)
    text = (folder / "nan.bvh").read_text().splitlines()
    (folder / "nan.bvh").write_text("\n".join([*text[:-1], text[-1].replace(text[-1].split()[7], "nan", 1)]))
    return folder


@pytest.mark.parametrize(
    ("code", "arguments", "said"),
    [
        (2, ["{clips}/39_14.amc", "-o", "{out}/a.xyz"], "expected one of .amc"),
        (2, ["{clips}/39_14.amc", "-o", "{out}/no/a.bvh"], "does not exist"),
        (1, ["{clips}/none.amc", "-o", "{out}/a.bvh"], "no such file"),
        (2, ["{clips}/39_14.amc", "-o", "{out}/a.bvh", "--bundle", "cmu"], "unknown bundle 'cmu'"),
        (2, ["{clips}/39_14.amc", "-o", "{out}/a.bvh", "--bundle", "tdbn"], "is for 'control'"),
        (2, ["{clips}/39_14.amc", "-o", "{out}/a.bvh", "--frames", "0"], "range 1<=x<=100000"),
        (1, ["{bad}/walker.npz", "-o", "{out}/a.bvh"], "no joint was found for spine, leftFoot"),
        (
            1,
            ["{bad}/short.npz", "-o", "{out}/a.bvh"],
            "needs 10 frames at 30 fps, but the motion has 9 (36 at 120 fps)",
        ),
        (1, ["{bad}/still.npz", "-o", "{out}/a.bvh"], "lacks the root's tx, ty and tz"),
        (1, ["{bad}/nan.bvh", "-o", "{out}/a.bvh"], "nan.bvh, line "),
    ],
)
def test_bad_input_gets_one_message_and_writes_nothing(
    code: int, arguments: list[str], said: str, tmp_path: Path, clips: Path, bad: Path
) -> None:
    result = run("predict", *(argument.format(out=tmp_path, clips=clips, bad=bad) for argument in arguments))
    check_refused(result, said, tmp_path, code)


def test_a_page_says_where_the_prediction_begins(tmp_path: Path, clips: Path) -> None:
    page, twin, data = tmp_path / "out.html", tmp_path / "twin.html", tmp_path / "out.npz"
    for out in (page, data):
        assert run("predict", clips / WALK, "-o", out, "--frames", 5, "--append").exit_code == 0
    motion = read_motion(data)
    start = (len(motion) - 5) / motion.fps
    write_page(twin, motion, [(0, "given"), (start, "predicted")], "39_14")
    assert page.read_bytes() == twin.read_bytes()
