"""Clips in place: which are, which are not, and the path that their feet imply."""

import csv
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from figures import walker

import motet
from motet.motion import (
    HUMANOID,
    Motion,
    Skeleton,
    from_humanoid,
    global_transforms,
    in_place,
    is_in_place,
    mirror,
    positions,
    with_travel,
)
from motet.motion.kinematics import posed

WALK, RUN = "39_14.amc", "09_07.amc"


@pytest.fixture(scope="module", params=[WALK, RUN])
def recorded(request: pytest.FixtureRequest, clips: Path) -> Motion:
    return motet.to_humanoid(motet.read(clips / request.param)).motion


def path_of(motion: Motion) -> np.ndarray:
    return positions(motion)[:, 0]


def way_of(motion: Motion) -> np.ndarray:
    path = path_of(motion)
    return path[-1] - path[0]


def on_treadmill(motion: Motion, share: float) -> Motion:
    """The motion with a share of its path over the ground."""
    path = path_of(motion)
    return posed(motion, {}, {"hips": path[:1] * (1 - share) * [1, 0, 1] + path * [share, 1, share]})


@pytest.mark.parametrize("fps", [120, 60, 30, 24])
def test_a_recording_travels_and_the_same_in_place_is_found(recorded: Motion, fps: float) -> None:
    motion = recorded.resample(fps)
    assert not is_in_place(motion)
    assert is_in_place(in_place(motion))
    assert is_in_place(mirror(in_place(motion)))
    assert not is_in_place(with_travel(in_place(motion)))


def test_the_path_comes_back_and_nothing_else_changes(recorded: Motion) -> None:
    still = in_place(recorded)
    laid = with_travel(still)
    assert np.linalg.norm(way_of(laid) - way_of(recorded)) < 0.1 * np.linalg.norm(way_of(recorded))
    assert laid.channels == still.channels
    np.testing.assert_array_equal(path_of(laid)[0], path_of(still)[0])
    same = [i for i, name in enumerate(laid.channels) if name not in ("hips.tx", "hips.tz")]
    np.testing.assert_array_equal(laid.values[:, same], still.values[:, same])


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_treadmill_that_goes_slower_than_the_feet_is_left(recorded: Motion, share: float) -> None:
    assert not is_in_place(on_treadmill(recorded, share))


@pytest.mark.parametrize("name", ["mixamo", "unreal", "unity"])
def test_any_figure_in_any_unit(recorded: Motion, name: str, tmp_path: Path) -> None:
    """In Unreal's rig the root at the floor carries the path, and the hips below it the rest."""
    motet.write(tmp_path / "a.bvh", recorded.resample(30), like=name)
    own = motet.read(tmp_path / "a.bvh")
    still = in_place(own)
    assert (is_in_place(own), is_in_place(still)) == (False, True)
    found, true = (way_of(motet.to_humanoid(motion).motion) for motion in (with_travel(still), own))
    assert np.linalg.norm(found - true) < 0.12 * np.linalg.norm(true)


def test_a_file_with_z_up(recorded: Motion) -> None:
    joints = (replace(joint, offset=(joint.offset[0], -joint.offset[2], joint.offset[1])) for joint in HUMANOID.joints)
    own = from_humanoid(recorded, Skeleton(tuple(joints), 1.0))
    rotations, places = global_transforms(own)
    up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    own = posed(own, {"hips": up @ rotations[:, 0]}, {"hips": places[:, 0] @ up.T})
    assert np.ptp(path_of(own)[:, 2]) < 0.2  # z is up
    still = in_place(own)
    assert (is_in_place(own), is_in_place(still)) == (False, True)
    assert np.linalg.norm(way_of(with_travel(still)) - way_of(own)) < 0.12 * np.linalg.norm(way_of(own))


def stepping(slides: float) -> Motion:
    """A figure that steps on the spot for 4 s; its feet go back by so many degrees of the thigh while they stand."""
    time = np.arange(120) / 30
    swing = [np.sin(2 * np.pi * time + phase) for phase in (0, np.pi)]
    lift = [np.clip(np.cos(2 * np.pi * time + phase), 0, 1) for phase in (0, np.pi)]
    columns = {"hips.tx": 0 * time, "hips.ty": 0.93 + 0 * time, "hips.tz": 0 * time}
    for side, swung, lifted in zip(("left", "right"), swing, lift, strict=True):
        columns[f"{side}UpperLeg.rx"] = -slides * swung - 40 * lifted
        columns[f"{side}LowerLeg.rx"] = 80 * lifted
        columns[f"{side}Foot.rx"] = slides * swung - 40 * lifted
    units = ("length",) * 3 + ("deg",) * 6
    return Motion(np.column_stack(list(columns.values())), tuple(columns), units, 30, HUMANOID)


def test_steps_on_the_spot_are_no_clip_in_place() -> None:
    """A march: each foot is set down where it was. The same with legs that swing is a walk on a treadmill."""
    assert not is_in_place(stepping(0))
    assert is_in_place(stepping(20))


def test_a_moment_is_no_clip_in_place() -> None:
    """Ten frames are what a predictor sees: a blow may look like a stride for so long, and half a stride too."""
    for start in range(0, 60, 5):
        assert not is_in_place(stepping(20)[start : start + 10])
    assert is_in_place(stepping(20)[:15])


