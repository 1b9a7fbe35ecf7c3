"""Codes that go on with a motion of which nothing is said: as people went on who moved alike, and no faster or slower.

What a motion shows is asked of the memory: the remembered places whose last steps were like its own say which actions
it may be, and how likely each is. Of these some are drawn. Then several rows are drawn for a moment, of one action or
another, and the one that keeps the pace of the motion best goes on; and so moment by moment. Where a motion is open, as
standing is, other noise gives another action; a walk goes on walking, since that is what keeps its pace.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from motet.decode.codes import Drawing, Source, Writer, nucleus
from motet.decode.memory import Memory
from motet.decode.noise import Noise
from motet.decode.rollout import Ids, Scores, zero_state
from motet.motion.rotations import Array

ROWS, ACTIONS = 12, 4
"""Rows that are drawn for each moment, and the actions, the same ones possibly, that they are drawn for."""

MOMENT = 0.8
"""Seconds of it."""

PAST, FADING = 12, 0.85
"""Last steps by which it is found what a motion shows, and how much each counts of the one after it."""

ALIKE = 0.3
"""Actions are drawn by exp(-distance / ALIKE), the distance of the place of theirs that is nearest."""

PACE = 0.1
"""What a tenth faster or slower adds to such a distance."""

SPEED, SLOW = 0.1, 0.25
"""A tenth faster or slower is as bad as ..."""

TURN = math.radians(20)
"""... so many radians beside the course. Speeds are told apart from SLOW on, m/s."""

LATELY = 2.2
"""Seconds before a moment that count as the moment does where its speed is judged: what was lost is made up for."""

STRAIGHT = math.radians(30)
"""A motion that turns by no more in the time that is looked at goes straight."""

GOING = 0.5
"""m/s from which on a motion goes somewhere, so that it has a course."""


class Pace(NamedTuple):
    """How a motion moves over the ground.

    speed: m/s. turn: to the left, rad/s, 0 for a motion that goes straight, None for one that goes nowhere.
    """

    speed: float
    turn: float | None

    @staticmethod
    def of(rates: Array, fps: float) -> "Pace":
        """Of the root's forward, left (m/s) and turn (rad/s), (T, 3)."""
        speed, turned = float(np.linalg.norm(rates[:, :2], axis=1).mean()), float(rates[:, 2].sum() / fps)
        if speed < GOING:
            return Pace(speed, None)
        return Pace(speed, 0.0 if abs(turned) <= STRAIGHT else turned * fps / len(rates))


class Shown(NamedTuple):
    """A motion that is gone on with: its steps of codes (G, P), of which the last ``guessed`` do not say what it shows,
    and its pace."""

    codes: Ids
    pace: Pace
    guessed: int = 0


@dataclass(frozen=True, eq=False)
class Ground:
    """What codes do on the ground. book: (K, 3) metres forward and to the left, and radians, of each move.

    seconds: of a step.
    """

    book: Array
    seconds: float

    def moves(self, codes: Ids) -> Array:
        """The moves (..., 3) of steps (..., P)."""
        found: Array = self.book[codes[..., 0]]
        return found


