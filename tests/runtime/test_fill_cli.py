"""``motet fill`` and ``motet join`` with the shipped bundle, as a user meets them."""

from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run

import motet
from motet.formats import read_motion
from motet.motion import Motion, positions
from motet.predict.fill import FillModel

WALK, RUN = "39_14.amc", "09_07.amc"


@pytest.fixture(scope="module")
def model() -> FillModel:
    return motet.load("fill")


def error(found: Motion, truth: Motion) -> float:
    """Metres that joints are away from the truth, in the second from 1 to 2."""
    assert truth.skeleton is not None
    part = slice(round(truth.fps), round(2 * truth.fps))
    off = np.linalg.norm(positions(found)[part] - positions(truth)[part], axis=-1)
    return float(off.mean()) * truth.skeleton.unit_factor(1.0)


def test_a_second_of_a_walk_is_filled_better_than_by_interpolation(model: FillModel, walk: Motion) -> None:
    """Nobody who trained the net has walked as this trial: its person is not among those of the training."""
    start, stop = 120, 240
    part = np.linspace(0, 1, stop - start + 2)[1:-1, None]
    whole = walk.continuous()
    values = np.array(whole.values)
    values[start:stop] = values[start - 1] + part * (values[stop] - values[start - 1])
    lines = Motion(values, whole.channels, whole.units, whole.fps, whole.skeleton)
    filled = model.fill(walk, [(1.0, 2.0)])
    assert error(filled, walk) < 0.5 * error(lines, walk)
    assert error(filled, walk) < 0.06


def test_the_command_gives_what_the_library_gives(model: FillModel, walk: Motion, tmp_path: Path, clips: Path) -> None:
    out = tmp_path / "out.npz"
    result = run("fill", clips / WALK, "--gap", "2.0:2.5", "--gap", "1:1.5", "-o", out)
    assert (result.exit_code, result.stdout) == (0, f"{out}: 399 frames at 120 fps, 3.33 s\n")
    np.testing.assert_array_equal(read_motion(out).values, model.fill(walk, [(1.0, 1.5), (2.0, 2.5)]).values)
    assert run("fill", clips / WALK, "--loop", "--seconds", 0.3, "-o", out).exit_code == 0
    np.testing.assert_array_equal(read_motion(out).values, model.looped(walk, seconds=0.3).values)
    assert run("fill", clips / WALK, "--loop", "-o", out).exit_code == 0
    np.testing.assert_array_equal(read_motion(out).values, model.looped(walk).values)
    assert run("join", clips / WALK, clips / WALK, "-o", out).exit_code == 0
    np.testing.assert_array_equal(read_motion(out).values, model.join(walk, walk).values)


def test_several_files_are_filled_and_what_fails_is_named(tmp_path: Path, clips: Path) -> None:
    result = run("fill", clips / WALK, clips / RUN, "--gap", "1:1.5", "-o", tmp_path / "{name}.npz")
    assert result.exit_code == 1
    assert "09_07.amc: the gap 1:1.5 s is not within the motion of 1.15 s" in result.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["39_14.npz"]


def test_joining_another_figure_says_so(tmp_path: Path, clips: Path) -> None:
    result = run("join", clips / WALK, clips / RUN, "--seconds", 0.5, "-o", tmp_path / "out.bvh")
    assert result.exit_code == 0
    assert "motet: retargeted the second motion to the figure of the first" in result.stderr


NO_GAP = "is no gap: give its start and stop in seconds, such as 1.0:2.0"
EITHER = "give --gap START:STOP, once or several times, or --loop"
TRANSITION = "a transition takes more than 0 and at most 2 seconds"
LOOP = ("fill", "--loop", "--seconds")


@pytest.mark.parametrize(
    ("command", "said", "code"),
    [
        *((("fill", "--gap", gap), NO_GAP, 2) for gap in ("1.0", "1-2", "a:b", "1:2:3", "", "nan:1", "1:inf", ":")),
        (("fill",), EITHER, 2),
        (("fill", "--gap", "1:2", "--loop"), EITHER, 2),
        (("fill", "--gap", "1:2", "--seconds", 1), EITHER, 2),
        (("fill", "--seconds", 0.5), EITHER, 2),
        (("fill", "--gap", "3:3.325"), "at the very end", 1),
        *(((*LOOP, seconds), TRANSITION, 1) for seconds in (0, -1, 5)),
        *((("join", "{run}", "--seconds", seconds), TRANSITION, 2) for seconds in (0, -1, 5)),
        (("join", "{run}", "--bundle", "predict"), "bundle predict is for 'predict'; need one for 'fill'", 2),
    ],
)
def test_what_cannot_be_filled_is_refused(
    command: tuple[object, ...], said: str, code: int, tmp_path: Path, clips: Path
) -> None:
    verb, *options = (str(word).format(run=clips / RUN) for word in command)
    check_refused(run(verb, clips / WALK, *options, "-o", tmp_path / "out.npz"), said, tmp_path, code)


def test_pages_say_what_is_filled(tmp_path: Path, clips: Path) -> None:
    page = tmp_path / "out.html"
    assert run("fill", clips / WALK, "--gap", "1:1.5", "--gap", ".25:.5", "-o", page).exit_code == 0
    said = '"captions":[[0.0,"given"],[0.25,"filled"],[0.5,"given"],[1.0,"filled"],[1.5,"given"]]'
    assert said in page.read_text(encoding="utf-8")
    assert run("join", clips / WALK, clips / RUN, "-o", page, "--seconds", 0.5).exit_code == 0
    text = page.read_text(encoding="utf-8")
    assert '[0.0,"39_14"]' in text
    assert '"filled"]' in text
    assert '"09_07"]]' in text
