"""What runtime/web is held to beside the bundles' golden runs: Python's answers, kept in its tests as python.json.

`python tests/runtime/test_web.py` writes them anew.
"""

import json
import warnings
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from web_cases import texts
from web_crowd import ACTS, CROWD, FIGURES, STAND, Calls

import motet
from motet.bundle.bundle import Bundle
from motet.bundle.golden import read
from motet.decode.beam import noise_of, score_words
from motet.errors import ControlWarning, TextWarning, TravelWarning, collected
from motet.figures.humanoid import BONES
from motet.formats import read_motion
from motet.generate.codec import Context
from motet.generate.model import CodesModel
from motet.models.describe import DescribeModel
from motet.motion import in_place, is_in_place, with_travel
from motet.motion.kinematics import local_translations
from motet.motion.motion import Motion
from motet.motion.rotations import Array, quat_product
from motet.predict.model import PredictModel
from motet.search.model import Index, IndexSettings, Member, SearchModel
from motet.steering.acts import Act, ActSettings
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.session import SteerSession
from motet.text.vocabulary import EOS, SOS, SPECIALS, Vocabulary

pytestmark = pytest.mark.numeric

KEPT = Path(__file__).parents[2] / "runtime/web/tests/python.json"
EVERY = 30  # frames of which one is kept


def shown(frames: Any) -> dict[str, Any]:
    """How many frames there are, and some of them."""
    return {"count": len(frames), "every": EVERY, "frames": np.round(frames[::EVERY], 5).tolist()}


def golden(name: str) -> NDArray[Any]:
    """The frames of a bundle's golden run."""
    bundle = Bundle.open(name)
    return read(bundle.read(bundle.manifest.golden.file))["run.in.frames"]


def generated(model: CodesModel) -> dict[str, Any]:
    (walk,) = model.generate("a person walks forward", seed=3, seconds=2.5)
    jumps = model.generate("someone jumps twice", 2, seed=11, numbers=False)
    return {"walk": shown(walk.frames), "jumps": [shown(one.frames) for one in jumps]}


def told(model: CodesModel) -> dict[str, Any]:
    texts = ["a person walks forward", "someone waves"]
    story = model.story(texts, seed=5, seconds=[1.3, None], stand="both", numbers=False)
    passages = [{"text": one.text, "start": one.start, "stop": one.stop} for one in story.passages]
    return {**shown(story.frames), "passages": passages}


def continued(model: CodesModel) -> dict[str, Any]:
    """A story after frames, which are taken as they are: a motion made of them is turned by its own facing."""
    (walk,) = model.generate("a person walks forward", seed=3, seconds=2.5)

    class AfterFrames(CodesModel):
        def context(self, figure: Motion) -> Context:
            frames = np.float32(walk.frames)[len(walk.frames) % self.codec.field.hop :]
            return Context(frames, self.codec.codes_of(frames))

    other = AfterFrames(model.manifest, model.graphs, model.tables)
    return shown(other.story("a person runs", after=walk.motion, seed=2, seconds=1.5).frames)


