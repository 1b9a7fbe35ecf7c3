"""Acts that a live page does when their words are typed: made once by the model ``generate``, kept in
``repertoire.json``, so that a page needs neither that model nor ONNX Runtime.

    python -m motet.live.repertoire

makes them anew. Frames are whole numbers: quaternions in steps of 1/1000, metres and radians in thousandths; each row
is the difference from the row before, column by column, which gzip presses well.
"""

import json
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.generate.model import CodesModel
from motet.live.packing import packed
from motet.models.load import load_as
from motet.motion.rotations import Array
from motet.steering.model import SteerModel

STEPS = 1000
"""In a unit of each number of a frame."""

SECONDS = 4.0
"""Of what is longer, the part in which most is moved."""

WHOLE = (
    "a man walks forward stops and bows",
    "a human takes a seat on a small stool then rises",
    "the person turns a cartwheel",
    "a person squats down takes a box with both hands and rises",
    "a human is drinking and afterwards twists the bottlecap on",
    "the subject crouches down",
    "the person bends forward and afterwards pulls the back leg forward",
    "the subject lifts 1 leg and holds the arms out to stay balanced",
    "the subject raises both arms and extends a leg sideways",
    "the subject puts the hands on the floor and swings the legs over sideways",
    "a person does a jump",
    "a human leaps up to a great height",
    "a human is jumping to a spot in front of them",
    "a human leaps a short way to the left",
    "a human leaps a short way to the right",
    "someone gets out of the way by stepping left in a hurry",
    "someone gets out of the way by stepping right in a hurry",
    "the person spins around to the right and does a crescent kick with the right leg",
    "the subject does a back kick with the right foot",
    "someone swings the left leg around at belly height",
    "someone swings the right leg around at belly height",
    "a person thrusts the sole of the left foot to the front",
    "a person thrusts the sole of the right foot to the front",
    "someone is kicking forward with 1 leg",
    "a person performs a karate kick to the side",
    "the person stands normally and then takes up a fighting stance",
    "someone dances with a fast turn to the left and lifts the right hand",
    "a person is dancing lambada across the floor with swaying hips",
    "the subject dances an indian dance with big leg movements",
    "a human does jumping jacks then turns the torso from side to side",
    "a woman is crawling along like a soldier under a wire",
    "a human raises both arms goes down onto the hands and exercises on the floor",
    "a person stands as if riding a motorcycle",
    "oiduki a stepping punch is shown by a karate fighter",
)
"""What the whole body does."""

ARMS = (
    "a person stands at a crossing waves vehicles through and points the way",
    "a person boxes into the air",
    "a person is boxing and hits straight with the left arm",
    "a person is boxing and hits straight with the right arm",
    "the subject throws an uppercut with the left hand",
    "the subject throws an uppercut with the right hand",
    "a person performs the karate block gedanbarai",
    "a man celebrates a victory with 1 arm in the air",
    "a person is laughing out loud",
    "a human moves the arm over a window pane to clean it",
    "a human cleans the floor with a mop",
    "a man opens his soda and drinks it",
    "the subject holds a box in front of the body and pushes it overhead",
    "the person searches the surroundings while standing still",
    "a woman swings the upper body loosely from side to side",
    "a woman stays in place chats and raises the right hand now and then",
    "a person is teasing an opponent before fighting on",
)
"""What a figure can do while it walks."""

COMPLETE = {"a human takes a seat on a small stool then rises": 18.0, "a man walks forward stops and bows": 8.0}
"""Seconds of those that end otherwise than in the part in which most is moved."""


@cache
def repertoire() -> dict[str, Any]:
    """The acts that ship, as pages hold them: their sentences, words and lengths, and all frames."""
    repertoire: dict[str, Any] = json.loads((files("motet.live") / "repertoire.json").read_text(encoding="utf-8"))
    return repertoire


def made(generate: CodesModel, control: SteerModel) -> dict[str, Any]:
    """The repertoire: each sentence by the first draw of ``generate``, as an act of ``control``."""
    words = {action["sentence"]: action["words"] for action in generate.manifest.source["actions"]}
    acts = []
    rows = []
    for sentence in (*WHOLE, *ARMS):
        (shown,) = generate.generate(sentence, 1, seed=0, whole=True, numbers=False)
        numbers = control.act_of(shown.motion, sentence).numbers.astype(np.float64)
        whole = COMPLETE.get(sentence, 6.0)
        rows.append(busiest(numbers, round(control.fps * (whole if len(numbers) <= whole * control.fps else SECONDS))))
        acts.append(
            {"sentence": shown.action, "words": words[shown.action], "arms": sentence in ARMS, "frames": len(rows[-1])}
        )
    return {"acts": acts, "steps": STEPS, **packed({"frames": differences(np.concatenate(rows))})}


def busiest(numbers: Array, length: int) -> Array:
    """The part of an act's frames (T, D), so many of them, in which joints turn most; all of a shorter one."""
    turned = np.abs(np.diff(numbers[:, :-4], axis=0)).sum(axis=1)
    if len(numbers) <= length:
        return numbers
    start = int(np.convolve(turned, np.ones(length - 1), "valid").argmax())
    return numbers[start : start + length]


def differences(numbers: Array) -> NDArray[np.int16]:
    """Frames of acts, one after the other, as steps from row to row."""
    whole = np.round(numbers * STEPS)
    return np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]))).astype(np.int16)


def main() -> None:
    """Write ``repertoire.json`` anew."""
    repertoire = made(load_as(CodesModel, "generate"), load_as(SteerModel, "control"))
    place = Path(__file__).with_name("repertoire.json")
    place.write_text(json.dumps(repertoire, separators=(",", ":")) + "\n", encoding="utf-8")
    print(f"{len(repertoire['acts'])} acts: {place.stat().st_size} bytes")


if __name__ == "__main__":
    main()
