"""Bare commands of the shipped model: each does what it says, by kinematics; and their table."""

from itertools import combinations

import numpy as np
import pytest

import motet
from motet.bundle.fields import Fields
from motet.errors import BundleError, TextWarning, collected
from motet.figures.humanoid import HUMANOID
from motet.generate.base import Generated
from motet.generate.commands import Commands
from motet.generate.model import CodesModel
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.text.vocabulary import NEW_MODEL_RULES

pytestmark = pytest.mark.numeric

HIPS = HUMANOID.index("hips")
WALK = {"sentence": "a person walks", "action": 1, "texts": ["walk", "walk forward"], "instead": ["limp"]}
SIT = {"sentence": "a person sits down", "action": 0, "texts": ["sit down", "take a seat"], "instead": []}


@pytest.fixture(scope="module")
def model() -> CodesModel:
    loaded = motet.load("generate")
    assert isinstance(loaded, CodesModel)
    return loaded


def shown(model: CodesModel, text: str, seed: int = 0) -> Generated:
    """A motion, about which nothing is warned of."""
    with collected(TextWarning) as warnings:
        (motion,) = model.generate(text, seed=seed)
    assert not warnings
    return motion


def hips(motion: Generated) -> Array:
    """The places (T, 3) of the hips."""
    places: Array = positions(motion.motion)[:, HIPS]
    return places


def turn(motion: Generated) -> float:
    """Degrees to the left from the first to the last frame, by the line between the hip joints."""
    joints = positions(motion.motion)
    across = joints[:, HUMANOID.index("leftUpperLeg")] - joints[:, HUMANOID.index("rightUpperLeg")]
    angles = np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))
    return float(np.degrees(angles[-1] - angles[0]))


def commands(*entries: dict[str, object]) -> Commands:
    return Commands.of([Fields(entry) for entry in entries], NEW_MODEL_RULES, 2)


@pytest.mark.parametrize("before", ["walk", "stumble", "yawn"])
def test_a_command_is_done_to_its_end_after_others(model: CodesModel, before: str) -> None:
    for seed in range(2):
        lies = hips(shown(model, f"{before}, then lie down", seed))
        assert lies[-1, 1] < 0.35


@pytest.mark.parametrize(
    ("text", "least", "most"), [("walk", 0.6, 1.6), ("run", 1.4, 4.5), ("walk backwards", 0.5, 1.4)]
)
def test_a_gait_goes_straight_at_its_speed(model: CodesModel, text: str, least: float, most: float) -> None:
    places = hips(shown(model, text))
    distance = places[-1] - places[0]
    speed = np.linalg.norm(distance[[0, 2]]) / (len(places) / 30)
    assert least < speed < most
    assert abs(distance[0]) < 0.3 * abs(distance[2])
    assert (distance[2] < 0) == (text == "walk backwards")


def test_postures_begin_and_end_where_a_person_means(model: CodesModel) -> None:
    for seed in range(2):
        for text, low_start, low_end in (
            ("sit down", False, True),
            ("stand up", True, False),
            ("kneel", False, True),
        ):
            height = hips(shown(model, text, seed))[:, 1]
            assert (height[0] < 0.7) == low_start, text
            assert (height[-1] < 0.7) == low_end, text
        height = hips(shown(model, "lie down", seed))[:, 1]
        assert height[0] > 0.85
        assert height[-1] < 0.4


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("turn left 45 degrees", 45),
        ("turn right 90 degrees", -90),
        ("make a half turn to the left", 180),
        ("180 turn", 180),
        ("360 spin clockwise", -360),
    ],
)
def test_a_turn_without_a_gait_is_on_the_spot(model: CodesModel, text: str, degrees: float) -> None:
    motion = shown(model, text)
    assert turn(motion) == pytest.approx(degrees, abs=15)
    places = hips(motion)[:, [0, 2]]
    assert np.linalg.norm(places - places[0], axis=1).max() < 0.8


