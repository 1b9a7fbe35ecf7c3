"""The bundles that put motions into words and words into motion, as a user has them."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from memory import traced

from motet.errors import MotionError
from motet.formats import read_motion
from motet.models.describe import Part
from motet.models.load import load
from motet.models.nearest_neighbour import NOTHING
from motet.motion.motion import Motion
from motet.representation.root_block import to_root_block


@pytest.mark.parametrize("draws", [0, 100])
def test_five_ranked_sentences_for_each_motion_as_json(clips: Path, draws: int) -> None:
    files = [str(clips / name) for name in ("39_14.amc", "09_07.amc")]
    result = run("describe", *files, "--beams", 5, "--draws", draws, "--json")
    assert result.exit_code == 0
    rows = json.loads(result.stdout)
    assert [row["input"] for row in rows] == files
    for row, verb in zip(rows, ("walk", "run"), strict=True):
        scores = [found["log_probability"] for found in row["hypotheses"]]
        assert len(scores) == 5 if draws else 1 <= len(scores) <= 5
        assert draws or scores == sorted(scores, reverse=True)
        assert verb in row["hypotheses"][0]["text"]


@pytest.mark.parametrize("decoding", ["beam", "consensus"])
def test_a_description_scores_what_the_search_gave_it(clips: Path, decoding: str) -> None:
    model, motion = load("describe"), read_motion(clips / "39_14.amc")
    for found in model.describe(motion, decoding=decoding):
        assert model.score(motion, found.text) == pytest.approx(found.log_probability, abs=1e-4)


def test_turns_are_told_with_their_side(clips: Path) -> None:
    model = load("describe")
    walk = model.prepared(read_motion(clips / "39_14.amc"))
    turn = walk.channels.index("root.turn")
    for degrees, word in ((80, "left"), (-80, "right")):
        values = walk.values.copy()
        values[1:, turn] = degrees * walk.fps / (len(walk) - 1)
        (best, *_) = model.describe(replace(walk, values=values))
        assert word in best.text, best


def test_what_is_no_human_action_is_not_described_surely(clips: Path) -> None:
    """Standing in a T-pose, one frame's worth of motion, and a walk backwards in time."""
    model, walk = load("describe"), read_motion(clips / "39_14.amc")
    pose = model.prepared(walk)
    values = np.zeros((40, len(pose.channels)))
    values[:, pose.channels.index("root.height")] = 0.95
    assert not model.describe(replace(pose, values=values))[0].confident
    assert [one.text for one in model.describe(pose[:4])] == [NOTHING]
    with pytest.raises(MotionError):
        model.describe(walk[:1])
    assert "walk" in model.describe(replace(walk, values=walk.values[::-1].copy()))[0].text


def test_a_walk_that_turns_left_travels_and_turns_and_is_written_alike_every_time(tmp_path: Path) -> None:
    files = [tmp_path / "one.bvh", tmp_path / "two.bvh"]
    for file in files:
        sentence = "a person walks and turns left"
        assert run("generate", sentence, "--bundle", "language-to-motion", "--seed", 1, "-o", file).exit_code == 0
    assert files[0].read_bytes() == files[1].read_bytes()
    sliding = tmp_path / "sliding.bvh"
    assert (
        run("generate", sentence, "--bundle", "language-to-motion", "--seed", 1, "--no-plant", "-o", sliding).exit_code
        == 0
    )
    assert sliding.read_bytes() != files[0].read_bytes()
    block = to_root_block(read_motion(files[0]).with_unit(1.0))
    column = {name: block.values[:, i] for i, name in enumerate(block.channels)}
    assert 0.5 < np.median(column["root.forward"]) < 2.1
    assert column["root.turn"].sum() / block.fps > 10


def test_runs_are_faster_than_walks_and_both_end_by_themselves() -> None:
    model = load("language-to-motion")
    found = model.generate(["a person walks"] * 5 + ["a person runs"] * 5, hypotheses=5, seed=list(range(10)))
    forward = model.contract.channels.index("root.forward")
    speeds = [float(np.median(row[0].features.values[:, forward])) for row in found]
    assert max(speeds[:5]) < 2.1 < min(speeds[5:])
    assert max(row[0].motion.duration for row in found) < 15


def test_a_motion_scores_what_the_search_gave_it() -> None:
    model = load("language-to-motion")
    best = model.generate("a person runs", seed=3)[0]
    assert model.score("a person runs", best.contract.features(best.frames)) == pytest.approx(
        best.log_likelihood, rel=1e-4
    )


def upright(motion: Motion, frames: int) -> np.ndarray:
    """Frames of a stiff figure on the channels of a motion."""
    values = np.zeros((frames, len(motion.channels)))
    values[:, motion.channels.index("root.height")] = 0.95
    return values


def test_who_lies_from_the_first_frame_and_a_beast_are_not_described_surely(clips: Path) -> None:
    """Lying on the back, on the face and on a side; and on all fours with a human's names, striding as in a walk."""
    model = load("describe")
    walk = model.prepared(read_motion(clips / "39_14.amc"))
    column = walk.channels.index
    for pitch, roll in ((90.0, 0.0), (-90.0, 0.0), (0.0, 90.0)):
        lying = upright(walk, 40)
        lying[:, column("root.height")] = 0.15
        lying[:, column("root.pitch")], lying[:, column("root.roll")] = pitch, roll
        motion = replace(walk, values=lying)
        assert not model.describe(motion)[0].confident
        assert [part.confident for part in model.timeline(motion)] == [False]
    beast = walk.values.copy()
    beast[:, column("root.height")], beast[:, column("root.pitch")] = 0.6, 80.0
    assert not any(found.confident for found in model.describe(replace(walk, values=beast)))


def test_hours_of_standing_take_no_more_memory_than_minutes(clips: Path) -> None:
    """Beside the motion itself, of which there is a view for each window: 24 hours, shortened."""
    model = load("describe")
    pose = model.prepared(read_motion(clips / "39_14.amc"))
    held = []
    for frames in (2000, 9000):
        motion = replace(pose, values=upright(pose, frames))
        parts: list[Part] = []
        held.append(traced(lambda motion=motion, parts=parts: parts.extend(model.timeline(motion))))
        assert [(part.start, part.stop, part.confident) for part in parts] == [(0, frames / pose.fps, False)]
    assert held[1] - held[0] < 7000 * 8 * len(pose.channels) / 5
