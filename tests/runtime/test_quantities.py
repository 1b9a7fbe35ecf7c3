"""Numbers in sentences become quantities, and motions have as much as was asked."""

from typing import Any

import numpy as np
import pytest

from motet.errors import TextError, TextWarning, collected
from motet.figures.humanoid import HUMANOID, T_POSE
from motet.generate.codes import Writer
from motet.generate.model import CodesModel, Story
from motet.generate.motion_measures import Seen, played, short, spells, strokes
from motet.models.load import load_as
from motet.motion.kinematics import positions
from motet.motion.rotations import Array
from motet.text.clauses import at_odds
from motet.text.numeric_phrases import quantities_of


@pytest.fixture(scope="module")
def model() -> CodesModel:
    return load_as(CodesModel, "generate")


@pytest.mark.parametrize(
    ("sentence", "amounts"),
    [
        ("turn left 30 degrees", {"degrees": 30}),
        ("turns clockwise by one hundred and twenty degrees", {"degrees": -120}),
        ("he makes a quarter turn to the right", {"degrees": -90}),
        ("walk in a circle", {"degrees": 360}),
        ("walks in a big circle to the left", {"degrees": 360}),
        ("run as fast as you can", {"pace": 1.3}),
        ("spins around twice", {"degrees": 720}),
        ("turn 720°", {"degrees": 720}),
        ("walk 1.5 m", {"metres": 1.5}),
        ("walk two and a half metres", {"metres": 2.5}),
        ("go ten feet forward", {"metres": 3.048}),
        ("walk half a metre", {"metres": 0.5}),
        ("take a couple of steps back", {"steps": 2}),
        ("a few paces", {"steps": 3}),
        ("step to the left three times", {"steps": 3}),
        ("jump three times", {"times": 3}),
        ("two quick bows", {"times": 2, "pace": 1.3}),
        ("does 4 cartwheels", {"times": 4}),
        ("waits for a minute", {"seconds": 60}),
        ("a five-second walk", {"seconds": 5}),
        ("walks slowly for 3 s", {"seconds": 3, "pace": 0.75}),
        ("turn left 90 degrees in 2 seconds", {"degrees": 90, "seconds": 2}),
    ],
)
def test_numbers_are_quantities(sentence: str, amounts: dict[str, float]) -> None:
    assert quantities_of(sentence).amounts == pytest.approx(amounts)


@pytest.mark.parametrize(
    "sentence",
    [
        "a person walks forward",
        "hops on one foot",
        "stands with both feet on two lines",
        "picks up two boxes",
        "raises the arm 90 degrees",
        "jumps 50 cm high",
        "turns the head by 30 degrees",
        "a man and two women dance",
        "",
        "läuft drei Meter",
    ],
)
def test_what_is_no_quantity_of_the_whole_figure_stays_as_it_is(sentence: str) -> None:
    found = quantities_of(sentence)
    assert found.amounts == {}
    assert found.text == sentence


def test_an_act_that_is_not_counted_is_not_drawn_for_ever(model: CodesModel) -> None:
    with collected(TextWarning) as messages:
        (motion,) = model.generate("roll forward 2 times over 20 metres")
    assert motion.requested == {"times": 2, "metres": 20}
    assert motion.motion.duration < 20
    assert any("cannot be counted" in str(message) for message in messages)


@pytest.mark.parametrize("seed", [0, 1, 3])
def test_steps_of_a_run_are_counted_though_its_feet_never_rest(seed: int, model: CodesModel) -> None:
    (run,) = model.generate("she runs six steps", seed=seed)
    feet = positions(run.motion)[:, [HUMANOID.index("leftFoot"), HUMANOID.index("rightFoot")], 1]
    lifted = feet > feet.min(axis=0) + 0.2
    lifts = np.count_nonzero(lifted[1:] & ~lifted[:-1])
    assert lifts == pytest.approx(6, abs=1)
    assert run.measured["steps"] == pytest.approx(lifts, abs=1)


@pytest.mark.parametrize("sentence", ["-3 jumps", "10^9 steps", "0 steps", "walk -2 metres", "jump 1.5 times", "5 km"])
def test_numbers_that_make_no_sense_are_refused(sentence: str, model: CodesModel) -> None:
    with pytest.raises(TextError, match="cannot be shown"):
        model.generate(sentence)


def test_what_remains_is_what_is_done() -> None:
    assert quantities_of("a person takes two steps back").text == "a person walks back"
    assert quantities_of("she retreats 2 steps").text == "she walks backwards"
    assert quantities_of("she walks 3 metres").text == "she walks forward"
    assert quantities_of("the man turns right 30 degrees").text == "the man walks and turns right"
    assert quantities_of("five jumping jacks").text == "jumping jacks"


