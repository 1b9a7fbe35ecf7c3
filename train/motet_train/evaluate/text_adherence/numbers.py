"""Sentences with numbers: whether a motion turns, goes, steps, repeats and lasts as much as was asked."""

import tomllib
import warnings
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from motet.errors import TextWarning
from motet.generate.base import GenerateModel
from motet_train.evaluate.positions import length, spells
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.rules import HANDS
from motet_train.evaluate.text_adherence.table import slide
from motet_train.evaluate.text_adherence.track import RATE, Track, calm, pair, swings, track_of

BARS = {"degrees": (0.1, 0.0), "metres": (0.1, 0.0), "steps": (0.0, 1.0), "times": (0.0, 0.0), "seconds": (0.0, 0.1)}
"""By how much a motion may be off: a share of what was asked, and an amount."""


@cache
def table() -> Sequence[Mapping[str, Any]]:
    """The rows of numbers.toml."""
    rows: Sequence[Mapping[str, Any]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))[
        "number"
    ]
    return rows


def numbers_report(model: GenerateModel, seeds: Sequence[int]) -> Report:
    """Shares from 0 to 1 of motions that are as asked, of all and by what is asked; and how fast feet slide in them,
    m/s (the mean over motions)."""
    made: dict[str, list[Track]] = {}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", TextWarning)
        for row in table():
            made[row["text"]] = [track_of(model.generate(row["text"], seed=seed)[0].motion) for seed in seeds]
    kept = {row["text"]: float(np.mean([met(track, row) for track in made[row["text"]]])) for row in table()}
    kinds = {kind: [kept[row["text"]] for row in table() if kind in row] for kind in BARS}
    found = {kind: float(np.mean(shares)) for kind, shares in kinds.items()}
    slides = [slide(track) for tracks in made.values() for track in tracks]
    return {
        "numbers": {"all": float(np.mean([*kept.values()])), **found, "slide": float(np.nanmean(slides))},
        "number": kept,
    }


def met(track: Track, row: Mapping[str, Any]) -> bool:
    """Whether a motion is what a row of the table asks, within the bars."""
    kind = next(kind for kind in BARS if kind in row)
    found, asked = measured(track, kind, row.get("act", "")), float(row[kind])
    if row.get("either"):
        found = abs(found)
    share, amount = BARS[kind]
    return abs(found - asked) <= share * abs(asked) + amount + 1e-9


def measured(track: Track, kind: str, act: str = "") -> float:
    """How much of a kind a motion has, or how often it does an act."""
    if kind == "degrees":
        return float(track.heading[-1] - track.heading[0])  # of the hips, from the first to the last frame
    if kind == "metres":
        return float(np.linalg.norm(track.path[-1] - track.path[0]))
    if kind == "seconds":
        return track.seconds
    return float(steps(track) if kind == "steps" else ACTS[act](track))


def steps(track: Track) -> int:
    """How often a foot is moved by 15 cm or more over the ground: while it is faster than 0.4 m/s."""
    count = 0
    for name in pair("Foot"):
        place = track.joint(name)[:, [0, 2]]
        fast = np.concatenate([[False], calm(length(np.diff(place, axis=0)) * RATE, 0.1) > 0.4])
        count += sum(bool(length(place[b - 1] - place[a - 1]) >= 0.15) for a, b in spells(fast))
    return count


def jumps(track: Track) -> int:
    """How often both feet are off the ground for 0.1 to 0.9 s."""
    found = spells(track.soles.min(axis=1) > 0.05)
    return sum(0.1 <= (stop - start) / RATE <= 0.9 for start, stop in found)


def jumping_jacks(track: Track) -> int:
    """How often both hands go above the shoulders and come down again."""
    up = np.greater(track.heights("Hand"), track.heights("UpperArm")).all(axis=0)
    return len(spells(np.asarray(up)))


def kicks(track: Track) -> int:
    """How often a foot comes to 50 cm above the ground or higher."""
    return sum(len(spells(calm(sole, 0.1) >= 0.5)) for sole in track.soles.T)


def dips(track: Track) -> int:
    """How often the hips go down by 20 cm and come up again."""
    return swings(track.height("hips"), 0.2) // 2


def punches(track: Track) -> int:
    """How often a hand shoots forward from the chest at 2 m/s."""
    out = [np.diff(track.body(hand)[:, 2] - track.body("chest")[:, 2]) * RATE for hand in HANDS]
    return sum(len(spells(calm(one, 0.1) >= 2.0)) for one in out)


def bows(track: Track) -> int:
    """How often the trunk comes to lean forward by 25 degrees."""
    trunk = track.body("neck") - track.body("hips")
    return len(spells(calm(np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1])), 0.2) >= 25))


ACTS: Mapping[str, Callable[[Track], int]] = {
    one.__name__: one for one in (jumps, jumping_jacks, kicks, dips, punches, bows)
}
"""Acts that are counted."""
