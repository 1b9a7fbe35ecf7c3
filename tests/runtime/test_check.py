"""``motet check``: what is found of files whose figure, place and way are known, and how a folder is told."""

import json
import re
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from command_line import check_refused, run
from figures import walker
from gltf_files import write_clips

import motet
from motet.corpus import checked
from motet.corpus.checked import Checked
from motet.errors import MotionError
from motet.motion import HUMANOID, Motion

FRAMES, FPS = 40, 30.0


def going(
    turned: float = 30.0, ground: float = 0.2, way: tuple[float, float] = (3.0, 4.0), dip: float = 0.0, axis: str = "y"
) -> Motion:
    """The humanoid in its T-pose, turned by degrees about an axis, on a ground, along x and z in metres.

    dip: metres by which it is deeper in a single frame.
    """
    place = np.linspace(0, 1, FRAMES)
    height = np.full(FRAMES, 0.98 + ground)
    height[7] -= dip
    values = np.stack([way[0] * place, height, way[1] * place, np.full(FRAMES, turned)], axis=1)
    channels = ("hips.tx", "hips.ty", "hips.tz", f"hips.r{axis}")
    return Motion(values, channels, ("length",) * 3 + ("deg",), FPS, HUMANOID)


@pytest.mark.parametrize("extension", [".bvh", ".glb", ".npz"])
@pytest.mark.parametrize("metres", [1.0, 0.01])
def test_what_is_found_is_what_was_written(extension: str, metres: float, tmp_path: Path) -> None:
    path = tmp_path / f"a{extension}"
    motet.write(path, going(dip=0.05).scaled(metres))
    found = motet.check(path)
    assert (found.file, found.frames, found.fps, found.refused) == (str(path), FRAMES, FPS, None)
    assert (found.convention, found.confidence, found.sure) == ("Unity Humanoid, VRM", 1.0, True)
    assert found.unit == (1.0 if extension == ".glb" else metres)  # glTF has metres
    expected = {"height": 1.7, "facing": 30.0, "ground": 0.2, "lowest": 0.15, "travel": 5.0, "seconds": FRAMES / FPS}
    for name, value in expected.items():
        assert getattr(found, name) == pytest.approx(value, abs=2e-3), name
    assert found.bones["leftFoot"] == ("leftFoot",)


def test_facing_and_place(tmp_path: Path) -> None:
    for turned in (0.0, -90.0, 170.0):
        motet.write(tmp_path / "a.npz", going(turned, way=(0.1, 0.1)))
        found = motet.check(tmp_path / "a.npz")
        assert found.facing == pytest.approx(turned, abs=1e-6)
        assert found.in_place
    motet.write(tmp_path / "a.npz", going(-90.0, axis="x"))
    assert motet.check(tmp_path / "a.npz").facing is None  # it lies on its back


