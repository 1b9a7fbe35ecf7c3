"""Acts by key poses: what the language says is what the figure does, and what no body can do is refused."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import motet
from motet.cli import main
from motet.figures.humanoid import HUMANOID
from motet.keyed import KeyedAct, ours, read
from motet.keyed.draw import curve
from motet.keyed.keys import Key, mirrored_keys
from motet.keyed.parts import PLACES
from motet.motion import mirror
from motet.motion.kinematics import global_transforms, local_rotations, posed
from motet.motion.motion import Motion

FASTEST = 13.0
"""Metres a second of any joint: a thrown punch has 10, a pitcher's hand 20."""


@pytest.fixture(scope="module")
def standing() -> Motion:
    return motet.load("control").run("stop 14s")


@pytest.fixture(scope="module")
def walking() -> Motion:
    return motet.load("control").run("walk speed 1.1 14s")


@pytest.fixture(scope="module")
def t_pose() -> Motion:
    """Four seconds of the figure at rest, on its place."""
    channels = motet.load("control").run("stop 0.1s")
    still = replace(channels, values=np.repeat(0 * channels.values[:1], 120, axis=0), fps=30.0)
    root = np.repeat(HUMANOID.offsets[:1], 120, axis=0)
    return posed(still, {}, {"hips": root})


def act_of(tmp_path: Path, text: str) -> KeyedAct:
    file = tmp_path / "acts.toml"
    file.write_text(text)
    (act,) = read(file).values()
    return act


def joint(motion: Motion, name: str) -> np.ndarray:
    """The places (T, 3) of a joint in the world."""
    return global_transforms(motion)[1][:, HUMANOID.index(name)]


@pytest.mark.parametrize("name", ours())
def test_every_act_is_one_that_a_body_can_do(name: str, standing: Motion, walking: Motion) -> None:
    base = {"stand": standing, "walk": walking}[ours()[name].over]
    for seed in (0, 1):
        motion = ours()[name].motion(base, seed)
        rotations, places = global_transforms(motion)
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=2) * motion.fps
        assert speeds.max() < FASTEST
        assert places[..., 1].min() > -0.02
        # hands stay out of the head: a ball of 8 cm in its middle
        middle = places[:, HUMANOID.index("head")] + rotations[:, HUMANOID.index("head")] @ [0, 0.07, 0.01]
        for side in ("left", "right"):
            for tip in ("Hand", "Hand_end"):
                assert np.linalg.norm(places[:, HUMANOID.index(side + tip)] - middle, axis=1).min() > 0.08
        # it begins as the base does, but for what is there from the begin
        if ours()[name].keys[0].at[0] > 0:
            assert np.abs(places[0] - global_transforms(base[:1])[1][0]).max() < 0.03


def test_says_are_sentences_of_one_act_each() -> None:
    sentences = [sentence for act in ours().values() for sentence in act.says]
    assert len(sentences) == len(set(sentences))
    assert all(sentence == sentence.strip().lower() for sentence in sentences)


def test_a_hand_is_where_its_key_says(tmp_path: Path, t_pose: Motion) -> None:
    act = act_of(
        tmp_path,
        "[touch]\nspeed = 1\namplitude = 1\n[[touch.key]]\nat = 0.5\nhold = 0.5\n"
        'right_hand = { to = "chest", up = 0.05, touch = "wrist" }\nhead = { nod = 20, turn = 30 }\n',
    )
    motion = act.motion(t_pose)
    rotations, places = global_transforms(motion)
    frame = 22
    # the place as it is defined, mirrored for the right hand, by hand
    place = PLACES["chest"]
    bone = HUMANOID.index(place.bone)
    expected = places[frame, bone] + rotations[frame, bone] @ [-place.x, place.y + 0.05, place.z]
    assert np.linalg.norm(places[frame, HUMANOID.index("rightHand")] - expected) < 1e-6
    # the head's turn from the chest is the neck's and its own: 20 degrees down and 30 to the left, about one axis
    neck, head = (local_rotations(motion, [HUMANOID.index(name)])[frame, 0] for name in ("neck", "head"))
    forward = neck @ head @ [0, 0, 1]
    assert np.degrees(np.arctan2(forward[0], forward[2])) == pytest.approx(30, abs=1)
    assert np.degrees(-np.arcsin(forward[1])) == pytest.approx(20, abs=2)
    # the left hand is as in the base
    assert np.allclose(joint(motion, "leftHand"), joint(t_pose[: len(motion)], "leftHand"), atol=1e-9)


def test_feet_stay_while_hips_go_down(tmp_path: Path, standing: Motion) -> None:
    act = act_of(tmp_path, "[down]\namplitude = 1\n[[down.key]]\nat = 0.8\nhold = 0.4\nhips = { down = 0.4 }\n")
    motion = act.motion(standing)
    base = standing.resample(30.0)[: len(motion)]
    lowered = joint(base, "hips")[:, 1] - joint(motion, "hips")[:, 1]
    assert lowered.max() == pytest.approx(0.4, abs=0.03)
    for side in ("left", "right"):
        moved = np.linalg.norm(joint(motion, f"{side}Foot") - joint(base, f"{side}Foot"), axis=1)
        assert moved.max() < 0.01


def test_an_act_of_nothing_is_its_base(tmp_path: Path, standing: Motion) -> None:
    act = act_of(tmp_path, "[still]\n[[still.key]]\nat = 1\nhead = { nod = 0 }\n")
    motion = act.motion(standing)
    assert np.allclose(local_rotations(motion), local_rotations(standing.resample(30.0)[: len(motion)]), atol=1e-6)