@pytest.mark.parametrize(
    "sentence", ["a person walks 4 metres forward", "walk and turn right 70 degrees", "walk three steps", "jump twice"]
)
def test_a_motion_has_as_much_as_was_asked(sentence: str, model: CodesModel) -> None:
    (made,) = model.generate(sentence, seed=3)
    ((kind, amount),) = made.requested.items()
    assert not short(made.requested, made.measured, either=False)
    seen = Seen.of(model.contract, made.features.values)  # with feet that are planted
    assert seen.measured(kind, quantities_of(sentence).act) == pytest.approx(
        amount, rel=0.1, abs=1 if kind == "steps" else 0
    )


def test_parts_of_a_story_keep_their_numbers(model: CodesModel) -> None:
    (made,) = model.generate("walk 3 metres, then jump twice, then stand still for 2 seconds", seed=1)
    assert isinstance(made, Story)
    assert [dict(one.requested) for one in made.passages] == [{"metres": 3}, {"times": 2}, {"seconds": 2}]
    assert made.requested == {}
    assert made.passages[-1].stop == pytest.approx(len(made.frames) / model.fps)
    assert made.passages[-1].measured["seconds"] == pytest.approx(2, abs=0.1)
    leaps = np.abs(np.diff(made.frames[:, 4:], axis=0)).max(axis=1)
    joined = round(made.passages[0].stop * model.fps)
    assert leaps[joined - 2 : joined + 2].max() < 0.35  # of an axis' number in a frame
    pieces = list(model.stream("walk 3 metres, then jump twice, then stand still for 2 seconds", seed=1))
    assert sum(map(len, pieces)) == len(made.frames)


def test_numbers_can_be_words(model: CodesModel) -> None:
    (made,) = model.generate("a person walks 4 metres forward", numbers=False)
    assert made.requested == {}
    assert not isinstance(made, Story)


def test_what_is_not_met_is_told(model: CodesModel) -> None:
    with pytest.warns(TextWarning, match=r"requests 150 metres; shown: \d"):
        (made,) = model.generate("a person walks 150 metres", seconds=4)
    assert len(made.frames) == 4 * model.fps
    assert made.measured["metres"] < 20


def test_seconds_alone_are_the_length(model: CodesModel) -> None:
    (made,) = model.generate("a person walks for two and a half seconds")
    assert len(made.frames) == 75
    np.testing.assert_array_equal(made.frames, model.generate("a person walks forward", seconds=2.5)[0].frames)


def test_a_long_turn_is_streamed_stretch_by_stretch(model: CodesModel, monkeypatch: pytest.MonkeyPatch) -> None:
    story = model.story("a person walks in a circle", seconds=45, seed=3)
    assert abs(story.passages[0].measured["degrees"]) == pytest.approx(360)
    draws = list[int]()
    draw = Writer.draw

    def counted(self: Writer, *settings: Any, **more: Any) -> Any:
        draws.append(len(draws))
        return draw(self, *settings, **more)

    monkeypatch.setattr(Writer, "draw", counted)
    pieces = list[Array]()
    drawn = list[int]()
    for piece in model.stream("a person walks in a circle", seconds=45, seed=3):
        pieces.append(piece.values)
        drawn.append(len(draws))
    assert [len(piece) for piece in pieces] == [450, 450, 450]
    np.testing.assert_array_equal(np.concatenate(pieces), story.playable(plant=False).values)
    # no more is drawn for a piece than it shows, and what its decoder looks ahead
    assert drawn[0] <= model.codec.steps(15) + model.codec.field.ahead + 1
    assert drawn[-1] == model.codec.steps(45)
    # the turn goes on evenly, and no joint leaps where a stretch ends
    heading = Seen.of(model.contract, story.frames).heading
    assert np.abs(heading[[449, 899]]) == pytest.approx([120, 240], abs=5)
    leaps = np.abs(np.diff(story.frames[:, 4:], axis=0)).max(axis=1)
    assert max(leaps[449], leaps[899]) < 0.2  # of an axis' number in a frame