def test_clips_and_what_is_no_human(tmp_path: Path) -> None:
    path = write_clips(tmp_path / "a.glb", [("Stay", going(way=(0, 0))), ("Go", going())])
    first, second = motet.check(path), motet.check(f"{path}#Go")
    assert first.clips == second.clips == ("Stay", "Go")
    assert (first.clip, first.in_place, second.clip, second.in_place) == ("Stay", True, "Go", False)
    assert motet.check(path, clip=2) == second
    motet.write(tmp_path / "b.npz", walker())
    refused = motet.check(tmp_path / "b.npz")
    assert (refused.frames, refused.joints, refused.sure) == (40, 14, False)
    with pytest.raises(MotionError, match=re.escape(str(refused.refused))):
        motet.to_humanoid(walker())
    assert refused.convention is refused.height is refused.travel is None


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A human's two clips, a file that is broken, one that is no human's, one that is no motion file, a hidden one."""
    below = tmp_path / "motions" / "below"
    below.mkdir(parents=True)
    motet.write(below / "c.npz", going())
    write_clips(below.parent / "a.glb", [("Stay", going(way=(0, 0))), ("Go", going())])
    (below.parent / "b.bvh").write_text("HIERARCHY\nnonsense\n")
    motet.write(below.parent / "z.npz", walker())
    (below.parent / "readme.txt").write_text("no motion")
    motet.write(below.parent / ".hidden.npz", going())
    return below.parent


def test_a_folder_is_a_table(folder: Path) -> None:
    result = run("check", folder)
    assert (result.exit_code, result.stderr) == (1, "")
    lines = [line.split() for line in result.stdout.splitlines()]
    assert lines[0][:3] == ["file", "figure", "sure"]
    assert [line[0] for line in lines[1:]] == [
        str(folder / "a.glb"),
        "#Stay",
        "#Go",
        str(folder / "b.bvh"),
        str(folder / "below/c.npz"),
        str(folder / "z.npz"),
        "5",
    ]
    assert lines[3][-8:] == ["1.00", "1.70", "1.33", "30", "30°", "left", "0.20", "5.00"]
    assert lines[2][-2:] == ["in", "place"]
    assert lines[4][1:4] == ["unreadable:", "line", "2:"]
    assert lines[6][1] == "refused:"
    assert result.stdout.splitlines()[-1] == "5 motions: 3 understood, 1 unreadable, 1 refused"
    assert run("check", folder / "below").exit_code == 0


def test_json_has_all_that_the_library_finds(folder: Path) -> None:
    result = run("check", folder, "--json")
    assert result.exit_code == 1
    rows = json.loads(result.stdout)
    given = [f"{folder / 'a.glb'}#Stay", f"{folder / 'a.glb'}#Go", folder / "below/c.npz", folder / "z.npz"]
    found = [json.loads(json.dumps(motet.check(path).to_json())) for path in given]
    assert [row for row in rows if "error" not in row] == found
    assert (rows[2]["file"], rows[2]["error"][:7]) == (str(folder / "b.bvh"), "line 2:")


def test_a_single_motion_is_told_whole(folder: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    told = run("check", folder / "a.glb", "--clip", "Go", "-o", page)
    assert (told.exit_code, told.stderr) == (0, "")
    lines = [line.split(maxsplit=1) for line in told.stdout.splitlines()[1:]]
    assert lines == [
        ["clip", "Go, 2 of 2"],
        ["figure", "Unity Humanoid, VRM, confidence 1.00"],
        ["size", "1.70 m tall; lengths are in metres"],
        ["facing", "30° left in the first frame; ahead is +z"],
        ["ground", "soles stand at 0.20 m; lowest point 0.20 m"],
        ["travel", "5.00 m"],
        ["length", "40 frames at 30 fps, 1.33 s"],
        ["page", str(page)],
    ]
    assert "as in the file" in page.read_text()
    assert "as the humanoid" in page.read_text()


def test_what_is_refused_has_a_page_of_its_own_figure(folder: Path, tmp_path: Path) -> None:
    told = run("check", folder / "z.npz", "-o", tmp_path / "page.html")
    assert told.exit_code == 1
    assert "refused" in told.stdout
    assert "as the humanoid" not in (tmp_path / "page.html").read_text()


def test_each_line_is_printed_before_the_next_file_is_read(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    done: list[str] = []
    look, echo = checked.check, click.echo

    def looking(file: Path, **options: Any) -> Checked:
        done.append("look")
        return look(file, **options)

    def printing(text: str) -> None:
        done.append("print")
        echo(text)

    monkeypatch.setattr(checked, "check", looking)
    monkeypatch.setattr(click, "echo", printing)
    run("check", folder, "--json")
    assert done == ["look", "print"] * 5 + ["print"]  # and the bracket


def test_refusals(folder: Path, out: Path) -> None:
    check_refused(run("check", out), "no motion files", out)
    check_refused(run("check", folder, "-o", out / "a.bvh"), "ends in .html", out)
    check_refused(run("check"), "Missing argument", out)
    gone = run("check", out / "gone.bvh")
    assert (gone.exit_code, gone.stdout.split(maxsplit=2)[1:]) == (1, ["unreadable", "no such file\n"])
