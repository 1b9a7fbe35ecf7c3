"""Compositions: against stories, against geometry that is worked out here, and refusals."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet import Moment
from motet.composition.compose import met
from motet.composition.plans import parse_plan, read_plan
from motet.motion import HUMANOID, Motion, positions
from motet.motion.rotations import Array

SKELETONS = Path(__file__).parent / "skeletons"
HAND_UP = motet.read(SKELETONS / "mixamo.bvh", unit="cm")[1:2]
HIPS = [HUMANOID.index(f"{side}UpperLeg") for side in ("left", "right")]
PLAN = "0s at 1 2 facing 90 a person walks; 3s at 4 3 a person waves; 4.5s facing 45; 6s"


def facing(motion: Motion) -> Array:
    """Degrees, by the line from hip to hip."""
    left, right = (positions(motion)[:, joint] for joint in HIPS)
    across = left - right
    return np.degrees(np.arctan2(-across[:, 2], across[:, 0]))


def frame(seconds: float) -> int:
    return round(30 * seconds) - 1


def test_without_anything_to_meet_it_is_the_story(codes_model: motet.CodesModel) -> None:
    found = motet.compose(codes_model, parse_plan("0s a person jumps; 2s a person waves; 5s"), seed=3)
    story = codes_model.story(["a person jumps", "a person waves"], seconds=[2, 3], seed=3)
    assert len(found.motion) == 150
    assert not found.met
    np.testing.assert_allclose(positions(found.motion)[:, 0], positions(story.motion)[:, 0], atol=0.01)
    assert [(one.text, one.action) for one in found.passages] == [(one.text, one.action) for one in story.passages]


def test_places_and_facings_are_met_and_told(codes_model: motet.CodesModel) -> None:
    found = motet.compose(codes_model, parse_plan(PLAN))
    root = positions(found.motion)[:, 0]
    for at, place in ((0, (1, 2)), (3, (4, 3))):
        np.testing.assert_allclose(root[max(0, frame(at)), [0, 2]], place, atol=0.02)
    assert facing(found.motion)[0] == pytest.approx(90, abs=5)
    assert facing(found.motion)[frame(4.5)] == pytest.approx(45, abs=5)
    told = {(one.at, one.what): one for one in found.met}
    assert list(told) == [(0, "place"), (0, "facing"), (3, "place"), (4.5, "facing")]
    assert all(one.off < 2 and one.late < 0.1 for one in told.values())
    assert next(one.action for one in found.passages) == "walk, steered"


def test_what_is_not_met_is_told(codes_model: motet.CodesModel) -> None:
    """What is told of a motion that somebody else made."""
    still = codes_model.story("a person stands still", seconds=3).motion
    root, turned = positions(still)[:, 0], facing(still)
    place, seen = met(still, [Moment(1.0, place=(3.0, 4.0), facing=120.0)])
    assert place.off == pytest.approx(100 * math.dist(root[29, [0, 2]], (3, 4)), rel=1e-6)
    assert seen.off == pytest.approx(abs(120 - turned[29]), abs=5)


def test_a_start_moves_all_of_it(codes_model: motet.CodesModel) -> None:
    here, there = (motet.compose(codes_model, parse_plan(f"0s {at} a person walks; 3s at {to}; 4s")).motion
                   for at, to in (("", "1 2"), ("at 5 6 facing 90", "7 5")))  # fmt: skip
    one, other = positions(here), positions(there)
    turned = np.stack([one[..., 2] + 5, one[..., 1], 6 - one[..., 0]], axis=-1)  # a quarter turn to the left
    np.testing.assert_allclose(other, turned, atol=1e-3)


@pytest.mark.parametrize("text", ["a person walks", "a person stands still"])
def test_the_pose_of_another_figure_is_met(codes_model: motet.CodesModel, text: str) -> None:
    moments = [Moment(0, text), Moment(2, pose=HAND_UP), Moment(4)]
    found = motet.compose(codes_model, moments)
    (met,) = found.met
    assert met.off < 5
    assert met.late < 0.1
    hand, head = (positions(found.motion)[:, HUMANOID.index(name), 1] for name in ("leftHand", "head"))
    assert hand[frame(2)] > head[frame(2)] + 0.2
    assert hand[frame(1)] < head[frame(1)]  # it comes, and goes again
    assert hand[frame(3)] < head[frame(3)]


def test_poses_that_follow_each_other_at_once_and_at_the_ends(codes_model: motet.CodesModel) -> None:
    moments = [Moment(at, "a person stands still" if not at else None, pose=HAND_UP) for at in (0, 0.4, 1, 2)]
    found = motet.compose(codes_model, moments)
    assert all(one.off < 5 for one in found.met)
    assert len(found.met) == 4
    steps = np.linalg.norm(np.diff(positions(found.motion), axis=0), axis=-1)
    assert steps.max() < 0.15  # metres a frame


def test_feet_do_not_slide_more_than_when_steered(codes_model: motet.CodesModel) -> None:
    found = motet.compose(codes_model, parse_plan("0s a person walks; 3s at 1 3; 6s at 4 4"))
    toes = positions(found.motion)[:, [HUMANOID.index(f"{side}Toes") for side in ("left", "right")]]
    speeds = 30 * np.linalg.norm(np.diff(toes[..., [0, 2]], axis=0), axis=-1)
    assert np.median(speeds.min(axis=1)) < 0.06  # of the foot that stands, m/s
    assert positions(found.motion)[..., 1].min() > -0.02


def test_a_file_a_script_and_the_command_say_the_same(codes_model: motet.CodesModel, tmp_path: Path) -> None:
    motet.write(tmp_path / "up.bvh", motet.read(SKELETONS / "mixamo.bvh", unit="cm"))
    rows = [
        {"at": 0, "text": "a person walks"},
        {"at": 2, "place": [0, 2], "facing": 90, "text": "a person waves"},
        {"at": 3, "pose": "up.bvh", "pose_at": 0.04},
        {"at": 4},
    ]
    (tmp_path / "plan.json").write_text(json.dumps(rows))
    script = f"0s a person walks; 2s at 0 2 facing 90 a person waves\n3s pose {tmp_path / 'up.bvh'}@0.04; 4"
    one, other = read_plan(tmp_path / "plan.json"), parse_plan(script)
    for left, right in zip(one, other, strict=True):
        assert (left.at, left.text, left.facing, left.pose_at) == (right.at, right.text, right.facing, right.pose_at)
    out, own = tmp_path / "out.bvh", tmp_path / "own.bvh"
    said = json.loads(run("compose", tmp_path / "plan.json", "-o", out, "--json").stdout)
    motet.write(own, motet.compose(codes_model, other).motion)
    assert out.read_bytes().split(b"MOTION")[1] == own.read_bytes().split(b"MOTION")[1]
    assert [one["what"] for one in said["met"]] == ["place", "facing", "pose"]
    told = run("compose", script, "-o", out).stdout
    assert "2 s place: 0.0 cm off" in told
    assert "(as: walk, steered)" in told


@pytest.mark.parametrize(
    ("script", "said"),
    [
        ("", "expected a time"),
        ("a person walks", "expected a time"),
        ("0s a person walks; 3s at nan 3", "at X Z"),
        ("0s a person walks; 3s facing 9 at 0 3", "in this order"),
        ("0s a person walks; -3s", "at must be 0 to 600"),
        ("0s a person walks; 3s at 0 1e9", "at X Z"),
        ("0s a person walks; 3s at 0 12345; 9s", "place must be"),
        ("1s a person walks; 3s", "begins with a prompt at 0 s"),
        ("0s a person walks", "begins with a prompt at 0 s, and its last moment is its end"),
        ("0s a person walks; 3s at 0 3; 2s; 4s", "moment 3 is at 2 s, the one before it at 3 s"),
        ("0s a person walks; 3s at 0 3; 3s at 1 3; 4s", "moment 3 is at 3 s"),
        ("0s a person walks; 2s; 4s", "moment 2, at 2 s, asks for nothing"),
        ("0s a person walks; 2s a person waves", "'a person waves' needs a later one"),
        ("0s a person walks; 2s a person waves; 2.2s", "'a person waves' has 0.2 s"),
        ("0s a person walks; 2s at 0 9; 3s", "9.0 m at up to 1.92 m/s take 5.0 s, so be there at 5.0 s"),
        ("0s a person stands still; 2s at 0 3; 3s", "walk there first"),
        ("0s a person walks; 2s pose nowhere.bvh; 3s", "nowhere.bvh"),
        (f"0s a person walks; 2s pose {SKELETONS / 'mixamo.bvh'}@99; 3s", "pose_at must be within"),
        ("0s zorb; 2s", "zorb"),
    ],
)
def test_what_cannot_be_composed_is_refused(script: str, said: str, tmp_path: Path) -> None:
    refused = run("compose", script, "-o", tmp_path / "out.bvh")
    assert refused.exit_code == 2, refused.output
    assert said in refused.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ("{", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
        (f"[{'9' * 5000}]", "is no JSON"),
        ({"at": 0}, "a plan is a list of moments"),
        ([{"at": 0, "prompt": "a person walks"}], "moment 1: unknown key 'prompt'; expected at, text, place"),
        ([{"at": 0, "text": "a person walks"}, {"place": [0, 1]}], "moment 2: a moment is an object with its time"),
        ([3], "moment 1: a moment is an object"),
        ([{"at": math.nan, "text": "a person walks"}], "moment 1: at must be"),
        ([{"at": 0, "text": "a", "place": [0, math.nan]}], "moment 1: place must be"),
        ([{"at": 0, "text": "a", "place": [0, 1, 2]}], "moment 1: place must be"),
        ([{"at": 0, "text": "a", "place": "ab"}], "moment 1: place must be"),
        ([{"at": 0, "text": "a", "facing": True}], "moment 1: facing must be"),
        ([{"at": 0, "text": " "}], "moment 1: text must be a prompt"),
        ([{"at": 0, "text": "a", "pose": 3}], "moment 1: pose must be the path"),
    ],
)
def test_files_are_refused_with_the_moment(rows: Any, said: str, tmp_path: Path) -> None:
    path = tmp_path / "plan.json"
    path.write_text(rows if isinstance(rows, str) else json.dumps(rows))
    with pytest.raises(motet.FormatError, match=r"plan\.json") as refused:
        read_plan(path)
    assert said in str(refused.value)


def test_a_plan_names_motion_files_anywhere_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "plans").mkdir()
    path = tmp_path / "plans/plan.json"
    for name in (SKELETONS / "mixamo.bvh", "../up.bvh"):
        (tmp_path / "up.bvh").write_bytes((SKELETONS / "mixamo.bvh").read_bytes())
        path.write_text(json.dumps([{"at": 0, "text": "a person walks"}, {"at": 2, "pose": str(name)}, {"at": 4}]))
        found = read_plan(path, lambda file: motet.read(file, unit="cm"))
        assert found[1].pose is not None
    (tmp_path / "secret.txt").write_text("the password is 1234")
    path.write_text(json.dumps([{"at": 0, "text": "a person walks"}, {"at": 2, "pose": "../secret.txt"}, {"at": 4}]))
    with pytest.raises(motet.FormatError, match="moment 2: ") as refused:
        read_plan(path)
    assert "1234" not in str(refused.value)


def test_poses_under_the_ground_and_of_no_human_are_refused(codes_model: motet.CodesModel) -> None:
    still = codes_model.story("a person stands still", seconds=1).motion
    deep = still.values - 0.5 * np.array([name == "hips.ty" for name in still.channels])
    sunk = Motion(deep, still.channels, still.units, still.fps, still.skeleton)
    box = motet.motion.Skeleton((motet.motion.Joint("box", -1, (0.0, 0.0, 0.0)),), 1.0)
    thing = Motion(np.zeros((1, 3)), ("box.tx", "box.ty", "box.tz"), ("m",) * 3, 30, box)
    for pose, said in ((sunk, "the pose of 1 s is 49 cm under the ground"), (thing, "the pose of 1 s: ")):
        with pytest.raises(motet.MotionError, match=said):
            motet.compose(codes_model, [Moment(0, "a person walks"), Moment(1, pose=pose), Moment(2)])


@pytest.mark.filterwarnings("ignore::motet.TextWarning")
def test_an_unknown_prompt_warns_or_is_refused(codes_model: motet.CodesModel) -> None:
    moments = parse_plan("0s a person zorbs the moon; 2s")
    with pytest.warns(motet.TextWarning, match="zorbs"):
        motet.compose(codes_model, moments)
    with pytest.raises(motet.TextError, match="zorbs"):
        motet.compose(codes_model, moments, strict=True)