def test_mirrored_keys_are_the_mirror_image(t_pose: Motion) -> None:
    act = replace(ours()["salute"], mirrored=False, speed=(1.0, 1.0), amplitude=(1.0, 1.0))
    fixed = tuple(_fixed(key) for key in act.keys)
    motion = replace(act, keys=fixed).motion(t_pose)
    other = replace(act, keys=mirrored_keys(fixed)).motion(t_pose)
    assert np.allclose(global_transforms(mirror(motion))[1], global_transforms(other)[1], atol=1e-9)


def _fixed(key: Key) -> Key:
    """A key whose numbers are not drawn."""
    numbers: Mapping[str, Mapping[str, tuple[float, float]]] = {
        part: {name: (span[0], span[0]) for name, span in values.items()} for part, values in key.numbers.items()
    }
    return replace(key, at=(key.at[0],) * 2, hold=(key.hold[0],) * 2, numbers=numbers)


def test_draws_differ_and_seeds_repeat(standing: Motion) -> None:
    act = ours()["nod"]
    first = act.motion(standing, 3)
    assert np.array_equal(first.values, act.motion(standing, 3).values)
    assert len(first) != len(act.motion(standing, 4)) or not np.allclose(first.values, act.motion(standing, 4).values)
    assert act.seconds(3) == pytest.approx(len(first) / 30)


def test_repeats_are_counted(tmp_path: Path, standing: Motion) -> None:
    act = act_of(
        tmp_path,
        "[nod]\nspeed = 1\nease = 0.2\nrepeat = { keys = [1, 2], every = 0.6, times = 4 }\n"
        "[[nod.key]]\nat = 0.3\nhead = { nod = 20 }\n[[nod.key]]\nat = 0.6\nhead = { nod = 0 }\n",
    )
    nose = joint(act.motion(standing), "head_end")[:, 1]
    is_down = nose < (nose.min() + nose.max()) / 2
    assert np.count_nonzero(np.diff(is_down.astype(int)) == 1) == 4


def test_a_curve_goes_through_its_points() -> None:
    times = np.array([0.0, 0.5, 1.0, 1.5, 2.0, 2.5])
    assert np.allclose(curve([(0.5, 1.0), (1.5, -2.0), (2.0, 0.0)], times), [1, 1, -0.5, -2, 0, 0])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[a]\n[[a.key]]\nat = 1\nhaed = { nod = 3 }\n", "line 2: [[a.key]]: a key: 'haed' is unknown"),
        ("[a]\n[[a.key]]\nat = 1\n\n[[a.key]]\nat = 0.5\n", "line 5: [[a.key]]: at 0.5 s, before the key above it"),
        ("[a]\n[[a.key]]\nat = 1\nhead = { nod = 90 }\n", "head.nod: expected a number from -60 to 60 degrees"),
        ("[a]\n[[a.key]]\nat = [2, 1]\n", "at: expected a number from 0 to 60 s, or [lowest, highest]"),
        ("[a]\n[[a.key]]\nat = nan\n", "at: expected a number from 0 to 60 s"),
        ("[a]\n[[a.key]]\nat = true\n", "at: expected a number"),
        ("[a]\n[[a.key]]\nright_hand = { to = 'moon' }\nat = 1\n", "right_hand.to: expected one of top of head"),
        ("[a]\n[[a.key]]\nat = 1\nleft_hand = { to = 'ear', palm = 'sideways' }\n", "left_hand.palm: expected words"),
        ("[a]\nsays = 'a'\n[[a.key]]\nat = 1\n", "line 1: [a]: says: expected a list of sentences"),
        (
            "[a]\nrepeat = { keys = [1, 3], every = 1, times = 2 }\n[[a.key]]\nat = 1\n",
            "repeat.keys: expected one",
        ),
        ("[a]\nover = 'fly'\n[[a.key]]\nat = 1\n", "line 1: [a]: over: expected stand or walk, not 'fly'"),
        ("[a]\npace = 9\n[[a.key]]\nat = 1\n", "line 1: [a]: pace: expected a number from 0.4 to 2"),
        ("[a]\n", "line 1: [a]: expected 1 to 100 keys"),
        ("[a]\n" + "[[a.key]]\nat = 1\n" * 10_000, "expected 1 to 100 keys"),
        ("a = 3\n", "[a]: expected a table, not '3'"),
        ("a = [\n", "not TOML"),
        ("", "expected 1 to 1000 acts"),
        ("#" * 1_000_001, "at most 1000000 bytes"),
    ],
)
def test_what_is_wrong_is_refused_with_its_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "acts.toml"
    file.write_text(text)
    with pytest.raises(motet.FormatError) as refused:
        read(file)
    assert message in str(refused.value)


def test_what_no_body_can_do_is_refused(tmp_path: Path, standing: Motion) -> None:
    far = act_of(tmp_path, "[far]\n[[far.key]]\nat = 1\nhold = 1\nright_hand = { to = 'foot' }\n")
    with pytest.raises(motet.MotionError, match=r"far, right_hand: 'foot' is .* m from the shoulder"):
        far.motion(standing)
    with pytest.raises(motet.MotionError, match="give a longer one"):
        ours()["salute"].motion(standing[:20])
    with pytest.raises(motet.DecodingError):
        ours()["salute"].motion(standing, -1)


def test_the_command_writes_a_clip_for_each_act(tmp_path: Path) -> None:
    result = CliRunner().invoke(main, ["key", "--act", "nod", "--act", "wave", "-o", str(tmp_path / "{name}.bvh")])
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["nod.bvh", "wave.bvh"]
    assert motet.check(tmp_path / "wave.bvh").sure
    assert (
        "no act 'levitate'"
        in CliRunner().invoke(main, ["key", "--act", "levitate", "-o", str(tmp_path / "x.bvh")]).output
    )
