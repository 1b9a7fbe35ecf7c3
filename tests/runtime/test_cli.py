"""The command line as a user meets it: what it writes, and what it says when it cannot."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run

from motet.bundle.bundle import list_bundles
from motet.formats import read_motion
from motet.motion.kinematics import positions

WALK = "39_14.amc"
CMU = ("--bundle", "tdbn")


def test_a_script_becomes_a_motion_that_travels(tmp_path: Path) -> None:
    out = tmp_path / "out.bvh"
    result = run("control", *CMU, "walk 3s, walk>run 1s, run 3s", "-o", out)
    assert (result.exit_code, result.stdout) == (0, f"{out}: 280 frames at 40 fps, 7 s\n")
    motion = read_motion(out)
    root = positions(motion)[:, 0]
    assert len(motion) == 280
    speed = np.linalg.norm(np.diff(root[:, [0, 2]], axis=0), axis=1) * motion.fps  # metres a second
    assert 1 < np.median(speed[:100]) < 2  # the training walk goes at 1.4 m/s, the run at 3.4
    assert 2 < np.median(speed[-80:]) < 5
    again = tmp_path / "again.bvh"
    run("control", *CMU, "walk 3s, walk>run 1s, run 3s", "-o", again)
    assert again.read_bytes() == out.read_bytes()


def test_a_steered_figure_goes_where_its_script_says(tmp_path: Path) -> None:
    out = tmp_path / "out.bvh"
    result = run("control", "walk 2s speed 1.4, turn left 90, run 3s, stop", "-o", out)
    assert (result.exit_code, result.stdout) == (0, f"{out}: 240 frames at 30 fps, 8 s\n")
    root = positions(read_motion(out))[:, 0]
    speed = np.linalg.norm(np.diff(root[:, [0, 2]], axis=0), axis=1) * 30
    assert 1.2 < np.median(speed[30:60]) < 1.6
    assert 2 < np.median(speed[150:190]) < 3
    assert speed[-10:].max() < 0.3
    step = root[185] - root[150]
    assert abs(np.degrees(np.arctan2(step[0], step[2])) - 90) < 10
    noted = run("control", "walk 1s speed 9", "-o", out)
    assert "'walk' allows 0 or 0.1-1.92 m/s in this direction, not 9" in noted.stderr
    html = tmp_path / "out.html"
    assert run("control", "walk 1s, turn left 90", "--loose-feet", "-o", html).exit_code == 0
    assert "turn left 90" in html.read_text()


def test_control_starts_from_a_motion_and_varies(tmp_path: Path, clips: Path) -> None:
    frames = []
    for number, options in enumerate(
        ([], ["--start", clips / WALK], ["--start", "bend"], ["--variety", 1, "--seed", 5], ["--no-smooth"])
    ):
        out = tmp_path / f"{number}.npz"
        assert run("control", *CMU, "walk 1s", "-o", out, *options).exit_code == 0
        frames.append(read_motion(out).values)
    for i in range(len(frames)):
        for j in range(i):
            assert np.abs(frames[i][:, 3:] - frames[j][:, 3:]).max() > 1


def test_partial_takes_what_a_broken_file_has(tmp_path: Path, clips: Path) -> None:
    out, broken = tmp_path / "out.npz", tmp_path / "39_14.amc"
    broken.write_text((clips / WALK).read_text()[:-100])
    (tmp_path / "39.asf").write_bytes(next(clips.glob("*.asf")).read_bytes())
    assert run("convert", broken, out).exit_code == 1
    assert not out.exists()
    taken = run("--verbose", "convert", "--partial", broken, out)
    assert (taken.exit_code, "39_14.amc: the last frame is truncated and was left out" in taken.stderr) == (0, True)
    assert len(read_motion(out)) == len(read_motion(clips / WALK)) - 1


def test_convert_cuts_resamples_scales_and_mirrors(tmp_path: Path, clips: Path) -> None:
    out = tmp_path / "out.bvh"
    assert run("convert", clips / WALK, out, "--from", 1, "--to", 2, "--fps", 30, "--unit", "cm").exit_code == 0
    motion, source = read_motion(out), read_motion(clips / WALK)
    assert (len(motion), round(motion.fps, 6)) == (30, 30.0)
    np.testing.assert_allclose(positions(motion)[0, 0], positions(source)[120, 0] * 2.54 / 0.45, atol=1e-3)
    mirrored = tmp_path / "mirrored.npz"
    assert run("convert", clips / WALK, mirrored, "--mirror").exit_code == 0
    other = read_motion(mirrored)
    column = [m.channels.index(name) for m, name in ((other, "lfemur.rx"), (source, "rfemur.rx"))]
    np.testing.assert_allclose(other.values[:, column[0]], source.values[:, column[1]], atol=1e-3)


def test_view_prints_the_page_it_wrote(clips: Path) -> None:
    result = run("view", clips / WALK)
    assert result.exit_code == 0
    assert Path(result.stdout.strip()).read_text(encoding="utf-8").startswith("<!DOCTYPE html>")


def test_bundle_commands(tmp_path: Path) -> None:
    rows = json.loads(run("bundle", "list", "--json").stdout)
    assert {("tdbn", "control"), ("predict", "predict")} <= {(row["name"], row["verb"]) for row in rows}
    assert "tdbn" in run("bundle", "list").stdout
    assert json.loads(run("bundle", "info", "tdbn", "--json").stdout)["format"] == 3
    assert "NSF EIA-0196217" in run("bundle", "info", "tdbn").stdout
    verified = run("bundle", "verify", "tdbn", "--threads", 2, "--provider", "cpu").stdout
    assert "3 files match the manifest\nthe model runs on CPUExecutionProvider\n" in verified
    assert "golden vectors: the largest difference is " in verified
    assert run("bundle", "pack", "tdbn", "-o", tmp_path / "b.zip").exit_code == 0
    assert (tmp_path / "b.zip").read_bytes() == list_bundles()["tdbn"].read_bytes()


def test_bench_measures_a_file_and_says_where_it_ran(clips: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("motet.bench.measure.ROUNDS", 1)
    monkeypatch.setattr("motet.cli.bench.begun", lambda name, options: [])
    monkeypatch.setattr("motet.cli.bench.with_profiles", lambda rows, *_: rows)
    options = ("--seconds", 0.001, "--threads", 2, "--no-torch", "--force")
    lines = run("bench", "--bundle", "predict", "--motion", clips / WALK, *options).stdout.splitlines()
    assert lines[0] == "predict on CPUExecutionProvider, threads: 2"
    assert lines[-2].startswith("predict.file")
    assert not any("eager" in line for line in lines)


@pytest.mark.parametrize(
    ("code", "arguments", "said"),
    [
        (2, ["control", *CMU, "walk 3", "-o", "{out}/a.html"], "duration in seconds"),
        (2, ["control", *CMU, "swim 3s", "-o", "{out}/a.html"], "expected one of walk, run, bend"),
        (2, ["control", "walk 3", "-o", "{out}/a.html"], "expected seconds such as"),
        (2, ["control", "swim 3s", "-o", "{out}/a.html"], "unknown order 'swim'; expected one of walk, run"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--start", "fly"], "unknown gait 'fly'"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--variety", ".5"], "no setting 'variety'"),
        (2, ["control", *CMU, "walk 3s", "-o", "{out}/a.bvh", "--loose-feet"], "no setting 'hold_feet'"),
        (2, ["control", "walk 3s", "-o", "{out}/no/a.html"], "does not exist"),
        (2, ["control", "walk 3s", "-o", "{out}/a.xyz"], "expected one of .amc"),
        (2, ["control", "walk 3s", "-o", "{out}"], "expected one of .amc"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--bundle", "cmu"], "expected one of control"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--start", "fly", *CMU], "expected one of walk, run, bend"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--start", "fly.amc"], "no such file"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--variety", "2"], "range 0<=x<=1"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--temperature", "0"], "range 0.01<=x<=100"),
        (2, ["control", "walk 3s", "-o", "{out}/a.bvh", "--seed", "-1"], "x>=0"),
        (1, ["convert", "{clips}/none.amc", "{out}/a.bvh"], "no such file"),
        (1, ["convert", "{clips}/39_14.txt", "{out}/a.bvh"], "expected one of .amc"),
        (1, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--from", "3", "--to", "9"], "cannot cut 3 to 9 s"),
        (2, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--unit", "mile"], "is not one of"),
        (2, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--fps", "0"], "range 0<x<=10000"),
        (2, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--fps", "1e9"], "range 0<x<=10000"),
        (2, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--from", "-1"], "range x>=0"),
        (2, ["convert", "{clips}/39_14.amc"], "give IN and OUT"),
        (2, ["convert", "{clips}/39_14.amc", "{clips}/39_14.amc", "-o", "{out}/{{name}}.bvh"], "the same name"),
        (
            1,
            ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--from", "1", "--to", "1.001"],
            "no frame between 1 and 1.001",
        ),
        (1, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--fps-in", "nan"], "frame rate nan is out of range"),
        (1, ["convert", "{clips}/39_14.amc", "{out}/a.bvh", "--asf", "none.asf"], "none.asf: no such file"),
        (2, ["control", *CMU, "walk 0.001s", "-o", "{out}/a.bvh"], "less than one frame"),
        (2, ["control", "walk 1s", "--start", "{bad}/text.bvh", "-o", "{out}/a.bvh"], "text.bvh, line 1"),
        (2, ["predict", "{clips}/39_14.amc", "-o", "{out}/a.bvh", "--frames", "1000000000"], "range 1<=x<=100000"),
        (1, ["convert", "{bad}/broken.bvh", "{out}/a.npz"], "broken.bvh, line "),
        (1, ["convert", "{bad}/alone.amc", "{out}/a.npz"], "no skeleton found"),
        (1, ["view", "{bad}/text.bvh"], "text.bvh, line 1: "),
        (2, ["bundle", "verify", "{bad}"], "no manifest.json"),
        (2, ["bundle", "pack", "tdbn", "-o", "{out}/b.tar"], "is a .zip"),
        (2, ["bundle", "info", "nothing"], "expected one of control"),
        (
            2,
            ["control", "walk 3s", "-o", "{out}/a.bvh", "--provider", "none"],
            "has no provider 'none' here; available: ",
        ),
        (2, ["describe", "{clips}/39_14.amc", "--threads", "257"], "257 is not in the range 1<=x<=256"),
        (2, ["bundle", "verify", "tdbn", "--provider", "none"], "has no provider 'none' here"),
        (2, ["bench", "--provider", "OpenVINO"], "in place of onnxruntime:  pip install onnxruntime-openvino"),
    ],
)
def test_bad_input_gets_one_message_and_writes_nothing(
    code: int, arguments: list[str], said: str, tmp_path: Path, out: Path, clips: Path
) -> None:
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "broken.bvh").write_text(
        "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 3 Zrotation Yrotation Xrotation\n"
        "End Site\n{\nOFFSET 0 1 0\n}\n}\n"
        "MOTION\nFrames: 1\nFrame Time: 0.1\n1 2 x\n"
    )
    (bad / "text.bvh").write_text("hello")
    (bad / "alone.amc").write_bytes((clips / WALK).read_bytes())
    result = run(*(argument.format(out=out, clips=clips, bad=bad) for argument in arguments))
    check_refused(result, said, out, code)


def test_a_command_without_its_extra_says_how_to_get_it(tmp_path: Path) -> None:
    """As in an environment without torch: the import system finds no torch."""
    (tmp_path / "sitecustomize.py").write_text(
        "import importlib.util as u; find = u.find_spec\n"
        "u.find_spec = lambda name, *rest: None if name == 'torch' else find(name, *rest)\n"
    )
    code = "from motet.cli import main; main()"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])}
    done = subprocess.run(
        [sys.executable, "-c", code, "train"], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 2
    assert "pip install 'motet[train]'" in done.stderr
