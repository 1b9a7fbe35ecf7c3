"""The shipped model that writes motions as codes, as a user has it: lengths, stories, streams, what it knows."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet.errors import DecodingError, MotionError, TextError, TextWarning
from motet.figures.humanoid import HUMANOID
from motet.generate.codes import WINDOW, CodesSettings, Writer, drawn_steps
from motet.generate.model import CodesModel
from motet.motion.kinematics import positions
from motet.motion.looping import looped
from motet.motion.motion import Motion

pytestmark = pytest.mark.numeric

WALK, JUMP = "a person walks forward", "a person jumps up"


@pytest.fixture(scope="module")
def model() -> CodesModel:
    found = motet.load("generate")
    assert isinstance(found, CodesModel)
    return found


@pytest.fixture(scope="module")
def walk(clips: Path) -> Motion:
    return motet.read(clips / "39_14.amc")


def test_a_motion_lasts_as_long_as_is_asked(model: CodesModel) -> None:
    for seconds in (0.5, 3, 12):
        found = model.generate([WALK, JUMP], 2, seconds=seconds)
        for row in found:
            for one in row:
                assert len(one.frames) / model.fps == pytest.approx(seconds)
                assert np.isfinite(one.frames).all()


def test_a_story_of_one_sentence_is_what_generate_gives(model: CodesModel) -> None:
    (alone,) = model.generate(WALK, seed=4)
    story = model.story(WALK, seed=np.int64(4), hypotheses=1)
    np.testing.assert_array_equal(story.frames, alone.frames)
    assert [(one.text, one.start) for one in story.passages] == [(WALK, 0.0)]


@pytest.mark.parametrize(
    "asked",
    [{"seconds": 2}, {"seconds": 0.41, "stand": "end"}, {"after": True, "seconds": [1, None]}, {"stand": "both"}],
)
def test_a_stream_is_the_story_to_the_bit(model: CodesModel, walk: Motion, asked: dict[str, Any]) -> None:
    asked = {**asked, "after": walk} if "after" in asked else asked
    whole = model.story([WALK, JUMP], seed=1, **asked).playable(plant=False)
    pieces = list(model.stream([WALK, JUMP], seed=1, **asked))
    assert len(pieces) > 10
    np.testing.assert_array_equal(np.concatenate([piece.values for piece in pieces]), whole.values)


@pytest.mark.parametrize("seed", range(8))
def test_every_passage_is_within_a_step_of_what_was_asked(model: CodesModel, seed: int) -> None:
    rng = np.random.default_rng(seed)
    asked = (
        [[1.0] * 14, [0.41] * 12, [0.05] * 5][seed] if seed < 3 else rng.uniform(0.05, 1.5, rng.integers(1, 8)).tolist()
    )
    stand = ("start", "end", "both", None)[seed % 4]
    story = model.story([WALK, JUMP][:1] * len(asked), seconds=asked, stand=stand, seed=seed)  # type: ignore[arg-type]
    asked = [0.8] * (stand in ("start", "both")) + asked + [0.8] * (stand in ("end", "both"))
    assert len(story.frames) == max(1, round(sum(asked) * model.fps))
    assert len(story.passages) == len(asked)  # by their numbers, though the sentences are equal
    starts, stops = ([getattr(one, edge) for one in story.passages] for edge in ("start", "stop"))
    assert starts == [0.0, *stops[:-1]]
    assert stops[-1] == len(story.frames) / model.fps
    rounding = 0.5 / model.fps  # of the whole
    assert np.abs(np.subtract(stops, starts) - asked).max() <= model.codec.seconds + rounding
    assert np.abs(stops - np.cumsum(asked)).max() <= model.codec.seconds


def test_a_writer_looks_back_at_a_window_of_steps(model: CodesModel) -> None:
    """What it has seen is what it sees: the twin gives the graph the last steps' keys and values, and no others."""
    assert model.manifest.training["recipe"]["window"] == WINDOW
    drawing, noise = CodesSettings(top_p=0.9, guidance=1.5), [np.random.default_rng(3)]
    writer = Writer(model.source, noise, drawing)
    past, last = np.zeros((2, 3, 6, 0, 64), np.float32), [[[model.codec.moves + 1, 0, 0, 0]]] * 2
    for age in range(WINDOW + 20):
        told = {"codes": np.array(last), "action": np.array([[7], [model.source.null_action]])}
        told |= {"age": np.full((2, 1), age), "past": past[:, :, :, -(WINDOW - 1) :]}
        past = model.graphs["step"](told)["next_past"]
        writer.age[:] = age
        last = [writer.draw(np.array([7]), ends=False).tolist()] * 2
        np.testing.assert_array_equal(writer.states[0]["past"], past)


