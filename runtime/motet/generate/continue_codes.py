"""Codes that continue a motion of which nothing is said: like people who moved alike, and no faster or slower.

What a motion shows is asked of the memory: the remembered places whose last steps were like its own say which actions
it may be, and how likely each is. Of these some are drawn. Then several rows are drawn for a moment, of one action or
another, and the one that keeps the pace of the motion best goes on; and so moment by moment. Where a motion is open, as
standing is, other noise gives another action; a walk goes on walking, since that is what keeps its pace.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from motet.decode.loop import Ids, Scores, zero_state
from motet.generate.codec import Codec
from motet.generate.codes import CodesSettings, Source, Writer, nucleus
from motet.motion.rotations import Array
from motet.settings import Range, Settings


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """What a motion shows, how it continues, and how the continuation is joined to it; tuned on people who are not in
    the figures of docs/predict.md.

    context: of a motion's end that becomes codes. context_steps: of these the last steps by which it is found what the
        motion shows, each of which counts ``context_fading`` of the one after it.
    actions: drawn by exp(-distance / action_scale), the distance of the place of theirs that is nearest.
    rows, moment: rows that are drawn for each moment, of which the one that keeps the pace best goes on.
    speed_cost: what a speed that is off by the factor e adds to the distance of a place; speed_floor: speeds are not
        told apart under it. turn_scale: an angle beside the course that is as bad as a speed off by the factor e.
        straight: a motion that turns by no more in the time that is looked at goes straight; going: a motion that is
        slower has no course.
    pace_seen: of a motion's end whose pace is kept; pace_recent: before a moment, counts like it.
    tempo: the largest factor by which what is off the pace is played quicker or slower; tempo_reach: before and after
        a frame, by which its speed is found.
    half_life: of what the motion's last frame is beside its codes.
    ground_seen: of a motion's end that says where its ground is; ground_reach: before and after a frame, more than a
        stride, by which its own ground is found; ground_limit: what is off by more is no other floor but a jump.
    anchor: of the start of a stance, more than one of a walk takes, that says where the foot stands.
    """

    FEATURE: ClassVar = "continuation"
    context: Annotated[float, Range(0.5, 10, "s")] = 4.0
    context_steps: Annotated[int, Range(1, 100)] = 12
    context_fading: Annotated[float, Range(0, 1)] = 0.85
    actions: Annotated[int, Range(1, 100)] = 4
    action_scale: Annotated[float, Range(0.001, 100)] = 0.3
    rows: Annotated[int, Range(2, 100)] = 12
    moment: Annotated[float, Range(0.1, 10, "s")] = 0.8
    speed_cost: Annotated[float, Range(0, 100)] = 1.0
    speed_floor: Annotated[float, Range(0.001, 10, "m/s")] = 0.25
    turn_scale: Annotated[float, Range(0.01, 100, "rad")] = math.radians(200)
    straight: Annotated[float, Range(0, math.pi, "rad")] = math.radians(30)
    going: Annotated[float, Range(0, 10, "m/s")] = 0.5
    pace_seen: Annotated[float, Range(0.1, 10, "s")] = 2.0
    pace_recent: Annotated[float, Range(0.1, 10, "s")] = 2.2
    tempo: Annotated[float, Range(1, 2)] = 1.15
    tempo_reach: Annotated[float, Range(0.1, 10, "s")] = 1.5
    half_life: Annotated[float, Range(0.01, 1, "s")] = 0.1
    ground_seen: Annotated[float, Range(0.1, 10, "s")] = 1.0
    ground_reach: Annotated[float, Range(0.1, 10, "s")] = 0.7
    ground_limit: Annotated[float, Range(0, 1, "m")] = 0.1
    anchor: Annotated[float, Range(0.1, 10, "s")] = 1.0


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
    drawing: CodesSettings
    settings: ContinuationSettings

    def steps(self, codes: Ids, known: int, pace: Pace, seed: int) -> Iterator[Ids]:
        """Step by step (P,) what follows codes (N, P), without an end and the same for the same seed.

        known: how many of the codes say what is shown; those after them were predicted.
        """
        settings, noise = self.settings, np.random.Generator(np.random.PCG64(seed))
        actions, ages, weights = self.likely(numbers_of(self.source, codes[:known]), self.paces_off(pace))
        found = nucleus(np.tile(weights, (settings.actions, 1)), noise.random(settings.actions), 1.0, 1.0)
        count, moment = settings.rows, max(1, round(settings.moment / self.codec.seconds))
        each = [np.random.Generator(np.random.PCG64([seed, row])) for row in range(count)]
        rows = found[np.arange(count) % len(found)]
        writer, progress = Writer(self.source, each[:1], self.drawing), Progress(self, pace)
        writer.see(codes)
        writer.keep(np.zeros(count, dtype=np.intp))  # all rows have seen the same
        writer.noise, writer.age, asked = list(each), ages[rows], actions[rows]
        while True:
            drawn = np.stack([writer.draw(asked, ends=False) for _ in range(moment)])
            best = progress.nearest(drawn)
            yield from drawn[:, best]
            writer.keep(np.full(count, best))
            writer.noise = list(each)
            # one half does on what is done, the other may do something else again
            asked = np.where(np.arange(count) < count // 2, asked[best], actions[rows])

    def likely(self, numbers: Array, beside: Array | float = 0.0) -> tuple[Ids, Ids, Scores]:
        """Of all actions, the likeliest first: which they are, the age of each at the place that is nearest, and
        log-weights, from the numbers (N, L) of a motion's last steps. beside: (M,) what is added to the distances."""
        memory, total = self.source.memory, 0.0
        # the mean squared distance of the last steps before each remembered place, the last counting most
        before = np.empty((len(memory.codes), numbers.shape[1]), dtype=np.float32)  # of the step before each place
        for action, rows in memory.rows.items():
            before[rows] = memory.keys[action][:, : numbers.shape[1]]
        places, apart = np.arange(len(before)), np.zeros(len(before), dtype=np.float32)
        for back, seen in enumerate(numbers[: -self.settings.context_steps - 1 : -1]):
            share = self.settings.context_fading**back
            apart += np.float32(share) * ((before - seen) ** 2).sum(axis=1)[places - np.minimum(memory.ages, back)]
            total += share
        off = apart.astype(np.float64) / total + beside
        nearest = {action: rows[off[rows].argmin()] for action, rows in memory.rows.items()}
        order = sorted(nearest, key=lambda action: (off[nearest[action]], action))
        found = np.array([nearest[action] for action in order])
        return np.array(order, dtype=np.int64), memory.ages[found], -off[found] / self.settings.action_scale

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
        settings, seconds = self.continuer.settings, self.continuer.codec.seconds
        moves = self.continuer.codec.book[drawn[..., 0]]
        way = np.linalg.norm(moves[..., :2], axis=-1).sum(axis=0) + np.linalg.norm(self.lately[:, :2], axis=-1).sum()
        off = self.continuer.speeds_apart(way / ((len(moves) + len(self.lately)) * seconds), self.pace.speed)
        self.steps += len(moves)
        if self.pace.turn is not None:
            turned = self.turned + moves[..., 2].sum(axis=0)
            off = off + np.abs(turned - self.pace.turn * self.steps * seconds) / settings.turn_scale
        best = int(off.argmin())
        self.lately = np.concatenate([self.lately, moves[:, best]])[-round(settings.pace_recent / seconds) :]
        self.turned += moves[:, best, 2].sum()
        return best


def numbers_of(source: Source, codes: Ids) -> Array:
    """The numbers (N, L) by which steps (N, P) are compared; they depend on a step alone."""
    null, young = np.full(len(codes), source.null_action), np.zeros(len(codes), dtype=np.int64)
    feeds = {**zero_state(source.step, len(codes)), "codes": codes, "action": null, "age": young}
    found: Array = source.step(feeds)["numbers"]
    return found
