"""What typed sentences ask steered figures for: acts by name, orders, several at once or in a row, and nothing else.

`python tests/runtime/test_spoken.py` counts how typed sentences are read, and writes anew what the twin in JavaScript
is held to (runtime/web/tests/said.json).
"""

import json
import random
from dataclasses import asdict
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from motet.errors import ControlError, TextError
from motet.figures.humanoid import BONES, HUMANOID
from motet.live.protocol import ClientSession, ProtocolError
from motet.steering.acts import WIDTH
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.repertoire import entries, performance
from motet.steering.session import SteerSession
from motet.steering.spoken import Words, words_for

KEPT = Path(__file__).parents[2] / "runtime/web/tests/said.json"

GAITS = ("walk", "run", "skip", "zombie")
"""Of the control that ships, that lead somewhere."""

ORACLE = {
    "wave": "wave",
    "A person waves!": "wave",
    "Please wave with your left hand, twice.": "wave (left, twice)",
    "wave slowly": "wave (slowly)",
    "clap 3 times quickly": "clap (fast, 3 times)",
    "do five push-ups": "push-ups (5 times)",
    "kick with the left foot": "kick (left)",
    "hop on one leg": "hop on one leg",
    "raise your hands": "raise both arms",
    "look left and right": "look around",
    "look to the left": "look left",
    "walk slowly": "walk slowly",
    "jog": "run at a jog",
    "run fast": "run fast",
    "go left": "walk turn left",
    "turn right 45 degrees": "turn right 45 degrees",
    "turn around": "turn around",
    "walk backwards": "walk backwards",
    "step to the right": "walk sideways right",
    "walk in a circle to the right": "walk in a circle",
    "speed up": "faster",
    "slower please": "slower",
    "come here": "come here",
    "stop": "stop",
    "stop waving": "stop",
    "don't wave": "stop",
    "stand still": "stop",
    "walk and wave": "walk and wave",
    "dance, then bow and wave": "dance, then bow, then wave",
    "wave with your left hand, then the right one": "wave (left), then wave (right)",
    "stop and wave": "stop, then wave",
    "stop walking and waving": "stop",
    "clap and stop": "clap, then stop",
    "turn right twice": "turn around",
    "step left twice": "walk sideways left",
    "march forward": "walk (marching)",
    "march": "march",
    "run away": "go away",
    "gallop like a horse": "run (without 'like a horse')",
    "walk like a duck": "walk (penguin)",
    "turn around and wave": "turn around, then wave",
    "bow and leave": "bow, then go away",
    "wave and walk": "wave and walk",
    "tiptoe": "walk (tiptoe)",
    "walk like you are late": "walk (without 'like you are late')",
    "limp to the door": "walk (limping) (without 'to the door')",
    "sneak past the guard slowly, then wave": "sneak (slowly, without 'past the guard'), then wave",
    "stroll to the chair and sit down": "walk (without 'to the chair') and sit down",
    "run forward and then jump": "run, then jump",
    "everyone clap": "clap",
    "limp backwards": "walk backwards (limping)",
    "run drunkenly": "run (drunk)",
    "walk proudly, then turn left": "walk (proud), then turn left",
    "walk like a zombie": "zombie",
    "walk carefully": "walk slowly",
    "march in step slowly": "walk slowly (marching)",
    "walk normally": "walk",
    "shkae hands": "shake hands: 'shkae' read as 'shake'",
}
"""Sentences and what they are to be read as."""

