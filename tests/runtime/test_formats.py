"""What holds for every format: one table of them, files and file objects, options, and readers that never fall over."""

import io
import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from figures import WRITTEN, walker

from motet.errors import FormatError, MotionError, OutputError
from motet.formats import FORMATS, MOCAP, READABLE, read_motion, write_motion

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "formats.md"


def test_the_table_of_the_docs_is_made_of_the_formats() -> None:
    found = re.search("<!-- formats -->\n(.*?)<!-- /formats -->", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    yes = {True: "yes", False: ""}
    rows = [
        f"| `{f.extension}` | {f.name} | {yes[bool(f.reader)]} | {yes[bool(f.writer)]} | {f.keeps} |" for f in FORMATS
    ]
    head = ["| extension | format | reads | writes | what it keeps |", "|---|---|---|---|---|"]
    assert found is not None
    assert found[1].splitlines() == head + rows


def test_every_format_has_the_functions_that_its_record_says() -> None:
    for kind in FORMATS:
        assert callable(kind.module().read) if kind.reader else kind.writer
        assert not kind.writer or (kind.needs and find_spec(kind.needs) is None) or callable(kind.write())
    assert set(MOCAP) <= set(READABLE)


@pytest.mark.parametrize("extension", ["bvh", "npz", "csv", "glb"])
def test_file_objects_are_read_and_written(tmp_path: Path, extension: str) -> None:
    content = io.BytesIO()
    write_motion(content, walker(), format=extension)
    write_motion(tmp_path / f"a.{extension}", walker())
    assert content.getvalue() == (tmp_path / f"a.{extension}").read_bytes()
    content.seek(0)
    again = read_motion(content, format=f".{extension.upper()}")
    np.testing.assert_array_equal(again.values, read_motion(tmp_path / f"a.{extension}").values)
    with (tmp_path / f"a.{extension}").open("rb") as opened:
        assert len(read_motion(opened)) == len(again)  # its name says the format
    with pytest.raises(FormatError, match="<file object>: cannot read a file without an extension; expected one of"):
        read_motion(content)
    with pytest.raises(OutputError, match="cannot write"), (tmp_path / f"a.{extension}").open("rb") as opened:
        write_motion(opened, walker())


def test_an_amc_file_object_needs_its_skeleton(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.amc", walker())
    content = io.BytesIO((tmp_path / "a.amc").read_bytes())
    assert len(read_motion(content, format="amc", asf=tmp_path / "a.asf")) == 40
    with pytest.raises(FormatError, match="pass it as asf"):
        read_motion(io.BytesIO(), format="amc")
    with pytest.raises(FormatError, match="AMC consists of two files"):
        write_motion(io.BytesIO(), walker(), format="amc")


def test_a_unit_is_told_where_the_file_does_not_say_it(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.bvh", walker())
    assert read_motion(tmp_path / "a.bvh").skeleton.metres_per_unit is None
    assert read_motion(tmp_path / "a.bvh", unit="cm").skeleton.metres_per_unit == 0.01
    assert read_motion(tmp_path / "a.bvh", unit=0.5).skeleton.metres_per_unit == 0.5
    write_motion(tmp_path / "b.npz", walker(metres_per_unit=0.01))
    for unit in ("cm", "m"):  # what the file says counts
        assert read_motion(tmp_path / "b.npz", unit=unit).skeleton.metres_per_unit == 0.01
    write_motion(tmp_path / "c.csv", walker())
    for name, unit, said in (
        ("c.csv", "m", "a file without a skeleton has no length unit"),
        ("a.bvh", "mile", r"a.bvh: expected a length unit \(m, cm"),
        ("a.bvh", 0, "number of metres, not 0"),
        ("a.bvh", float("nan"), "number of metres, not nan"),
    ):
        with pytest.raises(FormatError, match=said):
            read_motion(tmp_path / name, unit=unit)


@pytest.mark.parametrize(
    ("height", "unit", "expected"),
    [
        (170.0, None, 1.0),
        (170.0, "cm", 0.01),
        (67.0, "inch", 0.0254),
        (30.0, "cm", 0.01),  # a toy
        (1.7, "cm", 1.0),  # in metres, as it says
        (1.7, 0.9144, 0.9144),
        (0.1, "inch", 0.0254),
    ],
)
def test_a_unit_counts_for_gltf_where_its_metre_is_no_better(
    height: float, unit: str | float | None, expected: float, tmp_path: Path
) -> None:
    motion = walker(metres_per_unit=None)
    figure = walker(metres_per_unit=None, scale=height / motion.skeleton.height)
    write_motion(tmp_path / "a.glb", figure)
    read = read_motion(tmp_path / "a.glb", unit=unit)
    assert (read.skeleton.metres_per_unit, read.skeleton.height) == (expected, pytest.approx(height))


def test_options_that_a_format_does_not_take_are_refused(tmp_path: Path) -> None:
    write_motion(tmp_path / "a.bvh", walker())
    for options, said in (
        ({"fps": 30}, "'fps' is an option for .amc .npz files only"),
        ({"asf": "a.asf"}, "'asf' is an option for .amc files only"),
        ({"format": "npz", "partial": True}, "'partial' is an option for .amc .bvh files only"),
    ):
        with pytest.raises(FormatError, match=said):
            read_motion(tmp_path / "a.bvh", **options)
    assert len(read_motion(tmp_path / "a.bvh", partial=True)) == 40


def test_places_that_are_no_files_are_named(tmp_path: Path) -> None:
    (tmp_path / "folder.bvh").mkdir()
    (tmp_path / "round.bvh").symlink_to(tmp_path / "round.bvh")
    for name, said in (
        ("none.bvh", "no such file"),
        ("folder.bvh", "it is not a file"),
        ("round.bvh", "a link that leads nowhere"),
        ("a" * 300 + ".bvh", "cannot be read"),
        ("a.bvh/b.bvh", "no such file"),
        ("a.txt", "cannot read files of type '.txt'; expected one of .amc .bvh .npz .csv .xml"),
        ("a.c3d", r"cannot read files of type '.c3d', which hold markers without a skeleton: .* expected one of .amc"),
    ):
        with pytest.raises(FormatError, match=said):
            read_motion(tmp_path / name)


NEEDED = {
    "no skeleton": (replace(walker(), skeleton=None), (".npz", ".csv")),
    "no frames": (walker()[:0], (".npz", ".csv", ".bvh", ".amc")),
}
"""What is said -> of which motion, and the formats that hold it nevertheless."""


@pytest.mark.parametrize("extension", WRITTEN)
@pytest.mark.parametrize("said", NEEDED)
def test_what_a_format_needs_is_said_and_nothing_written(tmp_path: Path, extension: str, said: str) -> None:
    path = tmp_path / f"a{extension}"
    motion, holding = NEEDED[said]
    if extension in holding:
        write_motion(path, motion)
        assert len(read_motion(path)) == len(motion)
        return
    with pytest.raises(MotionError, match=said):
        write_motion(path, motion)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("extension", WRITTEN)
def test_what_cannot_be_written_leaves_nothing(tmp_path: Path, extension: str) -> None:
    motion = walker()
    high = replace(motion.skeleton.joints[-1], offset=(0.0, 1e308, 0.0))
    tall = replace(motion, skeleton=replace(motion.skeleton, joints=(*motion.skeleton.joints[:-1], high)))
    huge = motion.values / np.abs(motion.values).max() * 1.7e308
    radians = replace(motion, values=huge, units=tuple(unit.replace("deg", "rad") for unit in motion.units))
    path = tmp_path / f"a{extension}"
    for broken in (replace(motion, values=motion.values + 1e308), radians, tall):
        try:
            write_motion(path, broken)
        except MotionError:
            assert list(tmp_path.iterdir()) == []
            continue
        if extension in READABLE:
            assert len(read_motion(path)) == len(motion)
        for file in tmp_path.iterdir():
            file.unlink()
    with pytest.raises(OutputError, match="does not exist"):
        write_motion(tmp_path / "no" / f"a{extension}", motion)
    path.mkdir()
    with pytest.raises(OutputError, match="it is a folder"):
        write_motion(path, motion)
