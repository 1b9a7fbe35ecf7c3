"""Codes that continue a motion of which nothing is said: like people who moved alike, and no faster or slower.

What a motion shows is asked of the memory: the remembered places whose last steps were like its own say which actions
it may be, and how likely each is. Of these some are drawn. Then several rows are drawn for a moment, of one action or
another, and the one that keeps the pace of the motion best goes on; and so moment by moment. Where a motion is open, as
standing is, other noise gives another action; a walk goes on walking, since that is what keeps its pace.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from motet.decode.codec import Codec
from motet.decode.codes import Drawing, Source, Writer, nucleus
from motet.decode.continuation_settings import ContinuationSettings
from motet.decode.noise import Noise
from motet.decode.rollout import Ids, Scores, zero_state
from motet.motion.rotations import Array


class Pace(NamedTuple):
    """How a motion moves over the ground.

    speed: m/s. turn: to the left, rad/s, 0 for a motion that goes straight, None for one that goes nowhere.
    """

    speed: float
    turn: float | None

    @staticmethod
    def of(rates: Array, fps: float, settings: ContinuationSettings) -> "Pace":
        """Of the root's forward, left (m/s) and turn (rad/s), (T, 3)."""
        speed, turned = float(np.linalg.norm(rates[:, :2], axis=1).mean()), float(rates[:, 2].sum() / fps)
        if speed < settings.going:
            return Pace(speed, None)
        return Pace(speed, 0.0 if abs(turned) <= settings.straight else turned * fps / len(rates))


