"""The acts that a figure knows by name: ``repertoire.json``, made once by ``motet_train.recipes.repertoire``.

Every other frame is kept, in whole numbers of :data:`STEPS_OF_UNIT` in a unit; each row is the difference from the row
before, whose sign is the lowest bit, so that small numbers have small codes ("zigzag"). Letters in shapes: T frames, W
numbers of a frame (:data:`motet.steering.acts.WIDTH`)."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from motet.bundle.packing import unpacked
from motet.figures.humanoid import BONES, LEFT_RIGHT
from motet.motion.rotations import Array
from motet.steering.acts import WIDTH, Act, ActSettings

if TYPE_CHECKING:
    from motet.steering.model import SteerModel

STEPS_OF_UNIT = 500
"""In a unit of each number of a frame."""

SEAM = 9
"""Frames in which one performance of an act goes over into the next."""

MADE_ACTS = 256
"""Acts of a model, after which the one that was made first is forgotten."""


@dataclass(frozen=True)
class Entry:
    """An act of the repertoire.

    phrases: its name, and what else is said for it. side: with which hand or foot it is shown, "" where it has no other
    side. limbs: what may be named with a side. arms: whether the upper body can do it alone. first: the first of its
    ``frames`` rows of the table. mirror: whether it is the mirror image of these.
    """

    name: str
    phrases: tuple[str, ...]
    side: str
    limbs: frozenset[str]
    arms: bool
    first: int
    frames: int
    mirror: bool


@cache
def document() -> dict[str, Any]:
    """The file, as pages hold it: words and acts, and all frames."""
    text = (files("motet.steering") / "repertoire.json").read_text(encoding="utf-8")
    read: dict[str, Any] = json.loads(text)
    return read


@cache
def entries() -> dict[str, Entry]:
    """The acts by name."""
    return {act["name"]: entry_of(act) for act in document()["acts"]}


def entry_of(act: dict[str, Any]) -> Entry:
    """The entry of an act of the file."""
    return Entry(
        act["name"],
        (act["name"], *act["also"]),
        act.get("side", ""),
        frozenset(act.get("limb", "").split()),
        act["arms"],
        act["first"],
        act["frames"],
        act.get("mirror", False),
    )


@cache
def _rows() -> Array:
    """The kept frames (N, W) of all acts."""
    codes = unpacked(document())["frames"].astype(np.int64)
    differences = (codes >> 1) ^ -(codes & 1)
    rows: Array = np.cumsum(differences, axis=0) / STEPS_OF_UNIT
    return rows


def numbers_of(entry: Entry) -> Array:
    """All frames (T, W) of an act as it is shown: those between two kept ones lie on the cubic through four."""
    kept = _rows()[entry.first : entry.first + entry.frames]
    ends = np.concatenate([kept[:1], kept, kept[-1:]])
    middle = (9 * (ends[1:-2] + ends[2:-1]) - ends[:-3] - ends[3:]) / 16
    numbers = np.empty((2 * len(kept) - 1, WIDTH))
    numbers[::2] = kept
    numbers[1::2] = middle
    return mirrored(numbers) if entry.mirror else numbers


def mirrored(numbers: Array) -> Array:
    """Frames (T, W) with left and right exchanged."""
    quats = numbers[:, :-4].reshape(len(numbers), -1, 4)
    swapped = quats[:, [BONES.index(_mirrored_name(bone)) for bone in BONES]] * (1, -1, -1, 1)
    x, z, facing, height = numbers[:, -4:].T
    return np.column_stack([swapped.reshape(len(numbers), -1), -x, z, -facing, height])


def _mirrored_name(bone: str) -> str:
    left, right = LEFT_RIGHT
    if bone.startswith(left):
        return right + bone.removeprefix(left)
    return left + bone.removeprefix(right) if bone.startswith(right) else bone


def at_tempo(numbers: Array, tempo: float) -> Array:
    """Frames (T, W) played faster or slower."""
    count = int((len(numbers) - 1) / tempo + 0.5) + 1
    times = np.arange(count) * ((len(numbers) - 1) / (count - 1))
    before = np.minimum(times.astype(np.int64), len(numbers) - 2)
    share = (times - before)[:, None]
    played: Array = (1 - share) * numbers[before] + share * numbers[before + 1]
    return played


def joined(parts: Sequence[Array], seam: int = SEAM) -> Array:
    """Frames (T, W) of performances in a row: each begins where the one before ends, into it in ``seam`` frames."""
    whole = parts[0]
    for part in parts[1:]:
        length = min(seam, len(whole) // 2, len(part) // 2)
        following = _placed(part, whole[-length])
        share = (np.arange(1, length + 1) / (length + 1))[:, None]
        before = whole[-length:]
        after = following[:length]
        mixed = (1 - share) * before + share * _signed_like(before, after)
        whole = np.concatenate([whole[:-length], mixed, _signed_like(mixed[-1:], following[length:])])
    return whole


def _placed(numbers: Array, start: Array) -> Array:
    """Frames (T, W) moved over the ground so that they begin where a frame (W,) is."""
    x, z, facing = (numbers[:, -4:-1] - numbers[0, -4:-1]).T
    turn = start[-2] - numbers[0, -2]
    cos = np.cos(turn)
    sin = np.sin(turn)
    ground = [start[-4] + cos * x + sin * z, start[-3] + cos * z - sin * x, start[-2] + facing, numbers[:, -1]]
    return np.column_stack([numbers[:, :-4], *ground])


def _signed_like(before: Array, numbers: Array) -> Array:
    """Frames (T, W) whose quaternions are on the same side as those of the frame before them (1 or T, W)."""
    quats = numbers[:, :-4].reshape(len(numbers), -1, 4)
    like = before[:, :-4].reshape(len(before), -1, 4)
    first = (quats[:1] * like[:1]).sum(axis=2, keepdims=True)
    signed = np.where(first < 0, -quats, quats)
    return np.column_stack([signed.reshape(len(numbers), -1), numbers[:, -4:]])


class Repertoire:
    """The acts of a model by name, each made once: sessions and threads can share it."""

    def __init__(self, model: "SteerModel") -> None:
        self.model = model
        self._made: dict[tuple[str, str, float, int], Act] = {}

    def act(self, name: str, side: str = "", tempo: float = 1.0, count: int = 1) -> Act:
        """An act; with a hand or foot, or to a side, "left" or "right"; so many times as fast; so often in a row.
        KeyError for a name that it does not have."""
        key = name, side, tempo, count
        act = self._made.get(key)
        if act is None:
            if len(self._made) >= MADE_ACTS:
                self._made.pop(next(iter(self._made)), None)
            act = self._made[key] = Act.of(name, performance(*key), self.model.fps, self.model.settings(ActSettings))
        return act


def performance(name: str, side: str = "", tempo: float = 1.0, count: int = 1) -> Array:
    """The frames (T, W) of :meth:`Repertoire.act`."""
    entry = entries()[name]
    numbers = numbers_of(entry)
    if side and side != entry.side:
        numbers = mirrored(numbers)
    if tempo != 1:
        numbers = at_tempo(numbers, tempo)
    return joined([numbers] * count)