def test_commands_may_be_misspelt_and_have_a_pace(model: CodesModel) -> None:
    assert model.likeliest("wlak forward").action == "a person walks forward"
    for text, act, pace in (
        ("stands up quickly", "a person stands up", 1.3),
        ("turns around slowly", "a person turns around", 0.75),
        ("he stands up very slowly", "a person stands up", 0.75),
        ("a woman quickly steps back", "a person steps back", 1.3),
    ):
        assert model.likeliest(text).action == act
        assert model.quantities(text).amounts["pace"] == pace


def test_a_pace_between_words_leaves_no_gap(model: CodesModel) -> None:
    assert model.quantities("a boxer quickly ducks").text == "a boxer ducks"


def test_a_turn_on_the_spot_is_the_command(model: CodesModel) -> None:
    assert model.likeliest("a person turns around on the spot") == model.likeliest("turn around")


def test_who_stands_still_after_a_walk_does_not_go_on(model: CodesModel) -> None:
    for seed in range(3):
        story = model.story(["walk", "stand still"], seed=seed)
        places = positions(story.motion)[-20:]
        speeds = np.linalg.norm(np.diff(places, axis=0), axis=2) * 30
        assert speeds.mean() < 0.15


def test_parts_are_commands_too(model: CodesModel) -> None:
    assert model.parts("sit down, stand up again") == ["sit down", "stand up again"]
    assert model.parts("walk forwards 2 meters and stop") == ["walk forwards 2 meters", "stop"]
    height = hips(shown(model, "sit down, stand up again"))[:, 1]
    assert height[0] > 0.85
    assert height.min() < 0.7
    assert height[-1] > 0.85


def test_what_a_command_leaves_out_is_warned_of(model: CodesModel) -> None:
    for text in ("walk to the chair", "gallop"):
        with collected(TextWarning) as warnings:
            model.generate(text)
        assert warnings, text


def test_a_subject_makes_no_other_act_of_a_command(model: CodesModel) -> None:
    for sentence, order in (("a person kicks with the left leg", "kick with the left leg"), ("She sits.", "sit")):
        assert model.embed(sentence).argmax() == model.embed(order).argmax() > len(model.manifest.source["actions"])
    assert model.likeliest("a guest sits down on a chair").action == model.likeliest("sit down").action
    assert model.likeliest("a boy kicks a ball").lacking == ()
    # one that nobody recorded, with a warning, unless a recording has its verb
    lying = model.likeliest("she lies on her left side")
    assert (lying.action, lying.lacking) == ("a person lies down", ("left", "side"))
    assert model.likeliest("a woman sleeps").action == "a person sleeps on the back"


def test_commands_are_sets_of_stems_without_polite_words() -> None:
    both = commands(SIT, WALK)
    assert both.first == 3
    assert [both.act(text) for text in ("Walk!", "now walk forwards", "then takes the seat")] == [4, 4, 3]
    assert both.act("a person walks") is None
    nearest = both.nearest("walk to the table")
    assert nearest == {"walk"}
    assert both.action(nearest) == 4
    assert both.nearest("to the table") is None
    assert both.is_instead("limp")
    assert not both.is_instead("walk")
    assert both.written.tolist() == [0, 1, 2, 0, 1]


@pytest.mark.parametrize(
    "wrong",
    [
        [WALK, {**SIT, "texts": ["walks"]}],
        [{**WALK, "texts": ["the"]}],
        [{**WALK, "action": 2}],
        [{**WALK, "texts": 1}],
    ],
)
def test_wrong_tables_are_refused(wrong: list[dict[str, object]]) -> None:
    with pytest.raises(BundleError, match="manifest"):
        commands(*wrong)


def test_no_command_of_the_shipped_table_means_two_acts(model: CodesModel) -> None:
    acts = [set(entry["texts"]) for entry in model.manifest.source["commands"]]
    assert len(acts) > 60
    assert not any(first & second for first, second in combinations(acts, 2))