def onward(source: Source, drawing: Drawing, ground: Ground, shown: Shown, steps: int, seed: int) -> Ids:
    """So many steps (N, P) that follow, the same for the same seed."""
    given, pace = shown.codes, shown.pace
    numbers = numbers_of(source, given[: max(1, len(given) - shown.guessed)])
    weighed = likely_actions(source.memory, numbers, paces_off(source.memory, ground, pace))
    actions, ages = _drawn(*weighed, np.random.Generator(np.random.PCG64(seed)))
    noise: list[Noise] = [np.random.Generator(np.random.PCG64([seed, row])) for row in range(ROWS)]
    rows, moment = np.arange(ROWS) % len(actions), max(1, round(MOMENT / ground.seconds))
    found = np.empty((0, source.parts), dtype=np.int64)
    writer = _begun(source, drawing, noise, given)
    writer.age, told = ages[rows], actions[rows]
    while len(found) < steps:
        drawn = np.stack([writer.draw(told, ends=False) for _ in range(moment)])
        best = int(_off(ground, found, drawn, pace).argmin())
        found = np.concatenate([found, drawn[:, best]])
        writer.keep(np.full(ROWS, best))
        writer.noise = noise
        # one half does on what is done, the other may do something else again
        told = np.where(np.arange(ROWS) < ROWS // 2, told[best], actions[rows])
    return found[:steps]


def _begun(source: Source, drawing: Drawing, noise: Sequence[Noise], codes: Ids) -> Writer:
    """A writer whose rows have all seen the same steps (N, P)."""
    writer = Writer(source, noise[:1], drawing)
    writer.see(codes)
    writer.keep(np.zeros(len(noise), dtype=np.intp))
    writer.noise = list(noise)
    return writer


def numbers_of(source: Source, codes: Ids) -> Array:
    """The numbers (N, L) by which steps (N, P) are compared; they depend on a step alone."""
    nobody, young = np.full(len(codes), source.nobody), np.zeros(len(codes), dtype=np.int64)
    feeds = {**zero_state(source.step, len(codes)), "codes": codes, "action": nobody, "age": young}
    found: Array = source.step(feeds)["numbers"]
    return found


def likely_actions(memory: Memory, numbers: Array, beside: Array | float = 0.0) -> tuple[Ids, Ids, Scores]:
    """Of all actions, the likeliest first: which they are, the age of each at the place that is nearest, and
    log-weights, from the numbers (N, L) of a motion's last steps. beside: (M,) what is added to the distances."""
    off = _distances(memory, numbers) + beside
    nearest = {action: rows[off[rows].argmin()] for action, rows in memory.rows.items()}
    order = sorted(nearest, key=lambda action: (off[nearest[action]], action))
    places = np.array([nearest[action] for action in order])
    return np.array(order, dtype=np.int64), memory.ages[places], -off[places] / ALIKE


def paces_off(memory: Memory, ground: Ground, pace: Pace) -> Array:
    """How much (M,) the distance of remembered places grows since they go on faster or slower for a moment."""
    count, steps = len(memory.codes), max(1, round(MOMENT / ground.seconds))
    going = memory.codes[:, 0] < len(ground.book)  # an end is no move
    lengths = np.where(going, np.linalg.norm(ground.book[memory.codes[:, 0] * going, :2], axis=1), 0.0)
    gone = np.concatenate([[0.0], np.cumsum(lengths)])
    begins = np.append(np.flatnonzero(np.diff(memory.ages) != 1) + 1, count)
    stops = begins[np.searchsorted(begins, np.arange(count), side="right")]  # where the next motion begins
    after = np.minimum(np.arange(count) + steps, stops)
    speed = (gone[after] - gone[:-1]) / (steps * ground.seconds)
    return PACE * _speeds_apart(speed, pace.speed)


def _distances(memory: Memory, numbers: Array) -> Array:
    """The mean squared distance (M,) of the last steps before each remembered place from a motion's, the last counting
    most."""
    before = memory.keys[:, : numbers.shape[1]]  # of the step before each place
    places, total = np.arange(len(before)), 0.0
    off = np.zeros(len(before), dtype=np.float32)
    for back, seen in enumerate(numbers[: -PAST - 1 : -1]):
        one = ((before - seen) ** 2).sum(axis=1)
        off += np.float32(FADING**back) * one[places - np.minimum(memory.ages, back)]
        total += FADING**back
    return off.astype(np.float64) / total


def _drawn(actions: Ids, ages: Ids, weights: Scores, noise: np.random.Generator) -> tuple[Ids, Ids]:
    """Some actions (ACTIONS,) of those that are likely, and their ages."""
    found = nucleus(np.tile(weights, (ACTIONS, 1)), noise.random(ACTIONS), 1.0, 1.0)
    return actions[found], ages[found]


def _off(ground: Ground, before: Ids, drawn: Ids, pace: Pace) -> Scores:
    """How far rows drawn for a moment (S, B, P), after steps (N, P), are off the pace (B,)."""
    moves, past = ground.moves(drawn), ground.moves(before)
    lately = past[len(past) - min(len(past), round(LATELY / ground.seconds)) :]
    way = np.linalg.norm(moves[..., :2], axis=-1).sum(axis=0) + np.linalg.norm(lately[:, :2], axis=-1).sum()
    speed = way / ((len(moves) + len(lately)) * ground.seconds)
    off = _speeds_apart(speed, pace.speed)
    if pace.turn is None:
        return off
    turned = past[:, 2].sum() + moves[..., 2].sum(axis=0)
    wanted = pace.turn * (len(past) + len(moves)) * ground.seconds
    beside: Scores = off + np.abs(turned - wanted) / TURN
    return beside


def _speeds_apart(speed: Array, wanted: float) -> Scores:
    off: Scores = np.abs(np.log((speed + SLOW) / (wanted + SLOW))) / SPEED
    return off