def understood(model: CodesModel) -> list[dict[str, Any]]:
    texts = ["a person walks forward", "the elephant trumpets in a circle"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        found = [(text, model.understood(text, numbers=False)) for text in texts]
    return [
        {"text": text, "confidence": one.confidence, "confident": one.confident, "nearest": one.nearest}
        for text, one in found
    ]


def taken(model: CodesModel) -> dict[str, Any]:
    """The actions that sentences, and their parts, are taken for, with the words that those lack; and the warnings."""
    texts = [
        "a person walks forward",
        "he plays slowly while kicking a ball",
        "she jumps over a wall and then waves",
        "walk to the chair, sit down, stand up again",
        "run after him",
        "step out of the car",
    ]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", TextWarning)
        found = {text: model.generate(text, 2, seed=1, seconds=1, numbers=False) for text in texts}
    said = {str(one.message) for one in caught if "which leaves out" in str(one.message)}
    own = {text: [one for each in row for one in (each, *getattr(each, "passages", ()))] for text, row in found.items()}
    rows = {text: [[one.action, one.lacking, one.confidence] for one in row] for text, row in own.items()}
    return {"taken": rows, "lacking": sorted(said)}


def known() -> dict[str, Any]:
    """A small vocabulary, and what words are taken for: themselves, their stem, a misspelling, and what is near."""
    words = (*SPECIALS, "walks", "walking", "jumps", "waves", "person", "backflips", "7")
    found = Vocabulary(words, common={"strolls": "walks", "greets": "waves", "backrubs": "waves", "wares": "person"})
    given = ["person", "strolls", "strolling", "greeted", "walk", "jmups", "jumpz", "bakcflps", "backflubs", "wavs"]
    given += ["waes", "ump", "pxrsxn", "\u043f\u0440\u044b\u0433"]
    read = {word: [found.meant(word), found.near(word)] for word in given}
    ids = found.encode(" ".join(read))[0].tolist()
    return {"vocabulary": words, "common": found.common, "rules": found.rules.to_json(), "read": read, "ids": ids}


def described(model: DescribeModel) -> dict[str, Any]:
    """By the agreement of 60 draws."""
    loop, encoded = model.LOOPS["consensus"], model._encoded([golden("describe")])
    settings = loop.settled(loop.defaults(model.manifest.defaults), {"draws": 60, "beams": 5})
    settings["noise"] = noise_of(model.limits(settings), 60, 4)  # type: ignore[assignment]  # as describe passes it on
    (row,) = model._hypotheses(loop, encoded, settings)
    return {
        "draws": [
            {"text": model.vocabulary.decode(one.ids), "logProbability": one.log_probability, "score": one.score}
            for one in row
        ]
    }


def answered(model: DescribeModel) -> list[list[dict[str, Any]]]:
    """Of known motions, about the frames of the golden run and about four of them; they are taken as they are."""

    class OfFrames(DescribeModel):
        def frames(self, motion: Motion, least: int = 1) -> NDArray[Any]:
            return motion.values

    other = OfFrames(model.manifest, model.graphs, model.tables)
    motion = replace(model.contract.features(golden("describe")), fps=model.fps)
    rows = other.describe([motion, motion[:4]], 3)
    return [[{"text": one.text, "score": one.score, "confident": one.confident} for one in row] for row in rows]


def scored(model: DescribeModel) -> float:
    """The log-probability of a sentence given the frames of the golden run."""
    ids = model.vocabulary.ids
    words = np.concatenate([[ids[SOS]], model.ids("a person walks"), [ids[EOS]]])[None]
    context = model.contexts([golden("describe")])
    return float(score_words(model.graphs["step"], {"context": context}, np.zeros(1, np.int64), words)[0])


def expected(model: PredictModel) -> list[float]:
    """The expected errors after the frames of the golden run, in metres."""
    known = {"frames": np.repeat(golden("predict")[None], 2, axis=0)}
    known |= model.graphs["encoder"](known)
    error = model.graphs["error"]
    found: list[float] = error({one.name: known[one.name] for one in error.spec.inputs})["error"][0].tolist()
    return found


def long(model: SearchModel) -> list[float]:
    """The direction of a motion of several windows: the frames of the golden run, time and again."""
    frames = np.tile(golden("search"), (8, 1))[: 25 * round(model.fps) + 1]
    motion = replace(model.contract.features(frames), fps=model.fps)
    vectors = [model.contexts([part.values], "motion")[0] for _, part in model.windows(motion, 10.0)]
    found = np.mean(vectors, axis=0)
    return (found / np.linalg.norm(found)).tolist()


def searched(model: SearchModel) -> dict[str, Any]:
    """What is nearest to sentences and to the frames of the golden run among parts of these, and whether it is like
    them."""
    frames = golden("search")
    texts = ["a person walks", "somebody jumps up and down", "he sits down on a chair", "a person walks quixotically"]
    vectors = model.contexts([frames[:10], frames[5:], frames], "motion")
    members = tuple(Member(str(place), 0, 0, ((0.0, 1.0),)) for place in range(len(vectors)))
    with collected(TextWarning):
        rows = Index(model, Path(), members, vectors).search(texts)
    hits = [[[int(hit.path.name), hit.like] for hit in row] for row in rows]
    scores, least = vectors @ vectors[2], model.settings(IndexSettings).like_motion
    return {"texts": texts, "hits": [*hits, [[int(row), bool(scores[row] >= least)] for row in np.argsort(-scores)]]}


def backwards(model: DescribeModel) -> dict[str, Any]:
    """The frames of a walk of :mod:`web_cases` that is played backwards, and what is said of it."""
    walk = read_motion(BytesIO(texts()["walk"].encode()), format="bvh")
    back = replace(walk, values=walk.values[::-1].copy())
    return {"frames": np.round(model.frames(back), 5).tolist(), "text": model.describe(back, beams=1)[0].text}


def parted(model: CodesModel) -> dict[str, list[str]]:
    """What texts ask for one after another."""
    texts = [
        "Walk to the table, drink, turn around and walk back.",
        "sidestep right, then left, then right again",
        "First the man slowly sits down, and then he bows; finally he jumps up and down!",
        "a person is walking, then stops",
        "she carries a box and punches, kicks and dances next to the wall",
        "a tall, thin man walks 1.5 metres with the left and the right hand raised",
        "hop and skip",
        "stand up and walk",
    ]
    return {text: model.parts(text) for text in texts}


def travelled(model: DescribeModel) -> dict[str, Any]:
    """Walks of :mod:`web_cases` at two frame rates, and the same in place: whether they are in place, the path of the
    root that their feet imply, and the first channels of frames for a model."""
    found = {}
    for name, text in texts().items():
        own = read_motion(BytesIO(text.encode()), format="bvh")
        if len(own) < 2:  # a figure alone
            continue
        for fps in (own.fps, 60.0):
            motion = own.continuous().resample(fps)
            still = in_place(motion)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", TravelWarning)
                frames = model.frames(still)
            found[f"{name}, {fps:g}"] = {
                "inPlace": [is_in_place(motion), is_in_place(still)],
                "path": np.round(local_translations(with_travel(still))[::4, 0], 4).tolist(),
                "root": np.round(frames[:, :6], 5).tolist(),
            }
    return found


def turning_about(frames: int = 30) -> list[list[float]]:
    """An act, a turn to the left with a hand up and a knee bent, and rest before it; frames (T, 92), rounded."""
    rows = []
    for frame in range(frames):
        part = max(0.0, (frame - 8) / (frames - 9))
        lifted, bent = 0.6 * part, 0.3 * np.sin(np.pi * part)  # half of the angles
        turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(BONES), 1))
        turns[BONES.index("leftUpperArm"), 2:] = np.sin(lifted), np.cos(lifted)
        turns[BONES.index("leftLowerLeg"), ::3] = np.sin(bent), np.cos(bent)
        rows.append([*np.ravel(turns), 0.4 * part, 0.1 * part, 1.2 * part, 0.95])
    found: list[list[float]] = np.round(rows, 5).tolist()
    return found