class Continuer(NamedTuple):
    """Draws steps of codes that continue others at a pace."""

    source: Source
    codec: Codec
    drawing: Drawing
    settings: ContinuationSettings

    def steps(self, codes: Ids, known: int, pace: Pace, seed: int) -> Iterator[Ids]:
        """Step by step (P,) what follows codes (N, P), without an end and the same for the same seed.

        known: how many of the codes say what is shown; those after them were predicted.
        """
        actions, ages = self._actions(codes[:known], pace, np.random.Generator(np.random.PCG64(seed)))
        count = self.settings.rows
        noise: list[Noise] = [np.random.Generator(np.random.PCG64([seed, row])) for row in range(count)]
        rows, moment = np.arange(count) % len(actions), max(1, round(self.settings.moment / self.codec.seconds))
        writer, progress = self._begun(noise, codes), Progress(self, pace)
        writer.age, asked = ages[rows], actions[rows]
        while True:
            drawn = np.stack([writer.draw(asked, ends=False) for _ in range(moment)])
            best = progress.nearest(drawn)
            yield from drawn[:, best]
            writer.keep(np.full(count, best))
            writer.noise = noise
            # one half does on what is done, the other may do something else again
            asked = np.where(np.arange(count) < count // 2, asked[best], actions[rows])

    def _begun(self, noise: list[Noise], codes: Ids) -> Writer:
        """A writer whose rows have all seen the same steps (N, P)."""
        writer = Writer(self.source, noise[:1], self.drawing)
        writer.see(codes)
        writer.keep(np.zeros(len(noise), dtype=np.intp))
        writer.noise = list(noise)
        return writer

    def _actions(self, codes: Ids, pace: Pace, noise: np.random.Generator) -> tuple[Ids, Ids]:
        """Some actions (A,) of those that are likely, and their ages."""
        count = self.settings.actions
        actions, ages, weights = self.likely(numbers_of(self.source, codes), self.paces_off(pace))
        found = nucleus(np.tile(weights, (count, 1)), noise.random(count), 1.0, 1.0)
        return actions[found], ages[found]

    def likely(self, numbers: Array, beside: Array | float = 0.0) -> tuple[Ids, Ids, Scores]:
        """Of all actions, the likeliest first: which they are, the age of each at the place that is nearest, and
        log-weights, from the numbers (N, L) of a motion's last steps. beside: (M,) what is added to the distances."""
        memory = self.source.memory
        off = self._distances(numbers) + beside
        nearest = {action: rows[off[rows].argmin()] for action, rows in memory.rows.items()}
        order = sorted(nearest, key=lambda action: (off[nearest[action]], action))
        places = np.array([nearest[action] for action in order])
        return np.array(order, dtype=np.int64), memory.ages[places], -off[places] / self.settings.action_scale

    def paces_off(self, pace: Pace) -> Array:
        """How much (M,) the distance of remembered places grows because they continue faster or slower for a moment."""
        memory, book, seconds = self.source.memory, self.codec.book, self.codec.seconds
        count, steps = len(memory.codes), max(1, round(self.settings.moment / seconds))
        going = memory.codes[:, 0] < len(book)  # an end is no move
        lengths = np.where(going, np.linalg.norm(book[memory.codes[:, 0] * going, :2], axis=1), 0.0)
        gone = np.concatenate([[0.0], np.cumsum(lengths)])
        begins = np.append(np.flatnonzero(np.diff(memory.ages) != 1) + 1, count)
        stops = begins[np.searchsorted(begins, np.arange(count), side="right")]  # where the next motion begins
        after = np.minimum(np.arange(count) + steps, stops)
        return self.settings.speed_cost * self.speeds_apart((gone[after] - gone[:-1]) / (steps * seconds), pace.speed)

    def _distances(self, numbers: Array) -> Array:
        """The mean squared distance (M,) of the last steps before each remembered place from a motion's, the last
        counting most."""
        memory = self.source.memory
        before = memory.keys[:, : numbers.shape[1]]  # of the step before each place
        places, total = np.arange(len(before)), 0.0
        off = np.zeros(len(before), dtype=np.float32)
        for back, seen in enumerate(numbers[: -self.settings.context_steps - 1 : -1]):
            share = self.settings.context_fading**back
            off += np.float32(share) * ((before - seen) ** 2).sum(axis=1)[places - np.minimum(memory.ages, back)]
            total += share
        return off.astype(np.float64) / total

    def speeds_apart(self, speed: Array, wanted: float) -> Scores:
        """The logarithm of the factor by which speeds (...) are off."""
        floor = self.settings.speed_floor
        off: Scores = np.abs(np.log((speed + floor) / (wanted + floor)))
        return off


class Progress:
    """How far what was drawn is off a pace: its speed lately, and its heading since it began."""

    def __init__(self, continuer: Continuer, pace: Pace) -> None:
        self.continuer, self.pace = continuer, pace
        self.lately = np.zeros((0, 3))  # the last moves
        self.steps, self.turned = 0, 0.0

    def nearest(self, drawn: Ids) -> int:
        """Which row of those drawn for a moment (S, B, P) keeps the pace best; it is what was done from now on."""
        moves = self.continuer.codec.book[drawn[..., 0]]
        best = int(self._off(moves).argmin())
        recent = round(self.continuer.settings.pace_recent / self.continuer.codec.seconds)
        self.lately = np.concatenate([self.lately, moves[:, best]])[-recent:]
        self.steps, self.turned = self.steps + len(moves), self.turned + moves[:, best, 2].sum()
        return best

    def _off(self, moves: Array) -> Scores:
        """(B,), of moves (S, B, 3)."""
        settings, seconds = self.continuer.settings, self.continuer.codec.seconds
        way = np.linalg.norm(moves[..., :2], axis=-1).sum(axis=0) + np.linalg.norm(self.lately[:, :2], axis=-1).sum()
        off = self.continuer.speeds_apart(way / ((len(moves) + len(self.lately)) * seconds), self.pace.speed)
        if self.pace.turn is None:
            return off
        turned = self.turned + moves[..., 2].sum(axis=0)
        wanted = self.pace.turn * (self.steps + len(moves)) * seconds
        beside: Scores = off + np.abs(turned - wanted) / settings.turn_scale
        return beside


def numbers_of(source: Source, codes: Ids) -> Array:
    """The numbers (N, L) by which steps (N, P) are compared; they depend on a step alone."""
    null, young = np.full(len(codes), source.null_action), np.zeros(len(codes), dtype=np.int64)
    feeds = {**zero_state(source.step, len(codes)), "codes": codes, "action": null, "age": young}
    found: Array = source.step(feeds)["numbers"]
    return found