def test_what_is_counted_is_drawn_from_whole_recordings(model: CodesModel, monkeypatch: pytest.MonkeyPatch) -> None:
    """One act of a recording may be too little to count in."""
    asked, draw = set(), Writer.draw

    def seen(self: Writer, *given: Any, whole: bool, **more: Any) -> Any:
        asked.add(whole)
        return draw(self, *given, whole=whole, **more)

    monkeypatch.setattr(Writer, "draw", seen)
    for text, whole in (("a person jumps", False), ("a person jumps twice", True)):
        asked.clear()
        model.generate(text)
        assert asked == {whole}


def test_a_stream_may_last(model: CodesModel) -> None:
    """It keeps no more after a while than at first."""
    noise = [np.random.Generator(np.random.PCG64(1))]
    decoder, writer = model.decoder(), Writer(model.source, noise, CodesSettings(**model.defaults))
    pieces, steps, kept = list[Any](), list[Any](), list[int]()
    for _, step in drawn_steps(writer, np.array([7]), 160, True):
        steps.append(step)
        pieces.append(decoder.push(step))
        before = writer._before[1]
        state = [writer.states[0]["past"], before[0]["past"], *writer.recent, writer.last]
        for unread in writer.steps:
            state += unread.values()
        kept.append(sum(array.nbytes for array in state) + sum(step.nbytes for step in decoder.codes))
    assert max(kept) == max(kept[: 2 * WINDOW])
    assert max(kept) < 2**21
    pieces.append(decoder.finish())
    np.testing.assert_array_equal(np.concatenate(pieces), model.codec.frames_of(np.concatenate(steps)))


def test_a_story_goes_on_without_a_leap_and_says_what_is_when(model: CodesModel) -> None:
    story = model.story([WALK, JUMP, WALK], seconds=[2, 3, 2], seed=2)
    assert [one.text for one in story.passages] == [WALK, JUMP, WALK]
    assert [one.stop for one in story.passages[:-1]] == [one.start for one in story.passages[1:]]
    assert story.passages[-1].stop == pytest.approx(len(story.frames) / model.fps)
    steps = np.linalg.norm(np.diff(positions(story.motion), axis=0), axis=-1)
    assert steps.max() < 0.35  # metres in a frame: the hand of a cartwheel, no more


def test_a_given_motion_is_gone_on_with(model: CodesModel, walk: Motion) -> None:
    story = model.story([WALK], after=walk, seconds=2)
    before = model.contract.on_figure(walk.resample(30.0, to_end=True))
    seam = np.linalg.norm(positions(story.playable(plant=False))[0] - positions(before)[-1], axis=-1)
    usual = np.linalg.norm(np.diff(positions(before), axis=0), axis=-1)
    assert seam.max() < 2 * usual.max()
    with pytest.raises(MotionError, match="too short to continue"):
        model.story([WALK], after=walk[:10])


def test_a_figure_stands_where_that_is_asked(model: CodesModel) -> None:
    story = model.story([WALK], stand="both", seconds=3)
    assert [one.text for one in story.passages] == ["a person stands still", WALK, "a person stands still"]


def test_more_hypotheses_begin_with_the_same(model: CodesModel) -> None:
    alone, several = (model.generate([WALK, "a person waves"], n, seconds=1.0, seed=3) for n in (1, 3))
    for (one,), (first, *others) in zip(alone, several, strict=True):
        np.testing.assert_array_equal(one.frames, first.frames)
        assert not any(np.array_equal(other.frames, first.frames) for other in others)


def test_it_says_what_it_does_not_know(model: CodesModel) -> None:
    assert model.understood(WALK).confident
    assert not model.understood("a person plays hockey").confident
    strange = "a person repairs the cello of an astronaut"
    found = model.understood(strange)
    assert not found.confident
    assert len(found.nearest) == 3
    for call in (model.generate, model.story):
        with pytest.warns(TextWarning, match="outside the training data") as caught:
            call([strange], seconds=1)
        assert {warning.filename for warning in caught} == {__file__}
    with pytest.raises(TextError, match="nearest: '"):
        model.generate(strange, seconds=1, strict=True)
    with pytest.raises(TextError, match="nearest: '"):
        model.story([WALK, strange], seconds=1, strict=True)


