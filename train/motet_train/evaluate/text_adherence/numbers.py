"""Sentences with numbers: whether a motion turns, goes, steps, repeats and lasts as much as the sentence says."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from motet.bundle.fields import Json
from motet.generate.base import GenerateModel
from motet_train.data.table import read_toml
from motet_train.evaluate.language.split_store import unknown_words_allowed
from motet_train.evaluate.positions import length, spells
from motet_train.evaluate.tables import Report
from motet_train.evaluate.text_adherence.rules import HAND_BONES
from motet_train.evaluate.text_adherence.table import slide
from motet_train.evaluate.text_adherence.track import RATE, Track, calm, swings, track_of

BARS = {"degrees": (0.1, 0.0), "metres": (0.1, 0.0), "steps": (0.0, 1.0), "times": (0.0, 0.0), "seconds": (0.0, 0.1)}
"""Kind of number -> tolerances: a share of the number, and an amount."""


NUMBERS: Sequence[Json] = read_toml(__file__, "numbers.toml")["number"]
"""The rows of the table of sentences with numbers."""


def numbers_report(model: GenerateModel, seeds: Sequence[int]) -> Report:
    """Shares from 0 to 1 of motions with the right number, of all and by kind; and how fast their feet slide, m/s (the
    mean over motions)."""
    shares = {}
    kind_shares: dict[str, list[float]] = {kind: [] for kind in BARS}
    slides = []
    for row in NUMBERS:
        tracks = _tracks(model, row["text"], seeds)
        share = float(np.mean([met(track, row) for track in tracks]))
        shares[row["text"]] = share
        for kind in BARS:
            if kind in row:
                kind_shares[kind].append(share)
        slides += [slide(track) for track in tracks]
    # all sentences, each kind, and how clean the motions are
    numbers = {"all": float(np.mean(list(shares.values())))}
    for kind, values in kind_shares.items():
        numbers[kind] = float(np.mean(values))
    numbers["slide"] = float(np.nanmean(slides))
    return {"numbers": numbers, "number": shares}


def _tracks(model: GenerateModel, text: str, seeds: Sequence[int]) -> list[Track]:
    with unknown_words_allowed():
        return [track_of(model.generate(text, seed=seed)[0].motion) for seed in seeds]


def met(track: Track, row: Json) -> bool:
    """Whether a motion has the number of a row of the table, within the tolerances."""
    kind = next(kind for kind in BARS if kind in row)
    value = measured(track, kind, row.get("act", ""))
    wanted = float(row[kind])
    if row.get("either"):
        value = abs(value)
    share, amount = BARS[kind]
    return abs(value - wanted) <= share * abs(wanted) + amount + 1e-9


def measured(track: Track, kind: str, act: str = "") -> float:
    """The number of a kind in a motion, or how often it does an act."""
    if kind == "degrees":
        return float(track.heading[-1] - track.heading[0])  # of the hips, from the first to the last frame
    if kind == "metres":
        return float(np.linalg.norm(track.path[-1] - track.path[0]))
    if kind == "seconds":
        return track.seconds
    return float(steps(track) if kind == "steps" else COUNTS_BY_NAME[act](track))


def steps(track: Track) -> int:
    """How often a foot moves over the ground by at least 15 cm while it is faster than 0.4 m/s, and in a run than an
    eighth of its highest speed. It is a count of its own, from the motion as it is written, and no mirror of what
    :mod:`motet.generate.motion_measures` counts in the motion as drawn."""
    count = 0
    for places in track.joints("Foot")[..., [0, 2]]:
        # while the foot is fast; one that runs never rests
        speeds = calm(length(np.diff(places, axis=0)) * RATE, 0.1)
        fast = np.concatenate([[False], speeds > max(0.4, speeds.max(initial=0) / 8)])
        for start, stop in spells(fast):
            if length(places[stop - 1] - places[start - 1]) >= 0.15:
                count += 1
    return count


def jumps(track: Track) -> int:
    """How often both feet are off the ground for 0.1 to 0.9 s."""
    flights = spells(track.soles.min(axis=1) > 0.05)
    return sum(0.1 <= (stop - start) / RATE <= 0.9 for start, stop in flights)


def jumping_jacks(track: Track) -> int:
    """How often both hands go above the shoulders and come down again."""
    return len(spells(track.hands_up))


def kicks(track: Track) -> int:
    """How often a foot comes to 50 cm above the ground or higher."""
    return sum(len(spells(calm(sole, 0.1) >= 0.5)) for sole in track.soles.T)


def dips(track: Track) -> int:
    """How often the hips go down by 20 cm and come up again."""
    return swings(track.height("hips"), 0.2) // 2


def punches(track: Track) -> int:
    """How often a hand shoots forward from the chest at 2 m/s."""
    chest = track.body("chest")[:, 2]
    count = 0
    for hand in HAND_BONES:
        forward_speeds = np.diff(track.body(hand)[:, 2] - chest) * RATE
        count += len(spells(calm(forward_speeds, 0.1) >= 2.0))
    return count


def bows(track: Track) -> int:
    """How often the trunk leans forward by 25 degrees."""
    trunk = track.body("neck") - track.body("hips")
    lean = np.degrees(np.arctan2(trunk[:, 2], trunk[:, 1]))
    return len(spells(calm(lean, 0.2) >= 25))


COUNTING_FUNCTIONS = (jumps, jumping_jacks, kicks, dips, punches, bows)

COUNTS_BY_NAME: Mapping[str, Callable[[Track], int]] = {act.__name__: act for act in COUNTING_FUNCTIONS}
"""Name of an act -> how often a motion shows it."""
