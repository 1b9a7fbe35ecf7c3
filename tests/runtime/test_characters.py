"""Motions put onto characters when they are written, and what the public names do."""

from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from test_retarget import SKELETONS, dancing

import motet
from motet.errors import FormatError, MotionError
from motet.formats import Character, read_character
from motet.motion import MIXAMO


def test_a_motion_is_written_onto_a_character_given_in_any_way(tmp_path: Path) -> None:
    motion, path = dancing(), SKELETONS / "mixamo.bvh"
    example = motet.read(path)
    expected = motet.from_humanoid(motion, like=example)
    motet.write(tmp_path / "expected.bvh", expected)
    content = (tmp_path / "expected.bvh").read_bytes()
    for like in (path, str(path), example, Character(example)):
        motet.write(tmp_path / "a.bvh", motion, like=like)
        assert (tmp_path / "a.bvh").read_bytes() == content
    with path.open("rb") as opened:
        file = BytesIO()
        motet.write(file, motion, format="bvh", like=opened)
    assert file.getvalue() == content
    motet.write(tmp_path / "b.npz", motion, like=MIXAMO)
    assert motet.read(tmp_path / "b.npz").skeleton == MIXAMO
    assert [skeleton.names[0] for skeleton in (example.skeleton, expected.skeleton)] == ["mixamorig:Hips"] * 2


def test_a_motion_of_another_figure_is_brought_to_the_humanoid_on_the_way(tmp_path: Path) -> None:
    source, like = motet.read(SKELETONS / "unreal.bvh"), SKELETONS / "mixamo.bvh"
    motet.write(tmp_path / "a.npz", source, like=like)
    motet.write(tmp_path / "b.npz", motet.to_humanoid(source).motion, like=like)
    np.testing.assert_array_equal(motet.read(tmp_path / "a.npz").values, motet.read(tmp_path / "b.npz").values)


def test_a_motion_on_the_characters_skeleton_stays_as_it_is(tmp_path: Path) -> None:
    source = motet.read(SKELETONS / "rokoko.bvh")
    motet.write(tmp_path / "a.npz", source, like=source)
    np.testing.assert_array_equal(motet.read(tmp_path / "a.npz").values, source.values)


def test_what_is_no_character_is_refused_and_nothing_written(tmp_path: Path) -> None:
    for like, error, said in (
        (tmp_path / "none.glb", FormatError, "none.glb: no such file"),
        (tmp_path / "a.txt", FormatError, "cannot read files of type '.txt'"),
        (
            motet.Motion([[0.0]], ("wrist.rx",), ("deg",), 30),
            MotionError,
            "cannot take a motion: .* no skeleton",
        ),
    ):
        with pytest.raises(error, match=said):
            motet.write(tmp_path / "out.bvh", dancing(), like=like)
    assert not (tmp_path / "out.bvh").exists()
    with pytest.raises(FormatError, match="no such file"):
        read_character(tmp_path / "none.bvh")
