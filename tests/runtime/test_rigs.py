"""Rigs by name: their joints, a motion there and back, and what a name that is none gives."""

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from command_line import check_refused, run
from test_retarget import SKELETONS, dancing

import motet
from motet.errors import MotionError
from motet.figures.humanoid.bones import LEG, RIGS, sided
from motet.motion import HUMANOID, Motion, positions, rig

NAMES = {
    "mixamo": ("mixamorig:Hips", "mixamorig:Spine2", "mixamorig:LeftForeArm", "mixamorig:RightToeBase"),
    "rigify": ("DEF-spine", "DEF-spine.003", "DEF-forearm.L", "DEF-toe.R"),
    "unity": ("Hips", "UpperChest", "LeftLowerArm", "RightToes"),
    "unreal": ("pelvis", "spine_05", "lowerarm_l", "ball_r"),
}
"""Of each rig hips, the last joint of the back, a left and a right joint, as the programs call them."""


def grounded() -> Motion:
    """A motion of the humanoid whose feet are on the ground already."""
    return motet.to_humanoid(dancing()).motion


def test_the_tables_that_have_a_rig_are_those_that_can_be_named() -> None:
    tables = (files("motet.figures.humanoid") / "conventions").iterdir()
    found = {table.name: json.loads(table.read_text("utf-8")) for table in tables}
    assert sorted(name for name, table in found.items() if "rig" in table) == [f"{name}.json" for name in RIGS]
    with pytest.raises(MotionError, match="there is no rig 'maya'; expected one of mixamo, rigify, unity, unreal"):
        rig("maya")


@pytest.mark.parametrize("name", RIGS)
def test_a_rig_stands_as_the_humanoid_does(name: str) -> None:
    skeleton = rig(name)
    places = skeleton.rest_positions + skeleton.offsets[0]
    expected = HUMANOID.rest_positions + HUMANOID.offsets[0]
    bones = ("hips", "upperChest", "leftLowerArm", "rightToes")
    for joint, bone in zip(NAMES[name], bones, strict=True):
        place = places[skeleton.index(joint)] * skeleton.metres_per_unit
        np.testing.assert_allclose(place, expected[HUMANOID.index(bone)], atol=1e-12)
    assert max(places @ [0, 1, 0]) * skeleton.metres_per_unit == pytest.approx(1.7)


@pytest.mark.parametrize("extension", [".bvh", ".glb", ".npz"])
@pytest.mark.parametrize("name", RIGS)
def test_a_motion_comes_back_from_a_rig(tmp_path: Path, name: str, extension: str) -> None:
    motion, path = grounded(), tmp_path / f"a{extension}"
    motet.write(path, motion, like=name)
    found = motet.to_humanoid(motet.read(path))
    title = json.loads((files("motet.figures.humanoid") / "conventions" / f"{name}.json").read_text("utf-8"))["title"]
    assert (found.convention, found.confidence) == (title, 1.0)
    off = np.abs(positions(found.motion) - positions(motion)).max(axis=(0, 2))
    exact = ["hips", *(sided(side, part) for side in ("left", "right") for part in LEG)]
    assert max(off[HUMANOID.index(bone)] for bone in exact) < 2e-6
    # backs and necks of other numbers of joints bend a little elsewhere
    assert off.max() < (2e-6 if name in ("mixamo", "unity") else 0.012)


def test_the_root_at_the_floor_travels_and_hips_of_other_rigs_do(tmp_path: Path) -> None:
    motion = grounded()
    motet.write(tmp_path / "a.npz", motion, like="unreal")
    written = motet.read(tmp_path / "a.npz")
    places, hips = positions(written) / 100, positions(motion)[:, 0]
    np.testing.assert_allclose(places[:, 0], hips * [1, 0, 1], atol=1e-9)
    np.testing.assert_allclose(places[:, 1], hips, atol=1e-9)
    motet.write(tmp_path / "b.npz", motion, like="unity")
    np.testing.assert_allclose(positions(motet.read(tmp_path / "b.npz"))[:, 0], hips, atol=1e-9)


def test_rigs_go_by_name_on_the_command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    motet.write("in.npz", grounded())
    assert run("convert", "in.npz", "out.npz", "--like", "unreal", "--in-place").exit_code == 0
    written = motet.read("out.npz")
    assert written.skeleton.names[:2] == ("root", "pelvis")
    np.testing.assert_allclose(positions(written)[:, :2][..., [0, 2]], 0, atol=1e-9)
    said = "maya: no such file, and there is no rig 'maya'; expected one of mixamo, rigify, unity, unreal"
    (tmp_path / "out").mkdir()
    check_refused(run("convert", "in.npz", "out/a.bvh", "--like", "maya"), said, tmp_path / "out")
    Path("mixamo").write_bytes((SKELETONS / "rokoko.bvh").read_bytes())
    refused = run("convert", "in.npz", "out/a.bvh", "--like", "mixamo")
    check_refused(refused, "mixamo: cannot read a file without an extension", tmp_path / "out")