TYPED = {
    "wave": "wave",
    "wave with your left hand": "wave (left)",
    "stop walking": "stop",
    "clap your hands": "clap",
    "throw a ball": "throw",
    "swim": "swim",
    "stretch": "stretch",
    "march": "march",
    "go left": "walk turn left",
    "salute": "salute",
    "nod": "nod",
    "shrug": "shrug",
    "point": "point",
    "sneak": "sneak",
    "walk slowly": "walk slowly",
    "go faster": "faster",
    "walk and wave": "walk and wave",
    "walk in a circle": "walk in a circle",
    "lie down": "lie down",
    "come here": "come here",
    "jump twice": "jump (twice)",
    "sit down": "sit down",
    "dance then bow": "dance, then bow",
    "turn around": "turn around",
    "kick with your right leg": "kick (right)",
    "say hello": "wave",
    "do a push-up": "push-ups",
    "run": "run",
    "look around": "look around",
    "scratch your head": "scratch head",
    "wave goodbye": "wave",
    "raise your hand": "raise a hand",
    "walk backwards quickly": "walk fast backwards",
    "stand still": "stop",
    "do some jumping jacks": "jumping jacks",
    "hop on one leg": "hop on one leg",
    "cheer": "cheer",
    "pick up the box": "pick up a box",
    "drink some water": "drink",
    "punch hard": "punch",
    "play the guitar": "play guitar",
    "crawl": "crawl",
    "please sit on the floor": "meditate",
    "get up": "stop",
    "cross your arms": "cross arms",
    "shake your head": "shake head",
    "run to the right": "run turn right",
    "spin round": "pirouette",
    "think about it": "think",
    "applaud loudly": "clap",
    "kneel and pray": "kneel, then pray",
    "jog slowly then stop": "run slowly, then stop",
    "swing your arms": "swing arms",
    "play golf": "swing a golf club",
    "box": "box",
    "throw with your left hand": "throw (left)",
    "conduct an orchestra": "conduct",
    "don't move": "stop",
    "fly like a bird": "fly",
    "limp": "walk (limping)",
}
"""Sentences that were written before the acts were chosen, and what somebody who types them wants to see."""

UNKNOWN = (
    "paint a dragon",
    "wave the flag of france",
    "asdf",
    "winke",
    "grüße",
    "手を振って",
    "walk to paris",
    "bow left",
    "!?",
)
"""Of which nothing is to be done."""


@pytest.fixture(scope="module")
def words() -> Words:
    return words_for(GAITS)


@pytest.mark.parametrize("text", ORACLE)
def test_sentences_are_read(text: str, words: Words) -> None:
    reading = words.read(text)
    assert reading.caption == ORACLE[text]
    assert reading.everyone == text.startswith("everyone")


def test_every_name_and_synonym_leads_to_its_act(words: Words) -> None:
    assert len(entries()) >= 150
    for act in entries().values():
        for phrase in act.phrases:
            (step,) = words.read(phrase).steps
            assert (step.kind, step.name, step.side, step.count, step.tempo) == ("act", act.name, "", 1, 1.0), phrase
        if act.side:
            for side in ("left", "right"):
                (step,) = words.read(f"{act.name} {side}").steps
                assert (step.name, step.side) in {(act.name, side), (f"{act.name} {side}", "")}


@pytest.mark.parametrize("text", UNKNOWN)
def test_of_what_is_not_known_nothing_is_done_and_three_names_are_offered(text: str, steer_model: SteerModel) -> None:
    session = steer_model.start(hold_feet=False)
    before = session.target
    reading = session.say(f"run, {text}")
    assert reading.steps or reading.unknown
    if reading.unknown:
        assert (session.target == before).all()
        assert session.acting == [None]
        assert len(set(reading.nearest)) == 3
        assert all(name in entries() and name in reading.caption for name in reading.nearest)
    assert bool(reading.unknown) != (text == "!?")


def test_near_names_share_words(words: Words) -> None:
    assert "shoot a bow" in words.read("shoot a rocket bow").nearest
    assert words.read("limp").nearest == words.read("limp").nearest


def places_of(session: SteerSession, ticks: int) -> tuple[np.ndarray[Any, Any], list[Pose]]:
    poses = [session.tick() for _ in range(ticks)]
    return np.concatenate([pose.ground for pose in poses]), poses


def highest(poses: list[Pose], hand: str) -> float:
    return max(float(pose.positions()[0, HUMANOID.index(hand), 1]) for pose in poses)


