"""The shipped model that writes motions as codes, as a user has it: lengths, stories, streams, what it knows."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run

import motet
from motet.decode.codes import WINDOW, Drawing, Writer, drawn_steps
from motet.decode.streaming_decoder import Unrolled
from motet.errors import DecodingError, MotionError, TextError, TextWarning
from motet.models.generate_codes import CodesModel
from motet.motion.kinematics import positions
from motet.motion.motion import Motion

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
    story = model.story([WALK], seed=4)
    np.testing.assert_array_equal(story.frames, alone.frames)
    assert [(one.text, one.start) for one in story.passages] == [(WALK, 0.0)]


def test_a_stream_gives_the_motion_in_pieces_at_once(model: CodesModel) -> None:
    whole = positions(model.story([WALK, JUMP], seconds=2, seed=1).playable(plant=False))
    pieces = [positions(piece) for piece in model.stream([WALK, JUMP], seconds=2, seed=1)]
    assert len(pieces) > 20
    np.testing.assert_allclose(np.concatenate(pieces), whole, atol=1e-9)


def test_a_writer_looks_back_at_a_window_of_steps(model: CodesModel) -> None:
    """What it has seen is what it sees: the twin gives the graph the last steps' keys and values, and no others."""
    assert model.manifest.training["recipe"]["window"] == WINDOW
    drawing, noise = Drawing(1.0, 1.0, 0.9, 1.5), [np.random.default_rng(3)]
    writer = Writer(model.source, noise, drawing)
    past, last = np.zeros((2, 3, 6, 0, 64), np.float32), [[model.moves + 1, 0, 0, 0]] * 2
    for age in range(WINDOW + 20):
        told = {"codes": np.array(last), "action": np.array([7, model.source.nobody]), "age": np.full(2, age)}
        past = model.graphs["step"]({**told, "past": past[:, :, :, -WINDOW:]})["next_past"]
        writer.age[:] = age
        last = [writer.draw(np.array([7]), ends=False)[0].tolist()] * 2
        np.testing.assert_array_equal(writer.state["past"], past[:, :, :, -WINDOW:])


def test_a_stream_may_last(model: CodesModel) -> None:
    """It keeps no more after a while than at first."""
    unrolled = Unrolled(model.graphs["decoder"], model.sight, model.fps)
    steps = list(drawn_steps(model._writer([np.random.Generator(np.random.PCG64(1))], model.defaults), 7, 130, True))
    pieces = []
    for step in steps:
        pieces.append(unrolled.push(step))
        assert len(unrolled.codes) <= model.sight.back + model.sight.ahead + 1
    pieces.append(unrolled.finish())
    np.testing.assert_array_equal(np.concatenate(pieces), model.frames_of(np.array(steps)))


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
    with pytest.raises(MotionError, match="too short to go on with"):
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
    assert not model.understood("a person plays tennis").confident  # .28
    strange = "a person repairs the violin of an astronaut"
    found = model.understood(strange)
    assert not found.confident
    assert len(found.nearest) == 3
    for call in (model.generate, model.story):
        with pytest.warns(TextWarning, match="outside of what the model knows") as caught:
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
    with pytest.warns(TextWarning, match="outside of what the model knows"):
        model.generate("ein Mann in einem Haus", seconds=1)


def test_settings_out_of_range_are_refused(model: CodesModel) -> None:
    for seconds in (-1.0, 0, 601.0, float("nan")):
        with pytest.raises(DecodingError):
            model.generate(WALK, seconds=seconds)
    with pytest.raises(DecodingError, match="one for each of 2"):
        model.story([WALK, JUMP], seconds=[1.0])
    with pytest.raises(DecodingError, match="no setting 'candidates'"):
        model.generate(WALK, candidates=3)


def test_what_cannot_be_told_is_refused(model: CodesModel) -> None:
    assert model.generate([]) == []
    with pytest.raises(TextError, match="needs a sentence"):
        model.story([])
    with pytest.raises(DecodingError, match="not at 'middle'"):
        model.story([WALK], stand="middle")
    with pytest.raises(TextError, match="nearest: '"):
        next(model.stream("a person repairs the violin of an astronaut", strict=True))


def test_refusals_of_the_command_line_say_which_file_or_text(tmp_path: Path, walk: Motion) -> None:
    out, short = tmp_path / "out.bvh", tmp_path / "short.npz"
    motet.write(short, walk[:8])
    for given, code, said in (
        ([""], 1, "has no words"),
        (["", "", "--story"], 1, "has no words"),
        ([WALK, "--after", short], 1, "short.npz"),
        ([WALK, "--after", tmp_path / "none.bvh"], 2, "no such file"),
        ([WALK, "--story", "--hypotheses", 3], 2, "leave --hypotheses out"),
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
    assert run("generate", WALK, "--story", "--bundle", "cmu-generate", "-o", out).exit_code == 2
    assert run("generate", "a violin", "--strict", "-o", out).exit_code == 1
