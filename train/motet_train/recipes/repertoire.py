"""The recipe of what a steered figure does at a word: ``acts.toml`` made into ``motet/steering/repertoire.json``.

    python -m motet_train.recipes.repertoire

Acts are recordings as ``generate`` shows them, parts of which are chosen and joined, or acts by key poses
(:mod:`motet.keyed`).
"""

import json
import tomllib
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import motet.keyed
import motet.steering
from motet.bundle.fields import Json
from motet.bundle.packing import packed
from motet.generate.model import CodesModel
from motet.models.load import load_as
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.repertoire import SEAM, STEPS_OF_UNIT, at_tempo, joined
from motet_train.data.errors import DataError
from motet_train.recipes.styles import as_written, phrases

KEPT_COLUMNS = ("name", "also", "side", "limb")
"""What the document keeps of the table."""

TARGET = Path(motet.steering.__file__).with_name("repertoire.json")


def table() -> Json:
    """``acts.toml``: the acts, and the words of sentences."""
    return tomllib.loads((files("motet_train.data") / "acts.toml").read_text(encoding="utf-8"))


class Maker:
    """Makes the frames of acts."""

    def __init__(self, generate: CodesModel, control: SteerModel) -> None:
        self.generate = generate
        self.control = control
        self.standing: Motion = control.run("stop 12s")  # over which acts are keyed
        self._shown: dict[str, Array] = {}

    def numbers(self, act: Json) -> Array:
        """The frames (T, W) of an act of the table."""
        name = act["name"]
        if "keyed" in act:
            motion = as_written(motet.keyed.ours()[name]).motion(self.standing)
            return self.control.act_of(motion, name).numbers.astype(np.float64)
        parts = [self._part(*take) for take in act["takes"]]
        tempos = act.get("tempos", [1.0] * len(parts))
        played = [at_tempo(part, tempo) for part, tempo in zip(parts, tempos, strict=True)]
        return joined(played, round(act.get("blend", SEAM / self.control.fps) * self.control.fps))

    def _part(self, sentence: str, start: float, stop: float) -> Array:
        """The frames of a sentence from one second to another, backwards where that is earlier."""
        if sentence not in self._shown:
            (shown,) = self.generate.generate(sentence, 1, seed=0, whole=True, numbers=False)
            act = self.control.act_of(shown.motion, sentence)
            self._shown[sentence] = continuous(act.numbers.astype(np.float64))
        first, last = (round(seconds * self.control.fps) for seconds in sorted((start, stop)))
        part = self._shown[sentence][first : last + 1]
        if len(part) < 2:
            raise DataError(f"acts.toml: {sentence!r} has nothing from {start:g} to {stop:g} s")
        return part if start < stop else part[::-1]


def continuous(numbers: Array) -> Array:
    """Frames (T, W) whose quaternions keep their signs from row to row."""
    quats = numbers[:, :-4].reshape(len(numbers), -1, 4)
    turns = (quats[1:] * quats[:-1]).sum(axis=2) < 0
    signs = np.where(np.cumsum(turns, axis=0) % 2 == 1, -1.0, 1.0)
    signed = np.concatenate([quats[:1], quats[1:] * signs[..., None]])
    return np.column_stack([signed.reshape(len(numbers), -1), numbers[:, -4:]])


def made(acts: Json, maker: Maker) -> Json:
    """The document of ``repertoire.json``."""
    documents = dict[str, dict[str, Any]]()
    rows = list[Array]()
    for act in acts["act"]:
        # a mirror image shares the frames of another act
        if "mirror_of" in act:
            shown = documents[act["mirror_of"]]
            more = {key: shown[key] for key in ("arms", "first", "frames")} | {"mirror": True}
        else:
            kept = continuous(maker.numbers(act))[::2]
            more = {"arms": arms_alone(act, kept), "first": sum(map(len, rows)), "frames": len(kept)}
            rows.append(kept)
        documents[act["name"]] = {key: act[key] for key in KEPT_COLUMNS if key in act} | more
    # all frames as one block of small differences
    frames = packed({"frames": differences(np.concatenate(rows))})
    return {
        "words": {**words(acts["words"]), "styles": phrases()},
        "acts": [*documents.values()],
        "steps": STEPS_OF_UNIT,
        **frames,
    }


def arms_alone(act: Json, kept: Array) -> bool:
    """Whether an act is one of the upper body: as the table says, or keyed with hips that stay."""
    moves = np.ptp(kept[:, -4:], axis=0).max() > 0.02
    return bool(act.get("arms", "keyed" in act and not moves))


def words(texts: Json) -> Json:
    """The words of the table as lists; those with a stroke between them are phrases."""
    lists = dict[str, Any]()
    for name, text in texts.items():
        if isinstance(text, dict):
            lists[name] = words(text)
        elif isinstance(text, str):
            lists[name] = text.split("|") if "|" in text else text.split()
        else:
            lists[name] = text
    return lists


def differences(numbers: Array) -> NDArray[np.uint16]:
    """Frames of acts, one after the other, as whole steps from row to row: 0, -1, 1, -2, 2 are 0, 1, 2, 3, 4."""
    whole = np.round(numbers * STEPS_OF_UNIT)
    steps = np.diff(whole, axis=0, prepend=np.zeros((1, whole.shape[1]))).astype(np.int16)
    return ((steps << 1) ^ (steps >> 15)).view(np.uint16)


def main() -> None:
    """Write ``repertoire.json`` anew."""
    maker = Maker(load_as(CodesModel, "generate"), load_as(SteerModel, "control"))
    document = made(table(), maker)
    TARGET.write_text(json.dumps(document, separators=(",", ":")) + "\n", encoding="utf-8")
    seconds = 2 * sum(act["frames"] for act in document["acts"] if "mirror" not in act) / maker.control.fps
    print(f"{len(document['acts'])} acts, {seconds:.0f} s: {TARGET.stat().st_size} bytes")


if __name__ == "__main__":
    main()