def test_steps_follow_each_other(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("walk, then stop, then wave with your left hand")
    ground, _ = places_of(session, 85)
    assert np.hypot(*ground[-1, :2]) > 2
    _, poses = places_of(session, 120)
    assert not session.target[0, :2].any()
    assert highest(poses, "leftHand") > 1.4 > highest(poses, "rightHand")


def test_an_act_of_the_arms_is_done_as_the_figure_goes(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("walk and wave")
    ground, poses = places_of(session, 90)
    assert np.hypot(*ground[-1, :2]) > 2
    assert highest(poses, "rightHand") > 1.4


def test_a_circle_is_gone_until_another_command_comes(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("walk in a circle")
    ground, _ = places_of(session, 220)
    assert np.ptp(ground[40:, :2], axis=0).max() < 5
    assert np.ptp(np.unwrap(ground[40:, 2])) > 4
    session.control(direction=0)
    ground, _ = places_of(session, 90)
    assert np.ptp(np.unwrap(ground[60:, 2])) < 0.3


def test_it_comes_here_and_steps_aside_for_a_while(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("come here", here=(1.0, 2.0))
    places_of(session, 120)
    assert session.places[0, :2] == pytest.approx([1, 2], abs=0.1)
    facing = session.places[0, 2]
    session.say("step left")
    places_of(session, 120)
    moved = session.places[0, :2] - [1, 2]
    left = np.radians(facing + 90)
    assert moved @ [np.sin(left), np.cos(left)] > 0.4
    assert session.places[0, 2] == pytest.approx(facing, abs=12)
    assert np.hypot(*session.target[0, :2]) == 0
    with pytest.raises(ControlError, match="here needs x and z"):
        session.say("come here", here=[1.0])


def test_paces_change(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("faster")
    first = np.hypot(*session.target[0, :2])
    session.say("faster")
    session.say("faster")
    assert session.gaits == ["run"]
    assert np.hypot(*session.target[0, :2]) > 1.3 * first
    for _ in range(4):
        session.say("slower")
    assert session.gaits == ["walk"]


def test_a_snapshot_keeps_what_is_to_come(steer_model: SteerModel) -> None:
    session = steer_model.start()
    session.say("walk, then wave")
    places_of(session, 30)
    saved = session.snapshot()
    first, _ = places_of(session, 120)
    session.restore(saved)
    again, _ = places_of(session, 120)
    assert (first == again).all()


def test_acts_by_name_need_no_model_of_words(steer_model: SteerModel) -> None:
    session = steer_model.start(hold_feet=False)
    (shown,) = session.act("wave with the left hand")
    assert (shown.action, shown.lacking, shown.confidence) == ("wave (left)", (), 1.0)
    assert session.acting[0] is not None
    assert session.acting[0][0] == "wave"
    with pytest.raises(TextError, match="'paint a dragon' is not known"):
        session.act("paint a dragon")
    with pytest.raises(TextError, match="is no single act: say it"):
        session.act("walk and wave")


def test_a_client_says_sentences(steer_model: SteerModel) -> None:
    client = ClientSession(steer_model)
    assert client.handle('{"type": "say", "text": "walk and wave"}') == ["walk and wave"]
    assert client.session.target[0, :2].any()
    assert client.handle('{"type": "say", "text": "fnord"}')[0].startswith("? 'fnord' is not known. Nearest: ")
    for wrong in ('{"type": "say"}', '{"type": "say", "text": 3}', '{"type": "say", "text": "x", "here": "y"}'):
        with pytest.raises(ProtocolError):
            client.handle(wrong)


def test_the_other_side_is_the_mirror_image() -> None:
    right = performance("wave", "right")
    left = performance("wave", "left")
    arms = [4 * BONES.index(f"{side}UpperArm") for side in ("right", "left")]
    assert np.allclose(right[:, arms[0] : arms[0] + 4] * (1, -1, -1, 1), left[:, arms[1] : arms[1] + 4])
    assert np.allclose(performance("look right"), performance("look left") @ mirror())


def mirror() -> np.ndarray[Any, Any]:
    """The matrix (W, W) of left and right exchanged."""
    matrix = np.zeros((WIDTH, WIDTH))
    for at, bone in enumerate(BONES):
        other = bone.replace("left", "RIGHT").replace("right", "left").replace("RIGHT", "right")
        to = BONES.index(other)
        matrix[4 * at : 4 * at + 4, 4 * to : 4 * to + 4] = np.diag([1, -1, -1, 1])
    matrix[-4:, -4:] = np.diag([-1, 1, -1, 1])
    return matrix


def test_tempo_and_count_stretch_an_act() -> None:
    once = performance("clap")
    assert len(performance("clap", tempo=0.65)) == pytest.approx(len(once) / 0.65, abs=1)
    thrice = performance("cartwheel", count=3)
    single = performance("cartwheel")
    assert len(thrice) == 3 * len(single) - 2 * 9
    assert np.hypot(*thrice[-1, -4:-2]) > 2.2 * np.hypot(*single[-1, -4:-2])
    steps = np.abs(np.diff(thrice, axis=0)).max()
    assert steps < 1.5 * np.abs(np.diff(single, axis=0)).max() + 0.05


def judged(words: Words) -> dict[str, list[str]]:
    """The typed sentences that are read as they are meant, as something else, and not at all."""
    judgement: dict[str, list[str]] = {"right": [], "wrong": [], "?": []}
    for text, wanted in TYPED.items():
        reading = words.read(text)
        verdict = "right" if reading.caption == wanted else "wrong" if reading.steps else "?"
        judgement[verdict].append(text)
    return judgement


def test_typed_sentences_are_understood_or_refused(words: Words) -> None:
    judgement = judged(words)
    assert judgement["wrong"] == []
    assert judgement["?"] == []


def reading_of(words: Words, text: str) -> dict[str, Any]:
    reading = words.read(text)
    return {**asdict(reading), "caption": reading.caption}


def texts() -> list[str]:
    """Sentences of the oracle, unknown ones, and such as are put together by chance."""
    rng = random.Random(1)
    phrases = list(chain.from_iterable(act.phrases for act in entries().values()))
    parts = [*phrases, "walk", "run", "skip", "go left", "turn around", "stop", "come here", "faster", "step back"]
    extra = [
        "",
        "slowly",
        "fast",
        "twice",
        "3 times",
        "with your left hand",
        "to the right",
        "wildly",
        "seven",
        "fnord",
    ]
    joints = [" and ", ", then ", " while ", ". "]
    made = list[str]()
    for _ in range(160):
        text = f"{rng.choice(parts)} {rng.choice(extra)}".strip()
        if rng.random() < 0.4:
            text += rng.choice(joints) + f"{rng.choice(parts)} {rng.choice(extra)}".strip()
        made.append(text)
    misspelt = ["clpa your hands", "cartwhel", "salut", "jumpp", "wlak"]
    return [*ORACLE, *UNKNOWN, *misspelt, *made]


def answers(words: Words) -> dict[str, Any]:
    performed = [
        ("wave", "left", 1.0, 2),
        ("cartwheel", "", 1.4, 3),
        ("lie down", "", 0.65, 1),
        ("look right", "", 1.0, 1),
    ]
    frames = [
        {"asked": asked, "count": len(shown), "frames": np.round(shown[::20], 6).tolist()}
        for asked in performed
        for shown in [performance(*asked)]
    ]
    return {"said": [[text, reading_of(words, text)] for text in texts()], "performed": frames}


def test_the_twin_is_held_to_what_python_answers(words: Words) -> None:
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    now = json.loads(json.dumps(answers(words)))
    assert now["said"] == kept["said"], "run python tests/runtime/test_spoken.py"
    for one, other in zip(now["performed"], kept["performed"], strict=True):
        assert one["count"] == other["count"]
        assert np.allclose(one["frames"], other["frames"], atol=1e-5)


if __name__ == "__main__":
    rows = answers(words_for(GAITS))
    lines = [json.dumps(row, ensure_ascii=False, separators=(",", ":")) for row in rows["said"]]
    frames = json.dumps(rows["performed"], separators=(",", ":"))
    print({verdict: len(texts) for verdict, texts in judged(words_for(GAITS)).items()})
    KEPT.write_text('{"said": [\n' + ",\n".join(lines) + f'\n],\n"performed": {frames}\n}}\n', encoding="utf-8")