@pytest.mark.parametrize("text", ["人が歩く", "🙂 🏃", "", "walk " * 2000])
def test_a_text_without_a_known_word_is_refused(model: CodesModel, text: str) -> None:
    with pytest.raises(TextError):
        model.generate(text, seconds=1)


def test_a_text_in_another_language_is_said_to_be_outside(model: CodesModel) -> None:
    with pytest.warns(TextWarning, match="outside the training data"):
        model.generate("ein Mann in einem Haus", seconds=1)


def test_settings_out_of_range_are_refused(model: CodesModel) -> None:
    for seconds in (-1.0, 0, 601.0, float("nan")):
        with pytest.raises(DecodingError):
            model.generate(WALK, seconds=seconds)
    for seconds in (
        [1.0],
        np.ones(3),
        np.float32(-1),
        "12",
        [1.0, "x"],
        [1.0, 0.0],
        0,
        601,
        float("nan"),
        np.array(1.0),
    ):
        with pytest.raises(DecodingError, match="seconds must be"):
            model.story([WALK, JUMP], seconds=seconds)  # type: ignore[typeddict-item]
    for seed in (-1, 1.5, "x", [1, 2]):
        with pytest.raises(DecodingError, match="expected a seed"):
            model.story(WALK, seed=seed)  # type: ignore[typeddict-item]
    with pytest.raises(DecodingError, match="hypotheses must be 1, not 3"):
        model.story(WALK, hypotheses=3)
    with pytest.raises(DecodingError, match="no setting 'candidates'"):
        model.generate(WALK, candidates=3)


def test_what_cannot_be_told_is_refused(model: CodesModel) -> None:
    assert model.generate([]) == []
    with pytest.raises(TextError, match="needs a sentence"):
        model.story([])
    with pytest.raises(DecodingError, match="start, end, both, not 'middle'"):
        model.story([WALK], stand="middle")  # type: ignore[arg-type]
    with pytest.raises(TextError, match="nearest: '"):
        model.stream("a person repairs the cello of an astronaut", strict=True)


def test_refusals_of_the_command_line_say_which_file_or_text(tmp_path: Path, walk: Motion) -> None:
    out, short = tmp_path / "out.bvh", tmp_path / "short.npz"
    motet.write(short, walk[:8])
    for given, code, said in (
        ([""], 1, "has no words"),
        (["", "", "--story"], 1, "has no words"),
        ([WALK, "--after", short], 1, "short.npz"),
        ([WALK, "--after", tmp_path / "none.bvh"], 2, "no such file"),
        ([WALK, "--story", "--hypotheses", 3], 2, "leave --hypotheses out"),
        ([WALK, "--seconds", 0], 2, "'--seconds'"),
    ):
        result = run("generate", *given, "-o", out)
        assert (result.exit_code, said in result.stderr) == (code, True), (given, result.stderr)
        assert not out.exists()


def test_the_command_line_tells_a_story(tmp_path: Path, clips: Path, model: CodesModel) -> None:
    out, options = tmp_path / "story.npz", ["--story", "--seconds", 2, "--seed", 3]
    result = run("generate", WALK, JUMP, *options, "-o", out, "--json")
    assert result.exit_code == 0
    (row,) = json.loads(result.stdout)
    assert [one["text"] for one in row["hypotheses"][0]["passages"]] == [WALK, JUMP]
    again = tmp_path / "again.npz"
    model.story([WALK, JUMP], seconds=2, seed=3).write(again)
    assert again.read_bytes() == out.read_bytes()
    assert "0.0-2.0 s " + WALK in run("generate", WALK, JUMP, *options, "-o", out).stdout
    result = run("generate", WALK, "--after", clips / "39_14.amc", "--stand", "end", "-o", out)
    assert result.exit_code == 0, result.stderr
    assert run("generate", WALK, "--story", "--bundle", "language-to-motion", "-o", out).exit_code == 2
    assert run("generate", "a theremin", "--strict", "-o", out).exit_code == 1


