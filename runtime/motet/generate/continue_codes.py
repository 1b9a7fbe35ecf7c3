"""Unprompted continuation from similar remembered motions, no faster or slower than the motion before.

The memory tells which actions a motion may show: the remembered places whose last steps are like its own say which, and
how likely each is. Some of these are drawn. Then several rows are drawn for a moment, of one action or another, and the
one that keeps the pace of the motion best is continued; and so moment by moment. From an open motion, such as standing,
other noise leads to another action; a walk goes on walking, since that keeps its pace.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.decode.loop import Ids, Scores
from motet.generate.codec import Codec
from motet.generate.codes import CodesSettings, Source, Writer, nucleus
from motet.motion.rotations import Array
from motet.settings import Range, Settings


@dataclass(frozen=True)
class ContinuationSettings(Settings):
    """How a motion is recognised and continued, and how the continuation is joined to it; tuned on people who are not
    in the figures of docs/results."""

    FEATURE: ClassVar = "continuation"

    context: Annotated[float, Range(0.5, 10, "s")] = 4.0
    """Length of the motion's end that becomes codes."""

    context_steps: Annotated[int, Range(1, 100)] = 12
    """The last of these steps, by which the motion is recognised."""

    context_fading: Annotated[float, Range(0, 1)] = 0.85
    """Weight of each of these steps relative to the one after it."""

    actions: Annotated[int, Range(1, 100)] = 4
    """Number of actions that are drawn."""

    action_scale: Annotated[float, Range(0.001, 100)] = 0.3
    """Actions are drawn by exp(-distance / action_scale), the distance being that of their nearest place."""

    rows: Annotated[int, Range(2, 100)] = 12
    """Rows drawn for each moment; the one that keeps the pace best is continued."""

    moment: Annotated[float, Range(0.1, 10, "s")] = 0.8

    speed_cost: Annotated[float, Range(0, 100)] = 1.0
    """Added to the distance of a place whose speed is off by the factor e."""

    speed_floor: Annotated[float, Range(0.001, 10, "m/s")] = 0.25
    """Speeds well below this count as the same."""

    turn_scale: Annotated[float, Range(0.01, 100, "rad")] = math.radians(200)
    """An angle beside the course that is as bad as a speed off by the factor e."""

    straight: Annotated[float, Range(0, math.pi, "rad")] = math.radians(30)
    """A motion that turns by no more within ``pace_seen`` goes straight."""

    going: Annotated[float, Range(0, 10, "m/s")] = 0.5
    """A slower motion has no course."""

    pace_seen: Annotated[float, Range(0.1, 10, "s")] = 2.0
    """Length of the motion's end whose pace is kept."""

    pace_recent: Annotated[float, Range(0.1, 10, "s")] = 2.2
    """Length of the continuation before a moment whose pace is compared together with it."""

    tempo: Annotated[float, Range(1, 2)] = 1.15
    """Largest factor by which deviations from the pace are played faster or slower."""

    tempo_reach: Annotated[float, Range(0.1, 10, "s")] = 1.5
    """Time before and after a frame over which its speed is averaged."""

    half_life: Annotated[float, Range(0.01, 1, "s")] = 0.1
    """Of the offset between the motion's last frame and its codes."""

    ground_seen: Annotated[float, Range(0.1, 10, "s")] = 1.0
    """Length of the motion's end that defines the ground."""

    ground_reach: Annotated[float, Range(0.1, 10, "s")] = 0.7
    """Time before and after a frame over which its ground is found; more than a stride."""

    ground_limit: Annotated[float, Range(0, 1, "m")] = 0.1
    """Larger differences are jumps, not other floors."""

    anchor: Annotated[float, Range(0.1, 10, "s")] = 1.0
    """Length of the start of a stance that defines where the foot stands; more than a stance of a walk."""