def test_what_is_played_slower_is_the_same_in_stretches(model: CodesModel, monkeypatch: pytest.MonkeyPatch) -> None:
    assert model.quantities("a person bows slowly").amounts == {"pace": 0.75}
    whole = model.story("a person bows slowly", seconds=12).frames
    monkeypatch.setattr("motet.generate.story_decoder.STRETCH_SECONDS", 2.5)
    frames = model.story("a person bows slowly", seconds=12).frames
    assert len(frames) == 12 * model.fps
    assert np.abs(frames[:, 3:] - whole[:, 3:]).max() < 0.05  # shown within a fraction of a frame of the same time
    assert frames[:, :3].sum(axis=0) == pytest.approx(whole[:, :3].sum(axis=0), rel=0.02, abs=0.3)


def test_frames_are_played_faster_over_the_same_way() -> None:
    frames = np.random.default_rng(0).normal(size=(60, 7))
    frames[:, :3] = 1.0
    fast = played(frames, 1.5)
    assert len(fast) == 40
    assert fast[:, :3].sum() == pytest.approx(frames[:, :3].sum())
    assert spells(np.array([True, False, True])) == [(0, 1), (2, 3)]


def test_strokes_go_there_and_back() -> None:
    angle = np.linspace(0, 8 * np.pi, 400)
    assert len(strokes(np.cos(angle), 1.0)) == 4
    assert len(strokes(0.4 * np.cos(angle), 1.0)) == 0
    assert strokes(np.array([0.0, 1.0, 0.2, 0.0]), 0.5) == [(1, 4)]  # the last need not come back


@pytest.mark.parametrize(
    ("sentence", "act"),
    [("waves twice", "waves"), ("nods 3 times", "nods"), ("claps", "claps"), ("ten push-ups", "pushups"),
     ("pushes a box twice", ""), ("five sit-ups", "")],
)  # fmt: skip
def test_what_is_counted_is_read(sentence: str, act: str) -> None:
    assert quantities_of(sentence).act == act


def still() -> Array:
    return np.repeat(T_POSE[None], 120, axis=0)


def test_waves_nods_claps_and_pushups_are_counted() -> None:
    moved = {act: still() for act in ("waves", "nods", "claps", "pushups")}
    swing = np.cos(np.linspace(0, 6 * np.pi, 120))  # three times
    hand, elbow = HUMANOID.index("leftHand"), HUMANOID.index("leftLowerArm")
    moved["waves"][:, hand] = moved["waves"][:, elbow] + np.stack([0.1 * swing, 0 * swing + 0.25, 0 * swing], axis=1)
    head, top = HUMANOID.index("head"), HUMANOID.index("head_end")
    bend, length = np.radians(15 - 15 * swing), np.linalg.norm(T_POSE[top] - T_POSE[head])
    nod = np.stack([0 * bend, np.cos(bend), np.sin(bend)], axis=1)
    moved["nods"][:, top] = moved["nods"][:, head] + length * nod
    for side, sign in (("left", 1), ("right", -1)):
        wide = sign * (0.2 + 0.15 * swing)
        moved["claps"][:, HUMANOID.index(f"{side}Hand")] = np.stack([wide, 0 * wide + 1.2, 0 * wide + 0.3], axis=1)
    body = moved["pushups"][:, :, [0, 2, 1]]  # lying along z
    body[..., 1] = 0.3 + 0.1 * swing[:, None]
    body[:, [HUMANOID.index(f"{side}Hand") for side in ("left", "right")], 1] = 0.05
    moved["pushups"] = body
    for act, points in moved.items():
        found = {other: len(Seen(points, 30.0).done(other)) for other in moved}
        assert found == {other: 3 * (other == act) for other in moved}


@pytest.mark.parametrize("sentence", ["turn left 45 degrees", "a half turn to the right", "walk in a circle"])
def test_a_turn_is_that_of_the_hips_from_first_to_last(sentence: str, model: CodesModel) -> None:
    (made,) = model.generate(sentence, seed=1)
    points = positions(made.motion)
    across = points[:, HUMANOID.index("leftUpperLeg")] - points[:, HUMANOID.index("rightUpperLeg")]
    turned = np.degrees(np.ptp(np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))[[0, -1]]))
    assert turned == pytest.approx(abs(made.requested["degrees"]), abs=1)


@pytest.mark.parametrize(
    ("sentence", "warned"),
    [
        ("stands still while running", "only one can be shown"),
        ("walks while sitting", "only one can be shown"),
        ("circling your foot", "has no action"),
    ],
)
def test_what_does_not_fit_is_told(sentence: str, warned: str, model: CodesModel) -> None:
    with pytest.warns(TextWarning, match=warned):
        model.generate(sentence, seconds=1)


def test_what_goes_together_is_not_at_odds() -> None:
    for sentence in ("waves while standing", "jumps while running", "stands still, then runs", "swing your arms"):
        assert at_odds(sentence) is None