@pytest.mark.parametrize("seed", range(8))
def test_a_jump_is_never_left_out(model: CodesModel, seed: int) -> None:
    (jump,) = model.generate("a person jumps", seed=seed)
    height = positions(jump.motion)[:, 0, 1]
    assert height.max() - height[0] > 0.2
    assert jump.motion.duration > 2


@pytest.mark.parametrize("seed", range(4))
def test_two_seconds_show_the_act(model: CodesModel, seed: int) -> None:
    """The take of a kick begins with more than two seconds in which nobody kicks."""
    (kick,) = model.generate("a person kicks", seed=seed, seconds=2)
    feet = [HUMANOID.names.index(f"{side}Foot") for side in ("left", "right")]
    assert kick.motion.duration == pytest.approx(2)
    height = positions(kick.motion)[:, feet, 1]
    assert height.max() > height.min() + 0.35
    (jump,) = model.generate("a person jumps", seed=seed, seconds=2)
    height = positions(jump.motion)[:, 0, 1]
    assert np.ptp(height) > 0.3


@pytest.mark.parametrize("memory", [0.1, 0.9])
def test_no_motion_ends_as_it_begins(model: CodesModel, memory: float) -> None:
    """A writer by itself would end one jump in ten after its first step."""
    (found,) = model.generate(["a person jumps"], 30, memory=memory)
    assert min(len(one.frames) for one in found) > model.fps


def test_the_length_comes_before_other_numbers(model: CodesModel) -> None:
    with pytest.warns(TextWarning, match="requests 2 metres; shown: "):
        (walk,) = model.generate("walk 2 metres forward", seconds=4)
    (turn,) = model.generate("turn left 90 degrees", seconds=3)
    assert [len(one.frames) for one in (walk, turn)] == [4 * model.fps, 3 * model.fps]


def test_an_act_a_little_longer_is_played_faster(model: CodesModel) -> None:
    action = int(model.embed("he does a cartwheel").argmax())
    steps = next(one for one in range(10, 40) if model.source.memory.paced(action, one) > one)
    seconds = steps * model.codec.seconds
    (act,) = model.generate("he does a cartwheel", seconds=seconds)
    (plain,) = model.generate("he does a cartwheel", seconds=seconds, numbers=False)
    assert len(act.frames) == len(plain.frames) == round(seconds * model.fps)
    assert np.abs(act.frames - plain.frames).max() > 0.1


@pytest.mark.parametrize("seed", range(3))
def test_a_loop_of_an_action_moves(model: CodesModel, seed: int) -> None:
    (jacks,) = model.generate("a man does jumping jacks", seed=seed)
    whole, loop = (np.diff(positions(one), axis=0) for one in (jacks.motion, looped(jacks.motion)))
    energy = [float((steps**2).sum(axis=-1).mean()) for steps in (whole, loop)]
    assert energy[1] > 0.5 * energy[0]


def test_the_action_taken_is_told(model: CodesModel, tmp_path: Path) -> None:
    with pytest.warns(
        TextWarning, match="'a person walks in a circle' is read as '.*', which leaves out 'circle'"
    ) as said:
        (circle,) = model.generate("a person walks in a circle", numbers=False)
    assert {one.filename for one in said} == {__file__}
    assert circle.lacking == ("circle",)
    command = next(e for e in model.manifest.source["commands"] if e["sentence"] == circle.action)
    assert "circle" not in " ".join(command["texts"])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (walk,) = model.generate(WALK)
        story = model.story([WALK, JUMP])
    assert (walk.lacking, story.lacking, story.action) == ((), (), "")
    assert [one.action for one in story.passages] == [walk.action, story.passages[1].action]
    with pytest.warns(TextWarning, match="leaves out 'circle'"):
        next(model.stream("a person walks in a circle", numbers=False))
    result = run("generate", "a person walks in a circle", "--no-numbers", "-o", tmp_path / "a.npz", "--json")
    (row,) = json.loads(result.stdout)
    assert [row["hypotheses"][0][key] for key in ("action", "lacking")] == [circle.action, ["circle"]]
    assert "leaves out 'circle'" in result.stderr
    assert (
        f"as: {walk.action}, confidence {walk.confidence:.2f}\n"
        in run("generate", WALK, "-o", tmp_path / "b.npz").stdout
    )
