"""Motions in place: what stays, what goes, on figures whose root is not the hips too, and in every command."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from test_retarget import SKELETONS, dancing, skeleton_file

import motet
from motet.errors import MotionError
from motet.motion import HUMANOID, Motion, Skeleton, from_humanoid, global_transforms, in_place, positions
from motet.motion.kinematics import motion_of


def test_the_way_over_the_ground_goes_and_all_else_stays() -> None:
    motion = dancing()
    still = in_place(motion)
    moved, stayed = positions(motion), positions(still)
    np.testing.assert_array_equal(stayed[:, 0, [0, 2]], 0)
    np.testing.assert_array_equal(stayed[:, 0, 1], moved[:, 0, 1])
    np.testing.assert_allclose(stayed - stayed[:, :1], moved - moved[:, :1], atol=1e-12)
    assert (still.channels, still.fps, still.skeleton) == (motion.channels, motion.fps, motion.skeleton)
    np.testing.assert_array_equal(in_place(still).values, still.values)


def test_a_pelvis_below_a_root_stays_over_the_origin_too() -> None:
    motion = from_humanoid(dancing(), skeleton_file("unreal"))
    pelvis = motion.skeleton.index("pelvis")
    places = positions(in_place(motion))
    np.testing.assert_allclose(places[:, [0, pelvis]][..., [0, 2]], 0, atol=1e-9)
    expected = positions(motion)
    np.testing.assert_allclose(places[:, 2:] - places[:, 1:2], expected[:, 2:] - expected[:, 1:2], atol=1e-9)
    np.testing.assert_allclose(places[:, 1:, 1], expected[:, 1:, 1], atol=1e-9)


def test_a_figure_that_stands_along_z_keeps_its_height() -> None:
    motion, turn = dancing(), np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    joints = [replace(joint, offset=tuple(turn @ joint.offset)) for joint in HUMANOID.joints]
    rotations, places = global_transforms(motion)
    lying = motion_of(Skeleton(tuple(joints), 1.0), turn @ rotations @ turn.T, {0: places[:, 0] @ turn.T}, 30.0)
    np.testing.assert_allclose(positions(in_place(lying)), positions(in_place(motion)) @ turn.T, atol=1e-9)


def test_what_has_no_path_comes_back_and_what_has_no_skeleton_is_refused() -> None:
    motion = dancing()
    angles = motion.select(tuple(name for name in motion.channels if "hips.t" not in name))
    np.testing.assert_array_equal(in_place(angles).values, angles.values)
    assert len(in_place(motion[:0])) == 0
    with pytest.raises(MotionError, match="no skeleton"):
        in_place(Motion([[0.0]], ("a.rx",), ("deg",), 30))


@pytest.mark.parametrize(
    "command",
    [
        ("convert", "dance.bvh", "-o", "out.npz"),
        ("generate", "a person walks", "--max-seconds", 2, "-o", "out.npz"),
        ("predict", "dance.npz", "--frames", 6, "-o", "out.npz"),
        ("predict", "dance.npz", "--frames", 6, "--append", "-o", "out.npz"),
        ("fill", "dance.npz", "--gap", "1:1.5", "-o", "out.npz"),
        ("join", "dance.npz", "dance.npz", "-o", "out.npz"),
        ("control", "walk 1s", "-o", "out.npz"),
        ("control", "--bundle", "tdbn", "walk .5s", "-o", "out.npz"),
    ],
    ids=lambda command: " ".join(map(str, command[:2])),
)
def test_every_command_that_writes_a_motion_has_the_options(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: tuple[object, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    motet.write("dance.npz", dancing())
    motet.write("dance.bvh", dancing())
    assert run(*command).exit_code == 0
    plain = motet.read("out.npz")
    result = run(*command, "--in-place", "--fps", 24, "--like", SKELETONS / "mixamo.bvh")
    assert result.exit_code == 0
    assert " at 24 fps, " in result.stdout
    written = motet.read("out.npz")
    assert written.skeleton.names[0] == "mixamorig:Hips"
    assert written.fps == 24
    assert written.duration == pytest.approx(plain.duration, abs=0.05)
    np.testing.assert_array_equal(positions(written)[:, 0, [0, 2]], 0)
    assert np.ptp(positions(written)[:, 0, 1]) > 0


def test_predict_says_where_the_prediction_starts_at_another_rate(tmp_path: Path) -> None:
    motet.write(tmp_path / "a.npz", dancing())
    said = [
        run("predict", tmp_path / "a.npz", "--frames", 6, "--append", "-o", tmp_path / "b.npz", *fps).stdout
        for fps in ((), ("--fps", 60))
    ]
    assert "predicted from 3 s on (frame 90, " in said[0]
    assert "predicted from 3 s on (frame 180, " in said[1]


def test_travel_gives_a_clip_in_place_its_way_back(tmp_path: Path, clips: Path) -> None:
    walk = motet.to_humanoid(motet.read(clips / "39_14.amc")).motion
    motet.write(tmp_path / "in.npz", in_place(walk))
    assert run("convert", tmp_path / "in.npz", tmp_path / "out.npz", "--travel").exit_code == 0
    found, expected = (positions(motion)[:, 0] for motion in (motet.read(tmp_path / "out.npz"), walk))
    np.testing.assert_array_equal(found[:, 1], expected[:, 1])
    went, should = (places[-1] - places[0] for places in (found, expected))
    assert np.linalg.norm(went - should) < 0.08 * np.linalg.norm(should)