def crouching(frames: int = 24) -> list[list[float]]:
    """An act, a squat that goes ahead while a hand jumps round; frames (T, 92), rounded."""
    rows = []
    for frame in range(frames):
        part = frame / (frames - 1)
        turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(BONES), 1))
        for bone, half in (("UpperLeg", -1.0 * part), ("LowerLeg", 1.15 * part), ("Hand", 1.2 * (frame > 14))):
            for side in ("left", "right"):
                turns[BONES.index(side + bone), ::3] = np.sin(half), np.cos(half)
        rows.append([*np.ravel(turns), 0.0, 0.3 * part, 0.0, 0.95 - 0.6 * part])
    found: list[list[float]] = np.round(rows, 5).tolist()
    return found


GROUNDS: dict[str | None, Callable[[Array, Array], Array]] = {
    "stairs": lambda x, z: 0.17 * np.clip(np.floor((z - 2.3) / 0.29), 0, 8),
    "hills": lambda x, z: 0.3 * np.sin(0.7 * x) + 0.02 * z * z,
    "ridges": lambda x, z: 0.15 * np.sin(6 * z),
}
"""Heights of the ground, which tests/cases.ts has, too."""

STEERED: list[dict[str, Any]] = [
    {"control": {"gait": "walk", "velocity": [[1.2, 0.4], [0.3, -1.1]]}},
    {"control": {"gait": ["run", "walk"], "speed": 2.5, "direction": [80.0, -40.0], "facing": [80.0, -20.0]}},
    {"push": [0.5, -0.3]},
    {"act": {"ids": [0]}},
    {"control": {"speed": 0.0}},
    {"act": {"ids": [1, 0]}},
    {"act": {"ids": [0], "upper": False}},
    {"control": {"gait": "walk", "speed": 1.2, "direction": [-60.0, 40.0]}},
    {"jump": {"ids": [0]}},
    *[{}] * 2,
    {"put": [[1.0, 2.0, 30.0], [-2.0, 0.5, -90.0]], "control": {"gait": "zombie", "direction": 10.0, "speed": 0.4}},
    {"keep_apart": 0.8, "go_to": {"points": [[-2.0, 1.0], [1.5, 2.5]], "facing": [90.0, -45.0], "gait": "walk"}},
    *[{}] * 6,
    {"go_along": {"points": [[1.0, 4.0], [3.0, 4.0]], "gait": "run", "speed": 2.5, "ids": [1]}},
    *[{}] * 4,
    {"keep_apart": None, "go_to": {"points": None}},
    *[{}] * 4,
    {"look_at": {"points": [[3.0, 1.2, 3.0], [1.0, 2.5, 9.0]]}},
    {"reach": {"hand": "left", "points": [[-1.8, 1.3, 1.2], [3.0, 1.2, 9.0]]}, "act": {"ids": [0]}},
    {"look_at": {"points": [-2.0, 0.4, -3.0], "ids": [1]}, "control": {"gait": "walk", "velocity": [0.8, -0.6]}},
    {"reach": {"hand": "right", "points": [2.5, 1.6, 3.0], "ids": [1]}},
    {"look_at": {"points": None}, "reach": {"hand": "left", "points": None, "ids": [0]}, "end": {"ids": [0]}},
    {"reach": {"hand": "right", "points": [2.0, 1.3, 1.2]}, "control": {"gait": "walk", "velocity": [1.2, 0.0]}},
    {"control": {"speed": 0.0}, "crouch": {"ids": [0, 1], "upper": False}},
    {},
    {"act": {"ids": [0, 1], "upper": False}, "reach": {"hand": "right", "points": [0.0, 1.6, -9.0]}},
    {"put": [[1.0, 2.0, 30.0], [-2.0, 0.5, -90.0]], "set_ground": "stairs"},
    {"control": {"gait": ["walk", "run"], "speed": [1.2, 2.5], "direction": [0.0, 20.0]}},
    *[{}] * 3,
    {"set_ground": "hills"},
    {"control": {"gait": "walk", "speed": 1.0, "direction": [80.0, -150.0], "facing": [0.0, -100.0]}},
    *[{}] * 3,
    {"set_ground": None},
    {"end": {}, "reach": {"hand": "right", "points": None}},
    {"control": {"speed": [0.3, 0.55], "direction": [120.0, -50.0], "facing": [0.0, 20.0]}},
    *[{}] * 6,
    {"control": {"speed": 0.0, "facing": [100.0, 20.0]}},
    *[{}] * 4,
    # head on, and then from too near
    {"put": [[0.0, -1.5, 0.0], [0.1, 1.5, 180.0]], "keep_apart": 0.8, "go_to": {"points": [[0.0, 1.5], [0.1, -1.5]]}},
    *[{}] * 3,
    {"put": [[0.0, 0.0, 0.0], [0.35, 0.1, 10.0]], "go_to": {"points": [[0.3, 2.0], [0.1, 2.0]]}},
    {},
    # looks up and far behind; slopes about as steep as feet are tilted to
    {"put": [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]], "keep_apart": None, "go_to": {"points": None}},
    {"look_at": {"points": [[0.3, 4.0, 0.6], [2.3, 1.5, -1.5]]}, "set_ground": "ridges"},
    {"control": {"gait": "walk", "speed": 1.0, "direction": 0.0}},
    {},
    # in styles, of which one goes with the steps, and with an act of the arms and of the body
    {"set_ground": None, "look_at": {"points": None}, "control": {"style": ["marching", "drunk"]}},
    *[{}] * 2,
    {"act": {"ids": [0], "upper": True}, "control": {"speed": 0.0, "style": ["marching", "tiptoe"]}},
    {},
    {"act": {"ids": [1], "upper": False}, "control": {"style": ["none", "tiptoe"]}},
    *[{}] * 2,
]
"""Calls of two figures' session, one after the other; after each three quarters of a second pass. What is acted is
:func:`turning_about`, and for "crouch" :func:`crouching`."""


