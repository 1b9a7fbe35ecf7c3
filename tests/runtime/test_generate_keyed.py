"""Sentences of acts that nobody recorded: laid by their key poses over a figure that stands."""

import json
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest
from command_line import run

import motet
import motet.keyed
from motet.errors import ArgumentError, TextError, TextWarning, collected
from motet.figures.humanoid import HUMANOID
from motet.generate.act_index import SHIPPED_ACTS
from motet.generate.keyed_acts import STANDS
from motet.keyed.shipped import LIBRARY, TEXTS
from motet.motion.kinematics import global_transforms, positions

OTHER_TEXTS = tomllib.loads((LIBRARY / "says.toml").read_text(encoding="utf-8"))[TEXTS]


@pytest.fixture(scope="module")
def model() -> motet.CodesModel:
    return motet.load_as(motet.CodesModel, "generate")


@pytest.mark.parametrize(
    ("words", "name"),
    [
        ("salute", "salute"),
        ("a person salutes", "salute"),
        ("someone nods", "nod"),
        ("waves with left", "wave"),
        ("walk", None),
        ("nod and walk", None),
        ("a person stands", None),
        ("stand on your toes", "rise on tiptoes"),
        ("salute the flag", None),
        ("a person", None),
        ("", None),
    ],
)
def test_an_act_is_named_by_all_words_and_no_others(words: str, name: str | None) -> None:
    named = SHIPPED_ACTS.named(words.split())
    assert (named and named.act.name) == name


@pytest.mark.parametrize(
    ("words", "left"),
    [
        ("my avatar nods", "nods"),
        ("the old wizard bows", "bows"),
        ("the robot salutes", "salutes"),  # there is a robot dance
        ("avatar shakes its head", "shakes its head"),
        ("she claps her hands excitedly", "claps her hands"),
        ("she claps quickly", "claps quickly"),  # a pace
        ("a man on a horse claps", "a man on a horse claps"),
        ("the nod", "the nod"),
        ("drum claps", "drum claps"),
        ("nod", "nod"),
    ],
)
def test_who_acts_and_in_which_manner_names_no_act(words: str, left: str) -> None:
    assert SHIPPED_ACTS.without_subject(words.split()) == left.split()


def test_whoever_does_it_an_act_is_shown(model: motet.CodesModel) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert model.generate("My avatar nods three times.", seconds=5)[0].action == "nod"
        assert model.generate("the presenter points to the left")[0].action == "point left"


def test_a_side_is_that_of_the_hand() -> None:
    right = SHIPPED_ACTS.named(["wave", "right"])
    left = SHIPPED_ACTS.named(["wave", "left"])
    assert right is not None
    assert set(right.act.keys[0].hands) == {"right_hand"}
    assert left is not None
    assert set(left.act.keys[0].hands) == {"left_hand"}


def test_a_salute_is_done_where_the_hand_belongs(model: motet.CodesModel) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (generated,) = model.generate("a person salutes")
    assert (generated.action, generated.lacking) == ("salute", ())
    rotations, places = global_transforms(generated.motion)
    head = HUMANOID.index("head")
    tip = places[:, HUMANOID.index("rightHand_end")]
    seen_from_head = np.einsum("tji,tj->ti", rotations[:, head], tip - places[:, head])
    assert np.linalg.norm(seen_from_head - [-0.1, 0.1, 0.07], axis=1).min() < 0.08
    # the feet stay where they stood
    for foot in ("leftFoot", "rightFoot"):
        assert np.ptp(places[:, HUMANOID.index(foot)], axis=0).max() < 0.05


def test_it_is_done_as_often_as_the_sentence_says(model: motet.CodesModel) -> None:
    counts = []
    for sentence in ("nod twice", "nod five times"):
        rotations, _ = global_transforms(model.generate(sentence)[0].motion)
        head = rotations[:, HUMANOID.index("head")]
        down = -np.degrees(np.arcsin(head[:, 1, 2]))
        is_down = down > (down.min() + down.max()) / 2
        counts.append(np.count_nonzero(np.diff(is_down.astype(int)) == 1))
    assert counts == [2, 5]


