"""The command line over many files, its help and its log; and that it does what three lines of Python do."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import check_refused, run
from figures import WRITTEN

import motet
from motet.cli import COMMANDS, NEEDS, main
from motet.formats import FORMATS

WALK, RUN = "39_14.amc", "09_07.amc"


def test_describe_is_three_lines_of_python(clips: Path) -> None:
    printed = json.loads(run("describe", clips / WALK, "--json").stdout)[0]["hypotheses"]
    model = motet.load("describe")
    motion = motet.read(clips / WALK)
    assert printed == [found.to_json() for found in model.describe(motion)]


@pytest.mark.parametrize(
    ("command", "made"),
    [
        (("generate", "a person walks"), lambda _: motet.load("generate").generate("a person walks")[0]),
        (("predict", "{clips}/39_14.amc"), lambda clips: motet.load("predict").predict(motet.read(clips / WALK))),
        (("control", "run 1s, walk 1s"), lambda _: motet.load("control").run("run 1s, walk 1s")),
        (("control", "run 1s, walk 1s", "--bundle", "tdbn"), lambda _: motet.load("tdbn").run("run 1s, walk 1s")),
    ],
)
def test_a_command_is_three_lines_of_python(
    command: tuple[str, ...], made: Callable[[Path], Any], tmp_path: Path, clips: Path
) -> None:
    run(*(word.format(clips=clips) for word in command), "-o", tmp_path / "cli.bvh")
    motet.write(tmp_path / "library.bvh", made(clips))
    assert (tmp_path / "cli.bvh").read_bytes() == (tmp_path / "library.bvh").read_bytes()


def test_embed_is_three_lines_of_python(tmp_path: Path, clips: Path) -> None:
    run("embed", clips / WALK, clips / RUN, "-o", tmp_path / "cli.npy")
    model = motet.load("describe")
    vectors = model.embed([motet.read(clips / WALK), motet.read(clips / RUN)])
    np.save(tmp_path / "library.npy", vectors)
    assert (tmp_path / "cli.npy").read_bytes() == (tmp_path / "library.npy").read_bytes()


@pytest.mark.parametrize("command", [["convert"], ["predict", "--frames", 3], ["view"]])
def test_each_file_is_tried_and_each_failure_is_named(tmp_path: Path, clips: Path, command: list[object]) -> None:
    (tmp_path / "bad.bvh").write_text("hello")
    files = [clips / RUN, tmp_path / "bad.bvh", tmp_path / "none.npz", clips / WALK]
    result = run(*command, *files, "-o", tmp_path / "{name}.html")
    assert result.exit_code == 1
    assert [line.split(": ")[1] for line in result.stderr.splitlines()] == [f"{files[1]}, line 1", f"{files[2]}"]
    assert len(result.stdout.splitlines()) == 2
    assert {path.name for path in tmp_path.glob("*.html")} == {"09_07.html", "39_14.html"}


@pytest.mark.parametrize(
    "command",
    [
        ("control", "--bundle", "tdbn", "walk .5s", "--in-place"),
        ("predict", "{source}", "--frames", "5"),
        ("fill", "{source}", "--gap", ".5:.7"),
    ],
)
def test_commands_write_every_format(tmp_path: Path, clips: Path, command: tuple[str, ...]) -> None:
    source = tmp_path / "source.npz"
    motet.write(source, motet.read(clips / WALK).resample(30)[:40])
    for extension in WRITTEN:
        out = tmp_path / f"out{extension}"
        assert run(*(word.format(source=source) for word in command), "-o", out).exit_code == 0
        assert out.stat().st_size > 500


@pytest.mark.parametrize(
    ("extra", "command"), [("live", ("live", "--port", 8765)), ("mmcp", ("serve", "--mmcp")), ("serve", ("serve",))]
)
def test_an_extra_is_named_where_it_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, extra: str, command: tuple[object, ...]
) -> None:
    if extra == "mmcp":
        pytest.importorskip("python_multipart")  # what the server itself needs is named first
    monkeypatch.setattr("motet.cli.NEEDS", {extra: ("no_such_package",)})
    said = f"needs no_such_package: install the extra with  pip install 'motet[{extra}]'"
    check_refused(run(*command), said, tmp_path)


def test_results_are_numbered_where_no_name_is_asked_for(tmp_path: Path, clips: Path) -> None:
    assert run("convert", clips / RUN, clips / WALK, "-o", tmp_path / "out.npz").exit_code == 0
    for number, source in enumerate((RUN, WALK), start=1):
        expected = motet.read(clips / source).values
        np.testing.assert_array_equal(motet.read(tmp_path / f"out-{number}.npz").values, expected)


def test_a_unit_for_a_mixed_folder_loses_no_file(tmp_path: Path, clips: Path) -> None:
    metres = motet.to_humanoid(motet.read(clips / WALK)).motion
    centimetres = metres.scaled(0.01)
    motet.write(tmp_path / "metres.glb", metres)
    motet.write(tmp_path / "centimetres.bvh", centimetres)
    motet.write(tmp_path / "centimetres.glb", motet.read(tmp_path / "centimetres.bvh"))  # which does not say its unit
    files = [clips / WALK, *sorted(tmp_path.iterdir())]
    result = run("describe", *files, "--unit-in", "cm", "--beams", 1, "--json")
    assert (result.exit_code, result.stderr) == (0, "")
    _, *rows = json.loads(result.stdout)
    texts = {row["hypotheses"][0]["text"] for row in rows}
    assert (len(rows), len(texts)) == (3, 1)


def test_a_unit_loses_no_file_of_a_folder_that_is_searched_and_is_the_one_reason_where_it_is_wrong(
    tmp_path: Path, clips: Path
) -> None:
    for name in (WALK, "39_14.asf"):
        (tmp_path / name).write_bytes((clips / name).read_bytes())
    motet.write(tmp_path / "centimetres.bvh", motet.read(clips / WALK), like="mixamo")
    mixamo = motet.read(tmp_path / "centimetres.bvh", unit="cm")
    motet.write(tmp_path / "other.bvh", mixamo.scaled(0.05))  # legs of 17 cm, if these were centimetres
    result = run("search", "a person walks", tmp_path, "--unit-in", "cm", "--json")
    assert {Path(row["path"]).name for row in json.loads(result.stdout)} == {WALK, "centimetres.bvh"}
    assert result.stderr.startswith(f"motet: {tmp_path / 'other.bvh'}: legs of 0.168 m: ")
    assert result.stderr.count("\n") == 1
    assert "give the right unit" in result.stderr
    assert "lacks joints" not in result.stderr


def test_the_frame_rate_and_the_skeleton_of_an_amc_can_be_told(tmp_path: Path, clips: Path) -> None:
    skeleton = tmp_path / "elsewhere.txt"
    skeleton.write_bytes((clips / WALK).with_suffix(".asf").read_bytes())
    (tmp_path / "walk.amc").write_bytes((clips / WALK).read_bytes())
    out = tmp_path / "out.npz"
    assert run("convert", tmp_path / "walk.amc", out, "--fps-in", 60, "--asf", skeleton).exit_code == 0
    assert motet.read(out).fps == 60


def test_help_lists_commands_whose_extra_is_missing_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(NEEDS, "train", ("no_such_package",))
    here, _, others = run("--help").stdout.partition("Commands of extras, installed with  pip install 'motet[EXTRA]'")
    assert "\n  describe " in here
    assert "\n  train " not in here
    assert re.search(r"^  train +Train a model. \[train\]$", others, re.MULTILINE)


def test_a_misspelt_command_is_told_its_name_and_an_interrupted_one_ends_with_130(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert "No such command 'desribe'. Did you mean 'describe'?" in run("desribe").stderr
    assert "No such command 'xyz'." in run("xyz").stderr

    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("motet.cli.bundles.list_bundles", interrupted)
    result = run("bundle", "list")
    assert (result.exit_code, result.stderr) == (130, "")


def test_help_ends_its_lines_in_whole_words() -> None:
    text = run("--help").stdout.partition("Commands:")[2]
    for name, (_, _, help_line) in COMMANDS.items():
        assert re.search(rf"^  {name} +\S", text, re.MULTILINE)
        assert help_line.endswith(".")
    assert "..." not in text + run("bundle", "--help").stdout.partition("Commands:")[2]
    help_of_convert = " ".join(run("convert", "--help").stdout.split())
    for kind in FORMATS:
        assert help_of_convert.count(f"{kind.extension} ({kind.name})") == bool(kind.reader) + bool(kind.writer)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no full device here")
@pytest.mark.parametrize("arguments", [["bundle", "list"], ["--help"], ["convert", "{clips}/39_14.amc", "{out}/a.npz"]])
def test_a_full_disk_behind_stdout_is_one_message(arguments: list[str], tmp_path: Path, clips: Path) -> None:
    code = "from motet.cli import main; main()"
    words = [argument.format(clips=clips, out=tmp_path) for argument in arguments]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code, *words], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert done.stderr == f"motet: cannot print the results: {os.strerror(28)}\n"


def test_the_public_names_are_there_and_geometry_is_in_its_module() -> None:
    assert all(hasattr(motet, name) for name in motet.__all__)
    assert {"read", "write", "load", "Motion"} <= set(motet.__all__)
    assert motet.motion.lateral_axis is not None
    assert repr(motet.load("describe")) == "DescribeModel('describe', 69 channels, 10 fps)"


def test_a_fault_of_a_file_is_not_said_of_the_output(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> dict[str, Path]:
        raise FileNotFoundError(2, "No such file or directory", "lost.zip")

    monkeypatch.setattr("motet.cli.bundles.list_bundles", fail)
    with pytest.raises(FileNotFoundError, match=r"lost\.zip"):
        main.main(["bundle", "list"])


def test_no_result_is_written_over_what_is_read(tmp_path: Path, clips: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("a.npz", "b.npz"):
        motet.write(name, motet.read(clips / WALK)[:60])
    content = Path("a.npz").read_bytes()
    for command in (
        ("convert", "a.npz", tmp_path / "a.npz"),
        ("convert", "b.npz", "a.npz", "-o", "{name}.npz"),
        ("predict", "a.npz", "-o", "./a.npz", "--append"),
        ("fill", "a.npz", "--gap", ".2:.3", "-o", "a.npz"),
        ("join", "b.npz", "a.npz", "-o", "a.npz"),
    ):
        result = run(*command)
        assert result.exit_code == 2
        assert ".npz is an input and would be overwritten: name another file for the result" in result.stderr
    assert Path("a.npz").read_bytes() == content