def obey(session: SteerSession, calls: Calls, acts: dict[str, Act | str | None]) -> None:
    """Let a session do what is called by name, in this order."""
    for name, given in calls.items():
        if name in acts:
            session.act(acts[name], **given)
        elif name == "set_ground":
            session.set_ground(GROUNDS.get(given))
        elif isinstance(given, dict):
            getattr(session, name)(**given)
        else:
            getattr(session, name)(given)


def shown_rotations(pose: Pose) -> NDArray[Any]:
    """Those of bones, the hips' in the world."""
    rotations = pose.rotations.copy()
    rotations[:, 0] = quat_product(pose.heading, rotations[:, 0])
    return rotations


def steered(model: SteerModel, hold_feet: bool) -> tuple[list[list[Any]], list[list[Any]]]:
    """Of two figures in every twelfth picture, 48 a second: ground, hips, rotations, contacts; and what happens to each
    after each call."""
    session, found, happened = model.start(characters=2, hold_feet=hold_feet), [], []
    acts: dict[str, Act | str | None] = {"end": None, "jump": "jump"}
    for name, frames in (("act", turning_about()), ("crouch", crouching())):
        acts[name] = Act.of(name, np.array(frames, np.float32), model.fps, model.settings(ActSettings))
    for calls in STEERED:
        with collected(ControlWarning):
            obey(session, calls, acts)
        poses = [session.advance(1 / 48) for _ in range(36)]
        found += poses[::12]
        events = [event for pose in poses for event in pose.events]
        happened.append([[[one.kind, one.name] for one in events if one.character == n] for n in range(2)])
    rows: list[list[Any]] = []
    for pose in found:
        parts = (pose.ground, pose.height[:, None], shown_rotations(pose).reshape(2, -1), pose.contacts)
        rows.append(np.round(np.concatenate(parts, axis=1, dtype=np.float64), 5).tolist())
    return rows, happened