class Pace(NamedTuple):
    """How a motion moves over the ground.

    speed: m/s. turn: to the left, rad/s, 0 for a motion that goes straight, None for one that goes nowhere.
    """

    speed: float
    turn: float | None

    @staticmethod
    def of(rates: Array, fps: float, settings: ContinuationSettings) -> "Pace":
        """Of the root's forward, left (m/s) and turn (rad/s), (T, 3)."""
        speed = float(np.linalg.norm(rates[:, :2], axis=1).mean())
        turned = float(rates[:, 2].sum() / fps)
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
        """The steps (P,) that follow codes (N, P), without an end; the same for the same seed.

        known: how many of the codes the motion is recognised by; those after them were predicted.
        """
        count = self.settings.rows
        noise = [np.random.Generator(np.random.PCG64([seed, row])) for row in range(count)]
        actions, ages = self._drawn_actions(self.source.memory.numbers(codes[:known]), pace, seed)

        # All rows have seen the same steps: one row sees them, and becomes all.
        writer = Writer(self.source, noise[:1], self.drawing)
        writer.see(codes)
        writer.keep(np.zeros(count, dtype=np.intp))
        writer.noise = list(noise)
        writer.age = ages

        # Moment by moment, the row that keeps the pace best is continued in all rows.
        moment = max(1, round(self.settings.moment / self.codec.seconds))
        progress = Progress(self, pace)
        row_actions = actions
        while True:
            drawn = np.stack([writer.draw(row_actions, ends=False) for _ in range(moment)])
            best = progress.nearest(drawn)
            yield from drawn[:, best]
            writer.keep(np.full(count, best))
            writer.noise = list(noise)
            # One half of the rows keeps the action, the other may begin its own again.
            row_actions = np.where(np.arange(count) < count // 2, row_actions[best], actions)

    def _drawn_actions(self, recent: Floats, pace: Pace, seed: int) -> tuple[Ids, Ids]:
        """The action of each row (B,), and the age at which it is entered: a few drawn by their likelihood, in turn."""
        actions, ages, weights = self.likely(recent, self.paces_off(pace))
        uniform = np.random.Generator(np.random.PCG64(seed)).random(self.settings.actions)
        drawn = nucleus(np.tile(weights, (len(uniform), 1)), uniform, 1.0, 1.0)
        in_turn = drawn[np.arange(self.settings.rows) % len(drawn)]
        return actions[in_turn], ages[in_turn]

    def likely(self, numbers: Floats, beside: Array | float = 0.0) -> tuple[Ids, Ids, Scores]:
        """Of all actions, the likeliest first: which they are, the age of each at the place that is nearest, and
        log-weights, from the numbers (N, L) of a motion's last steps. beside: (M,) what is added to the distances."""
        memory = self.source.memory
        distances = self._distances(numbers) + beside
        nearest = {action: rows[distances[rows].argmin()] for action, rows in memory.rows.items()}
        order = sorted(nearest, key=lambda action: (distances[nearest[action]], action))
        places = np.array([nearest[action] for action in order])
        return np.array(order, dtype=np.int64), memory.ages[places], -distances[places] / self.settings.action_scale

    def _distances(self, numbers: Floats) -> Scores:
        """The mean squared distance of the last steps (N, L) from those before each remembered place (M,), the last
        ones counting most."""
        memory = self.source.memory
        remembered = memory.numbers(memory.codes)
        places = np.arange(len(remembered))
        distances = np.zeros(len(remembered), dtype=np.float32)
        total = 0.0
        for back, step in enumerate(numbers[: -self.settings.context_steps - 1 : -1]):
            weight = self.settings.context_fading**back
            off = ((remembered - step) ** 2).sum(axis=1)[places - np.minimum(memory.ages, back + 1)]
            distances += np.float32(weight) * off
            total += weight
        mean: Scores = distances.astype(np.float64) / total
        return mean

    def paces_off(self, pace: Pace) -> Array:
        """How much (M,) the distance of remembered places grows because they continue faster or slower for a moment."""
        gone = self._ways_gone()
        places = np.arange(len(gone) - 1)
        # The steps of a moment, up to where the next motion begins.
        steps = max(1, round(self.settings.moment / self.codec.seconds))
        begins = np.append(np.flatnonzero(np.diff(self.source.memory.ages) != 1) + 1, len(places))
        stops = begins[np.searchsorted(begins, places, side="right")]
        after = np.minimum(places + steps, stops)
        speeds = (gone[after] - gone[:-1]) / (steps * self.codec.seconds)
        return self.settings.speed_cost * self.speeds_apart(speeds, pace.speed)

    def _ways_gone(self) -> Array:
        """The length of the way (M + 1,) gone before each remembered step, and after the last one."""
        moves = self.source.memory.codes[:, 0]
        book = self.codec.book
        is_move = moves < len(book)  # not an end
        lengths = np.where(is_move, np.linalg.norm(book[moves * is_move, :2], axis=1), 0.0)
        return np.concatenate([[0.0], np.cumsum(lengths)])

    def speeds_apart(self, speed: Array, wanted: float) -> Scores:
        """The logarithm of the factor by which speeds (...) are off."""
        floor = self.settings.speed_floor
        off: Scores = np.abs(np.log((speed + floor) / (wanted + floor)))
        return off


class Progress:
    """The difference of a continuation from a pace: its recent speed, and its heading since it began."""

    def __init__(self, continuer: Continuer, pace: Pace) -> None:
        self.continuer = continuer
        self.pace = pace
        self.recent_moves = np.zeros((0, 3))
        self.steps = 0
        self.turned = 0.0

    def nearest(self, drawn: Ids) -> int:
        """The row of those drawn for a moment (S, B, P) that keeps the pace best, and is continued."""
        moves = self.continuer.codec.book[drawn[..., 0]]
        self.steps += len(moves)
        best = int(self._off(moves).argmin())
        # Its moves are the past of the next moment.
        recent = round(self.continuer.settings.pace_recent / self.continuer.codec.seconds)
        self.recent_moves = np.concatenate([self.recent_moves, moves[:, best]])[-recent:]
        self.turned += moves[:, best, 2].sum()
        return best

    def _off(self, moves: Array) -> Scores:
        """How far rows (B,) are off the pace by their moves (S, B, 3)."""
        seconds = self.continuer.codec.seconds
        # The speed of the moment and the recent moves.
        way = np.linalg.norm(moves[..., :2], axis=-1).sum(axis=0)
        way = way + np.linalg.norm(self.recent_moves[:, :2], axis=-1).sum()
        speeds = way / ((len(moves) + len(self.recent_moves)) * seconds)
        off = self.continuer.speeds_apart(speeds, self.pace.speed)
        # The heading beside the course.
        if self.pace.turn is None:
            return off
        turned = self.turned + moves[..., 2].sum(axis=0)
        beside: Scores = np.abs(turned - self.pace.turn * self.steps * seconds)
        return off + beside / self.continuer.settings.turn_scale