@pytest.mark.parametrize(
    ("sentence", "act", "seconds"),
    [
        ("Raise both arms above the head and hold for 6 seconds.", "raise both arms", 6),
        ("clap for ten seconds", "clap", 10),
        ("salute and hold it for five seconds", "salute", 5),
    ],
)
def test_it_lasts_as_long_as_the_sentence_says(
    model: motet.CodesModel, sentence: str, act: str, seconds: float
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (generated,) = model.generate(sentence)
    assert (generated.action, generated.requested) == (act, {"seconds": seconds})
    assert generated.motion.duration == pytest.approx(seconds, abs=0.05)
    # its last pose is held, not begun and left
    _, places = global_transforms(generated.motion)
    hand = places[:, HUMANOID.index("rightHand"), 1]
    late = round(0.8 * len(hand))
    assert act == "clap" or hand[late] > 0.95 * hand.max()


def test_recorded_actions_come_first(model: motet.CodesModel) -> None:
    assert model.likeliest("a person walks forward").action != "walk"
    assert model.likeliest("a person waves").action not in motet.keyed.ours()["wave"].says
    assert model.likeliest("salute").action == "salute"


@pytest.mark.parametrize(
    ("sentence", "name", "lacking"),
    [
        ("A person hammers a nail into the spaceship.", "hammer", {"spaceship"}),
        ("He points at something beyond the pyramids.", "point", {"beyond", "pyramids"}),
        ("strumming a purple guitar", "play guitar", {"purple"}),
    ],
)
def test_a_sentence_may_say_more_than_an_act(
    model: motet.CodesModel, sentence: str, name: str, lacking: set[str]
) -> None:
    with collected(TextWarning) as messages:
        (generated,) = model.generate(sentence)
    assert generated.action == name
    assert set(generated.lacking) == lacking
    assert any("leaves out" in str(message) for message in messages)
    # as everywhere, strict refuses what is left out, and so does check
    with pytest.raises(motet.TextError, match="leaves out"):
        model.generate(sentence, strict=True)
    with pytest.raises(motet.TextError, match="leaves out"):
        model.check(sentence)


def test_what_is_recorded_comes_before_a_part_of_an_act(model: motet.CodesModel) -> None:
    assert SHIPPED_ACTS.within(["run", "to", "the", "door"]) is None
    assert SHIPPED_ACTS.within(["puts", "hands", "on", "the", "thighs"]) is None  # "put hands up" has another particle
    assert "box" in model.likeliest("a person lifts a box").action


def test_acts_of_the_upper_body_are_done_while_the_figure_goes(model: motet.CodesModel) -> None:
    (walk,) = model.generate("a person walks while waving")
    assert walk.action in motet.keyed.ours()["wave"].says
    places = global_transforms(walk.motion)[1]
    hips = places[:, 0]
    assert np.linalg.norm(np.diff(hips[:, [0, 2]], axis=0), axis=1).sum() > 2.5
    hands = places[:, [HUMANOID.index("leftHand"), HUMANOID.index("rightHand")], 1]
    assert hands.max() > places[:, HUMANOID.index("leftUpperArm"), 1].max()
    # hips that an act moves are not moved during anything else
    assert model.likeliest("walks while doing squats").lacking


def test_styles_are_laid_over_a_walk(model: motet.CodesModel) -> None:
    (limp,) = model.generate("limp")
    (sad,) = model.generate("a sad person walks with his head hanging down", seconds=8)
    assert (limp.action, sad.action) == ("limp", "walk sadly")
    assert len(sad.frames) == 240
    for generated in (limp, sad):
        way = global_transforms(generated.motion)[1][:, 0, [0, 2]]
        assert np.linalg.norm(way[-1] - way[0]) > 2
    # the head hangs to the end: what lasts longer is repeated
    rotations, _ = global_transforms(sad.motion)
    nod = np.degrees(np.arcsin(-rotations[:200, HUMANOID.index("head"), 1, 2]))
    assert nod.min() > 15


def test_a_story_goes_on_before_and_after_it(model: motet.CodesModel) -> None:
    story = model.story("walk forward, then salute, then walk forward", seed=1)
    assert [passage.action == "salute" for passage in story.passages] == [False, True, False]
    # no leap at the joints of its parts: no joint moves farther in a frame than in the walk
    places = global_transforms(story.motion)[1]
    steps = np.linalg.norm(np.diff(places, axis=0), axis=2).max(axis=1)
    assert steps.max() < 0.3
    pieces = list(model.stream("walk forward, then salute", seed=1))
    assert sum(map(len, pieces)) > 60


def test_alone_is_as_in_a_batch_and_seeds_differ(model: motet.CodesModel) -> None:
    alone = model.generate("salute", seed=5)[0]
    batch = model.generate(["a person walks", "salute"], seed=4)[1][0]
    assert np.array_equal(alone.frames, batch.frames)
    assert not np.array_equal(alone.frames[:20], model.generate("salute", seed=6)[0].frames[:20])


def test_what_is_understood_says_the_act(model: motet.CodesModel) -> None:
    understood = model.understood("salute")
    assert understood.confident
    assert understood.nearest == ("salute",)
    assert model.likeliest("a person salutes").lacking == ()
    model.check("a person salutes")


@pytest.mark.parametrize("seconds", [0.1, 0.5, 1.5, 6.0])
def test_it_lasts_as_long_as_it_is_to(model: motet.CodesModel, seconds: float) -> None:
    assert len(model.generate("salute", seconds=seconds)[0].frames) == round(30 * seconds)
    assert len(model.story(["salute", "nod three times"], seconds=seconds).frames) == round(60 * seconds)


def test_a_hurried_act_is_done_to_its_end(model: motet.CodesModel) -> None:
    usual = model.generate("salute")[0]
    seconds = 0.7 * len(usual.frames) / 30
    hurried = model.generate("salute", seconds=seconds)[0]
    hand = HUMANOID.index("rightHand")
    ends = [global_transforms(generated.motion)[1][-1, hand, 1] for generated in (usual, hurried)]
    assert ends[1] == pytest.approx(ends[0], abs=0.1)
    assert max(ends) < 1.1


def test_no_act_lasts_longer_than_it_may(model: motet.CodesModel) -> None:
    assert len(model.generate("salute", max_seconds=1.0)[0].frames) == 30


@pytest.mark.parametrize(
    ("sentence", "parts"),
    [
        ("nod and then shake your head", ["nod", "shake your head"]),
        ("turn left, walk two metres, turn left again", ["turn left", "walk two metres", "turn left again"]),
        ("draw a bow and release the arrow", ["draw a bow and release the arrow"]),
        ("salute twice", ["salute", "salute"]),  # its keys cannot be repeated
        ("jump three times on the left foot", ["hop on the left leg 3 times"]),  # a command that counts
        ("He punches left and right. Then he bows.", ["punch left", "punch right", "he bows"]),
        ("a right jab and a left cross", ["punch right", "punch left"]),
        ("walk and look around", ["walk", "look around"]),  # a recording that glances around does not say that it walks
    ],
)
def test_what_is_done_again_or_otherwise_is_a_part(model: motet.CodesModel, sentence: str, parts: list[str]) -> None:
    assert model.parts(sentence) == parts


@pytest.mark.parametrize(
    ("words", "hand"), [("with the left hand", "left_hand"), ("with your right hand", "right_hand")]
)
def test_an_act_is_done_with_the_hand_that_is_named(model: motet.CodesModel, words: str, hand: str) -> None:
    for act in ("knock", "drink a cup of tea"):
        named = model._keyed(f"{act} {words}")
        assert named is not None
        assert not named.lacking
        assert named.base == STANDS
        hands = set[str]()
        for key in named.act.keys:
            hands |= key.hands.keys()
        assert hands == {hand}


def test_an_act_of_the_hands_is_done_over_one_of_the_legs(model: motet.CodesModel) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        (generated,) = model.generate("marching in place while clapping")
    assert generated.action == "clap, march"
    _, places = global_transforms(generated.motion)
    feet = places[:, [HUMANOID.index("leftFoot"), HUMANOID.index("rightFoot")], 1]
    assert (np.ptp(feet, axis=0) > 0.15).all()
    hands = places[:, HUMANOID.index("leftHand_end")] - places[:, HUMANOID.index("rightHand_end")]
    assert np.linalg.norm(hands, axis=1).min() < 0.2


@pytest.mark.parametrize(
    "text", ["yawn", "a woman sneezes", "yawn and curtsy", "walk and yawn", "swoon. curtsy.", "swoon, curtsy"]
)
def test_words_that_only_acts_have_are_known_to_the_command(text: str, tmp_path: Path) -> None:
    result = run("generate", text, "-o", tmp_path / "out.bvh")
    assert result.exit_code == 0
    assert result.stderr == ""


@pytest.mark.parametrize("sentence", ["robot, " * 3000 + "walk", "wave " + "for 3 seconds " * 2000])
def test_long_sentences_are_refused_before_they_are_read(model: motet.CodesModel, sentence: str) -> None:
    for read in (model.parts, model.quantities, model.likeliest, model.understood, model.generate):
        with pytest.raises(motet.TextError, match="letters, but at most 2000"):
            read(sentence)


@pytest.mark.parametrize(("sentence", "pace"), [("slowly salute", 0.75**2), ("clap quickly", 1.3**2), ("salute", 1.0)])
def test_an_act_is_done_in_the_pace_of_the_sentence(model: motet.CodesModel, sentence: str, pace: float) -> None:
    named = model._keyed(sentence)
    assert named is not None
    assert not named.lacking
    usual = motet.keyed.ours()[named.act.name]
    assert named.act.speed == pytest.approx([pace * speed for speed in usual.speed])
    assert named.act.seconds(3) == pytest.approx(usual.seconds(3) / pace, abs=0.1)


def test_a_text_for_a_command_is_shown_in_the_pace_of_the_sentence(model: motet.CodesModel) -> None:
    assert model.parts("the patient gets out of bed slowly") == ["get up from the floor slowly"]


def test_steps_and_repetitions_are_those_of_a_part(model: motet.CodesModel) -> None:
    parts = model.parts("she steps to the right twice and then claps her hands")
    assert parts == ["she steps to the right twice", "claps her hands"]


def test_a_walk_below_an_act_keeps_its_pace_and_goes_on_after_it(model: motet.CodesModel) -> None:
    slow = model.generate("walk slowly while waving")[0].motion
    usual = model.generate("walk while waving")[0].motion
    speeds = [
        np.linalg.norm(np.diff(global_transforms(motion)[1][:, 0], axis=0), axis=1).mean() for motion in (slow, usual)
    ]
    assert speeds[0] < 0.75 * speeds[1]
    assert len(model.generate("walk while nodding")[0].motion) >= 4 * 30


def test_what_comes_with_an_act_is_not_below_it(model: motet.CodesModel) -> None:
    named = model._keyed("wakes up with a start")
    assert named is not None
    assert (named.below, named.lacking) == ("", ("start",))


def test_numbers_and_repeated_words_are_counted(model: motet.CodesModel) -> None:
    assert model._keyed("clap x3") == model._keyed("clap three times")
    assert model.quantities("jump jump jump").amounts == {"times": 3}
    assert model.parts("jab jab cross") == ["punch left", "punch left", "punch right"]
    assert model.parts("jab cross") == ["punch left", "punch right"]


def test_sentences_mean_other_texts(model: motet.CodesModel) -> None:
    assert model.generate("He rises from his seat.")[0].action == "a person stands up"
    assert model.generate("do squats")[0].requested == {"times": 4}
    # none leaves anything out, or means a third text
    for text in OTHER_TEXTS:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            for part in model.parts(text):
                assert not model.likeliest(part).lacking, text


def test_a_side_that_a_text_does_not_have_is_left_out(model: motet.CodesModel) -> None:
    assert model.parts("combat roll") == ["a person dives into a forward roll and stands up"]
    assert model.likeliest("combat roll to the right").lacking


def test_who_kneels_does_an_act_of_the_hands_kneeling(model: motet.CodesModel) -> None:
    story = model.story("kneel, pray, then stand up")
    _, pray, _ = story.passages
    hips = global_transforms(story.motion)[1][round(30 * pray.start) : round(30 * pray.stop), 0, 1]
    assert hips.max() < 0.75


@pytest.mark.parametrize("sentence", ["sit down and rest", "kneel, wait for 3 seconds", "lie down and do nothing"])
def test_who_sits_kneels_or_lies_stays_so_where_nothing_is_to_be_done(model: motet.CodesModel, sentence: str) -> None:
    story = model.story(sentence)
    rest = story.passages[-1]
    hips = global_transforms(story.motion)[1][round(30 * rest.start) : round(30 * rest.stop), 0, 1]
    assert rest.action == "stay as you are"
    assert rest.stop - rest.start > 2.9
    assert hips.max() < 0.75


def test_who_sits_and_is_to_stand_still_stands(model: motet.CodesModel) -> None:
    story = model.story(["sit down", "stand still"])
    assert global_transforms(story.motion)[1][-1, 0, 1] > 0.85


def test_who_sits_crosses_the_legs_sitting(model: motet.CodesModel) -> None:
    story = model.story("She sits down on a chair and crosses her legs.")
    frames = slice(round(30 * story.passages[1].start), round(30 * story.passages[1].stop))
    places = global_transforms(story.motion)[1][frames]
    assert places[:, 0, 1].max() < 0.75
    left, right, knee = (places[:, HUMANOID.index(name), ::2] for name in ("leftFoot", "rightFoot", "leftLowerLeg"))
    apart = ((left - right) * (knee[:1] - places[:1, HUMANOID.index("rightLowerLeg"), ::2])).sum(axis=1)
    assert apart[0] > 0
    assert apart.min() < 0


@pytest.mark.parametrize(
    ("sentence", "actions"),
    [
        ("spin on the right heel", ["a person spins around"]),
        ("he turned on his heel", ["a person turns around"]),
        ("rotate the torso to the right", ["twist right"]),
        ("twist left", ["twist left"]),
        ("turn your body to the left", ["a person turns left"]),
        ("jump up, then land", ["a person jumps up"]),
        ("crouch, jump and land", ["a person crouches down", "a person jumps up", "land"]),
        ("run up", ["a person runs forward"]),
        ("walk up and kick", ["a person walks forward", "a person kicks forward"]),
        ("sit on a chair with your legs crossed", ["a person sits down", "cross the legs"]),
        ("put the cup on the table", ["put on a table"]),
        ("she puts the vase down on the table", ["put on a table"]),
        ("come closer", ["a person walks forward"]),
        ("open the door and step inside", ["open a door", "a person walks forward"]),
        ("stand at the window", ["a person stands still"]),
        ("move the chair", ["a person pushes something heavy forward"]),
        ("he walks in", ["a person walks forward"]),
        # commands that leave out no more than an action that shows something else
        ("run after him", ["a person runs forward"]),
        ("sit by the fire", ["a person sits down"]),
        ("walk over to the window", ["a person walks forward"]),
        ("jump as high as you can", ["a human leaps up to a great height"]),
    ],
)
def test_no_other_act_is_shown(model: motet.CodesModel, sentence: str, actions: list[str]) -> None:
    assert [model.likeliest(part).action for part in model.parts(sentence)] == actions


def test_a_participle_is_done_at_the_same_time(model: motet.CodesModel) -> None:
    (walk,) = model.generate("a woman walks backwards clapping her hands")
    assert walk.action == "clap"
    places = global_transforms(walk.motion)[1][:, 0]
    assert places[-1, 2] - places[0, 2] < -1.5


ACTS = """
[frobnicate]
says = ["Frobnicate!", "do the frob", "..."]

[[frobnicate.key]]
at = 0.5
hold = 1
left_hand = { to = "top of head" }

[raise_hand]
says = ["wave"]

[[raise_hand.key]]
at = 0.5
hold = 1
right_hand = { to = "above" }
"""


def test_acts_of_a_caller_are_generated_as_those_that_ship(tmp_path: Path, model: motet.CodesModel) -> None:
    (tmp_path / "acts.toml").write_text(ACTS)
    acts = motet.keyed.read(tmp_path / "acts.toml")
    knows = model.with_acts(acts)
    for text, shown in {
        "the elf frobnicates": ["Frobnicate!"],
        "a person does the frob": ["Frobnicate!"],
        "she walks and then frobnicates": ["a person walks forward", "Frobnicate!"],
        # in place of the recordings, and of the act that ships
        "a person waves": ["wave"],
    }.items():
        story = knows.story([text])
        assert [passage.action for passage in story.passages] == shown
        assert not any(passage.lacking for passage in story.passages)
    # a hand is on the head, and above it, where the keys have them
    heights = [joint_heights(knows, text) for text in ("frobnicate", "wave")]
    assert heights[0]["leftHand"] > heights[0]["head"]
    assert heights[1]["rightHand"] > heights[1]["head"] + 0.2
    # the model itself knows none of them
    with pytest.raises(TextError, match="knows no word of 'frobnicate'"):
        model.unknown("frobnicate")
    with pytest.raises(ArgumentError, match="expected acts by name"):
        model.with_acts(["frobnicate"])  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="expected an act by key poses"):
        model.with_acts({"frobnicate": "top of head"})  # type: ignore[dict-item]


def joint_heights(model: motet.CodesModel, text: str) -> dict[str, float]:
    """The height of each joint in the middle of what is shown for a text."""
    motion = model.story([text]).motion
    heights = positions(motion)[len(motion) // 2, :, 1]
    return dict(zip(motion.skeleton.names, heights.tolist(), strict=True))


def test_the_command_knows_acts_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "acts.toml").write_text(ACTS)
    options = ["--acts", str(tmp_path / "acts.toml"), "--json", "-o", str(tmp_path / "out.bvh")]
    (row,) = json.loads(run("generate", "the elf frobnicates", *options).stdout)
    assert row["hypotheses"][0]["passages"][0]["action"] == "Frobnicate!"
    (tmp_path / "acts.toml").write_text("[frobnicate]\n")
    refused = run("generate", "frobnicate", *options)
    assert refused.exit_code == 2
    assert "acts.toml, line 1" in refused.stderr
