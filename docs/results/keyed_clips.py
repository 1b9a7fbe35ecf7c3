"""Clips of the acts by key poses that describe knows, three draws of each, with a table of sentences, for its training:
`python docs/results/keyed_clips.py FOLDER`."""

import csv
import sys
from pathlib import Path

import motet
import motet.keyed
from motet.cli.key import WALK_SPEED
from motet_train.data.store import KEYED

SENTENCES = 18
"""Sentences of an act at most. The last two of more than eight are for measuring."""

BASE_SECONDS = 20
"""How long somebody stands or walks, over which acts are laid."""

STANDS = ("stop", "walk 2s, stop", "run 2s, turn right 90, stop")
"""For each draw of an act, how somebody comes to stand."""

PACES = (1, 0.93, 1.07)
"""For each draw of an act that is laid over a walk, its speed against that of the first."""

UNKNOWN = frozenset(
    {
        *("put down on the floor", "put on a table", "twist left", "twist right", "land", "roll shoulders"),
        *("shake out hands", "touch the nose", "touch the ear", "touch the shoulder", "touch the knee", "slap"),
        *("cross the legs", "be hit in the chest", "be hit in the head", "be hit in the shoulder", "snap fingers"),
        *("be hit in the back", "hold both arms forward", "fist bump", "tilt head left", "tilt head right"),
        *("stay as you are", "play the flute", "walk like a robot", "walk like a penguin", "chop wood", "ride a bike"),
        *("hold an umbrella", "carry a suitcase", "lean against a wall", "ride a horse", "close a door"),
    }
)
"""Acts that describe does not know, as it describes recordings worse with them."""

PHRASES = {
    **{"robot dance": "dance like a robot", "side bend": "bend to the side", "arm circles": "circle both arms"},
    **{"yoga pose": "hold a yoga pose", "hands on hips": "put the hands on the hips", "airplane": "play airplane"},
    **{"hands behind the back": "put the hands behind the back", "hand on heart": "put a hand on the heart"},
    **{"hands behind the head": "put the hands behind the head", "hands in pockets": "put the hands in the pockets"},
    **{"thumbs up": "give a thumbs up", "victory": "make a sign of victory", "play cello": "sit and play the cello"},
    **{"play harp": "sit and play the harp", "milk a cow": "sit and milk a cow", "row a boat": "sit and row a boat"},
    **{"fan yourself": "fan the face", "carry on the head": "carry something on the head"},
    **{"drive a car": "sit and drive a car", "ride a motorcycle": "sit and ride a motorcycle"},
}
"""What is done in acts whose names have no verb, or leave out that somebody sits."""


def third_person(phrase: str) -> str:
    """A phrase of what somebody does, such as "sit and wave": "sits and waves"."""
    verb, *rest = phrase.split(" ", 1)
    if verb == "be":
        verb = "is"
    elif verb.endswith(("s", "sh", "ch", "x", "z", "o")):
        verb += "es"
    elif verb.endswith("y") and verb[-2] not in "aeiou":
        verb = verb[:-1] + "ies"
    else:
        verb += "s"
    return " ".join([verb, *rest])


def sentences(name: str, says: tuple[str, ...]) -> list[str]:
    """Sentences for an act, the plainest first."""
    phrase = PHRASES.get(name, name)
    shown = " and ".join(map(third_person, phrase.split(" and ")))
    plain = [f"a person {shown}", f"someone {shown}", f"the figure {shown}", phrase]
    return list(dict.fromkeys([*plain, *says]))[:SENTENCES]


def order_of(act: motet.keyed.KeyedAct, draw: int) -> str:
    """What somebody does over whom an act is laid; the last BASE_SECONDS of it count."""
    walks = f"walk speed {WALK_SPEED * act.pace * PACES[draw]:.2f}"
    order = walks if act.over == "walk" else STANDS[draw]
    return f"{order} {BASE_SECONDS + 3 * bool(draw)}s"


def main(folder: Path) -> None:
    """Write the clips, and the table beside them."""
    folder.mkdir()
    model = motet.load_as(motet.SteerModel, "control")
    bases: dict[str, motet.Motion] = {}
    rows = [("clip", "description", "sentence", "pool")]
    for name, act in motet.keyed.ours().items():
        if name in UNKNOWN:
            continue
        texts = sentences(name, act.says)
        kept = len(texts) - 2 if len(texts) > 8 else len(texts)
        for draw in range(len(STANDS)):
            order = order_of(act, draw)
            if order not in bases:
                base = model.run(order)
                bases[order] = base[-round(BASE_SECONDS * base.fps) :]
            clip = f"{KEYED}_{name.replace(' ', '-')}" + (f"_{draw + 1}" if draw else "")
            motet.write(folder / f"{clip}.npz", act.motion(bases[order], seed=draw, strict=False))
            for place, text in enumerate(texts):
                pool = "train" if place < kept else "test"
                rows.append((clip, PHRASES.get(name, name), text, pool))
    with (folder / "sentences.tsv").open("w", encoding="utf-8", newline="") as file:
        csv.writer(file, delimiter="\t", lineterminator="\n", quoting=csv.QUOTE_NONE).writerows(rows)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