def crowded(model: SteerModel) -> dict[str, Any]:
    """What the calls of :mod:`web_crowd` lead to. After each: of each figure ground, hips, and the sums of all bones'
    rotations; who did what in which picture; and how many pictures hands were out of reach for, by their number."""
    acts: dict[str, Act | str | None] = {"jump": "jump"}
    for name, act in ACTS.items():
        frames = np.array([np.add(STAND, share * np.subtract(act["last"], STAND)) for share in act["shares"]])
        acts[name] = Act.of(name, frames, model.fps, model.settings(ActSettings))
    made = [[len(act), act.legs] for act in acts.values() if isinstance(act, Act)]
    session = model.start(characters=FIGURES)
    rows, happened, beyond = [], [], []
    for calls in CROWD:
        with collected(ControlWarning):
            obey(session, calls, acts)
        events: dict[str, list[int]] = {}
        missed = np.zeros(2 * FIGURES, int)
        for picture in range(36):
            pose = session.advance(1 / 48)
            missed += session.out_of_reach.ravel()
            for event in sorted(pose.events, key=lambda event: event.character):
                events.setdefault(f"{event.kind} {event.name}".strip(), []).extend((event.character, picture))
        turns = shown_rotations(pose)[..., :3].sum(axis=1)
        parts = (pose.ground, pose.height[:, None], turns)
        rows.append(np.round(np.concatenate(parts, axis=1, dtype=np.float64), 5).tolist())
        happened.append(events)
        beyond.append([[int(hand), int(missed[hand])] for hand in np.flatnonzero(missed)])
    kept = {"stand": STAND, "acts": ACTS, "calls": CROWD, "made": made}
    return {**kept, "rows": rows, "happened": happened, "beyond": beyond}


def answers() -> dict[str, Any]:
    generate, describe, control = motet.load("generate"), motet.load("describe"), motet.load("control")
    held, happened = steered(control, hold_feet=True)
    return {
        **generated(generate),
        "story": told(generate),
        "after": continued(generate),
        "understood": understood(generate),
        **taken(generate),
        "parts": parted(generate),
        "known": known(),
        **described(describe),
        "score": scored(describe),
        "answered": answered(describe),
        "expected": expected(motet.load("predict")),
        "long": long(motet.load("search")),
        "searched": searched(motet.load("search")),
        "backwards": backwards(describe),
        "travel": travelled(describe),
        "steering": STEERED,
        "acted": turning_about(),
        "crouched": crouching(),
        "steered": steered(control, hold_feet=False)[0],
        "held": held,
        "happened": happened,
        "crowd": crowded(control),
    }


def same(found: Any, kept: Any) -> bool:
    if isinstance(kept, float | int) and not isinstance(kept, bool):
        return abs(found - kept) < 1e-4 * max(1, abs(kept))
    if isinstance(kept, list):
        return len(found) == len(kept) and all(map(same, found, kept))
    if isinstance(kept, dict):
        return found.keys() == kept.keys() and all(same(found[name], kept[name]) for name in kept)
    return bool(found == kept)


def test_what_the_runtime_in_javascript_is_held_to_is_what_python_answers() -> None:
    found = json.loads(json.dumps(answers()))
    kept = json.loads(KEPT.read_text(encoding="utf-8"))
    assert [name for name in found if not same(found[name], kept.get(name))] == []


if __name__ == "__main__":
    rows = [f"{json.dumps(name)}: {json.dumps(found, separators=(',', ':'))}" for name, found in answers().items()]
    KEPT.write_text("{\n" + ",\n".join(rows) + "\n}\n", encoding="utf-8")