def lying(motion: Motion) -> Motion:
    """The motion on its back, as one that rides a bicycle in the air."""
    down = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    turned = np.broadcast_to(down, (len(motion), 3, 3))
    return posed(motion, {"hips": turned}, {"hips": np.tile([0, 0.15, 0], (len(motion), 1))})


def test_what_is_no_walk(recorded: Motion) -> None:
    still = in_place(recorded)
    assert not is_in_place(lying(still))
    for frames in (0, 1, 2, 3):
        assert not is_in_place(still[:frames])
    t_pose = replace(still, values=np.zeros_like(still.values))
    assert not is_in_place(t_pose)
    angles = still.select(tuple(name for name in still.channels if name[-2] != "t"))
    assert not is_in_place(angles)  # no word of where the root is
    assert not is_in_place(Motion([[0.0]] * 9, ("a.rx",), ("deg",), 30))
    assert len(with_travel(still[:1])) == 1
    with pytest.raises(motet.MotionError):
        with_travel(Motion([[0.0]], ("a.rx",), ("deg",), 30))


def test_figures_that_are_not_measured_are_left() -> None:
    assert not is_in_place(walker(40))


def test_every_verb_lays_the_path_and_says_so(clips: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    walk = motet.to_humanoid(motet.read(clips / WALK)).motion.resample(60)[:240]
    still = in_place(walk)
    motet.write("walk.npz", still)
    laid = with_travel(still)
    with pytest.warns(motet.TravelWarning, match="feet stride while the root stays") as caught:
        found = motet.load("describe").describe(still, beams=1)
    assert caught[0].filename == __file__
    assert found == motet.load("describe").describe(laid, beams=1)
    told = "motet: walk.npz: the feet stride while the root stays"
    result = run("describe", "walk.npz", "--beams", 1, "--json")
    assert json.loads(result.stdout)[0]["hypotheses"] == [one.to_json() for one in found]
    assert (result.stderr.startswith(told), result.stderr.count("\n")) == (True, 1)
    commands = (
        (["describe", "walk.npz", "--timeline", "--json"], True),
        (["predict", "walk.npz", "-o", "out.npz", "--append", "--json"], True),
        (["embed", "walk.npz", "-o", "out.npy"], False),
        (["fill", "walk.npz", "--gap", "1:1.5", "-o", "out.npz"], False),
        (["join", "walk.npz", "walk.npz", "-o", "out.npz"], False),
    )
    for command, as_json in commands:
        result = run(*command)
        assert "the feet stride while the root stays" in result.stderr
        assert not as_json or all(row["in_place"] for row in json.loads(result.stdout))
        if command[-1] == "out.npz" or "--append" in command:
            went = way_of(motet.to_humanoid(motet.read("out.npz")).motion)
            assert np.linalg.norm(went) > 0.9 * np.linalg.norm(way_of(walk))
    motet.write("moving.npz", laid)
    moving = run("describe", "moving.npz", "--beams", 1, "--json")
    assert (moving.stderr, json.loads(moving.stdout)[0]["in_place"]) == ("", False)


def test_search_and_check_say_it(clips: Path, tmp_path: Path) -> None:
    walk = motet.to_humanoid(motet.read(clips / WALK)).motion.resample(30)
    motet.write(tmp_path / "still.npz", in_place(walk))
    motet.write(tmp_path / "moving.npz", walk)
    for _ in range(2):  # the second time from the index
        hits = json.loads(run("search", "a person walks", tmp_path, "--json").stdout)
        assert {Path(hit["path"]).stem: hit["in_place"] for hit in hits} == {"still": True, "moving": False}
        assert abs(hits[0]["score"] - hits[1]["score"]) < 0.1
    found = run("search", tmp_path / "still.npz", tmp_path)
    assert "still.npz: the feet stride while the root stays" in found.stderr
    assert "s, in place: " in found.stdout
    assert [motet.check(tmp_path / f"{name}.npz").strides for name in ("still", "moving")] == [True, False]
    assert "the feet stride while the root stays" in run("check", tmp_path / "still.npz").stdout


STEP_IN_PLACE = {
    "Crouch_Fwd_Loop", "Jog_Fwd_Loop", "Push_Loop", "Run_Anime", "Sprint_Loop", "Sword_Attack", "Walk_Formal_Loop",
    "Walk_Loop",
}  # fmt: skip


def test_clips_of_games_and_recordings(shared: Path, cmu: Path, tmp_path: Path) -> None:
    """Of 77 clips 13 are in place. The five that are not found crawl, fly, roll and swim; none is found that is not."""
    with zipfile.ZipFile(shared / "cc0-clips.zip") as archive:
        archive.extractall(tmp_path)
    found = {path.stem for path in (tmp_path / "glb").iterdir() if is_in_place(motet.read(path))}
    assert found == {f"CC0_{name}" for name in STEP_IN_PLACE}
    rows = csv.DictReader((tmp_path / "clips.tsv").open(), delimiter="\t")
    assert found < {row["clip"] for row in rows if row["in_place"] == "yes"}
    assert not [path.stem for path in sorted((cmu / "amc").glob("*.amc"))[::8] if is_in_place(motet.read(path))]
