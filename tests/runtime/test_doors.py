"""What a caller may get wrong at the public functions: each wrong value is one of motet's errors, which says what was
expected; and what is returned is the caller's."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import motet
from motet.errors import MotetError


class Models:
    """The models and a motion that the doors are tried with."""

    def __init__(self) -> None:
        self.generate = motet.load_as(motet.CodesModel, "generate")
        self.control = motet.load_as(motet.SteerModel, "control")
        self.describe = motet.load_as(motet.DescribeModel, "describe")
        self.predict = motet.load_as(motet.PredictModel, "predict")
        self.fill = motet.load_as(motet.FillModel, "fill")
        self.search = motet.load_as(motet.SearchModel, "search")
        (generated,) = self.generate.generate("a person walks", seconds=2.0)
        self.generated = generated
        self.motion = generated.motion
        self.empty = generated.motion[:0]


@pytest.fixture(scope="module")
def models() -> Models:
    return Models()


Door = Callable[[Any], object]

DOORS: dict[str, tuple[Door, str]] = {
    "describe a path": (lambda m: m.describe.describe("x.bvh"), "expected a motion, not .*motet.read"),
    "describe a number": (lambda m: m.describe.describe(3), "expected a motion, not '3'"),
    "describe some numbers": (lambda m: m.describe.describe([3]), "expected a motion, not '3'"),
    "describe no frames": (lambda m: m.describe.describe(m.empty), "frames|seconds"),
    "predict a path": (lambda m: m.predict.predict("x.bvh"), "expected a motion, not .*motet.read"),
    "predict beyond a name": (
        lambda m: m.predict.predict(m.motion, frames=3, beyond="generate"),
        "expected beyond to be a model",
    ),
    "futures of no frames": (lambda m: m.predict.futures(m.empty, beyond=m.generate), "the motion has 0 frames"),
    "generate a number": (lambda m: m.generate.generate(3), "expected a sentence, not '3'"),
    "generate some numbers": (lambda m: m.generate.generate([3]), "expected a sentence, not '3'"),
    "a story of numbers": (lambda m: m.generate.story([3]), "expected a sentence, not '3'"),
    "a story after a path": (lambda m: m.generate.story("a person walks", after="x"), "expected a motion"),
    "a story after no frames": (lambda m: m.generate.story("a person walks", after=m.empty), "has 0 frames"),
    "embed a number": (lambda m: m.generate.embed(3), "expected a sentence, not '3'"),
    "compose by a script": (lambda m: motet.compose("0s a person walks; 3s", m.generate), "expected a model such as"),
    "compose a number": (lambda m: motet.compose(m.generate, [3]), "expected a moment, not '3'"),
    "a moment's pose by path": (lambda m: motet.Moment(0, pose="x.bvh"), "expected a motion, not"),  # type: ignore[arg-type]
    "start with words by name": (lambda m: m.control.start(words="generate"), "expected words of a model"),
    "start at no frames": (lambda m: m.control.start(m.empty), "the motion has 0 frames"),
    "an act of no frames": (lambda m: m.control.act_of(m.empty), "the motion has 0 frames"),
    "act a number": (lambda m: m.control.start().act(3), "expected a motion, an act or a sentence, not '3'"),
    "act some numbers": (lambda m: m.control.start().act([3]), "expected a motion, an act or a sentence, not '3'"),
    "advance by text": (lambda m: m.control.start().advance("1"), "advances by 0 to 1 s, not 1"),
    "restore nothing": (lambda m: m.control.start().restore(None), "expected a snapshot of a session, not 'None'"),
    "embed a number in search": (lambda m: m.search.embed_text(3), "expected a sentence"),
    "embed motions of text": (lambda m: m.search.embed("x.bvh"), "expected|sentence|motion"),
    "gaps of one of two motions": (
        lambda m: m.fill.fill([m.motion, m.motion], [[(1.0, 1.5)]]),
        "2 motions need a list of gaps for each, not 1",
    ),
    "a loop of no length": (lambda m: m.fill.looped(m.motion, seconds=None), "a transition takes more than 0"),
    "scale by 0": (lambda m: m.motion.scaled(0), "a unit is a positive number of metres, not 0"),
    "resample to text": (lambda m: m.motion.resample("30"), "the frame rate must be a positive number, not '30'"),
    "load as a number": (lambda m: motet.load_as(int, "fill"), "expected a class of models"),  # type: ignore[type-var]
    "options as a mapping": (lambda m: motet.SessionOptions(provider_options={"a": 1}), "must hold a mapping"),  # type: ignore[arg-type]
    "write text": (lambda m: motet.write("x.bvh", "y.bvh"), "expected a motion, not .*motet.read"),  # type: ignore[arg-type]
}


@pytest.mark.parametrize(("door", "expected"), DOORS.values(), ids=DOORS)
def test_what_is_wrong_is_named(models: Models, door: Door, expected: str) -> None:
    with pytest.raises(MotetError, match=expected):
        door(models)


def test_what_has_a_motion_is_written(models: Models, tmp_path: Path) -> None:
    motet.write(tmp_path / "a.npz", models.generated)  # type: ignore[arg-type]
    np.testing.assert_array_equal(motet.read(tmp_path / "a.npz").values, models.motion.values)
    models.generated.write(tmp_path / "b.npz")
    assert (tmp_path / "b.npz").read_bytes() == (tmp_path / "a.npz").read_bytes()


def test_a_plan_may_be_a_script(models: Models) -> None:
    script = "0s a person walks; 2s"
    composed = motet.compose(models.generate, script, seed=3)
    np.testing.assert_array_equal(
        composed.motion.values, motet.compose(models.generate, motet.parse_plan(script), seed=3).motion.values
    )


@pytest.mark.parametrize("hold_feet", [True, False])
def test_a_pose_is_no_way_into_its_session(models: Models, hold_feet: bool) -> None:
    session = models.control.start(characters=2, hold_feet=hold_feet)
    pose = session.tick()
    for name in ("ground", "rotations", "height", "contacts"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(pose, name)[:] = 99
    kept = pose.ground.copy()
    session.control(gait="walk", speed=1.2)
    for _ in range(10):
        session.tick()
    np.testing.assert_array_equal(pose.ground, kept)


def test_types_that_are_taken_and_returned_are_public() -> None:
    for name in ("Act", "ArgumentError", "Character", "Matched", "SaidActs"):
        assert name in motet.__all__
        assert getattr(motet, name).__name__ == name
