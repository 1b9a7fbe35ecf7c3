"""One draw of an act: its key poses as curves over time, each with other times, sizes and counts.

Between two keys a curve goes as hands do, with the least jerk (Flash and Hogan 1985, equation 3). What is smoothed and
differentiated twice is then taken off, so that a movement begins with a small one the other way and ends a little
beyond its end: anticipation and follow-through, by the filter of Wang et al. 2006, "The cartoon animation filter".

Letters in shapes: T frames.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from motet.figures.feet.contacts import rise, smoothed
from motet.keyed.keys import HandKey, Key, Repeat, Span, mirrored_keys
from motet.keyed.parts import SIDE_OF_HAND, TOUCHES, direction
from motet.motion.rotations import Array

if TYPE_CHECKING:
    from motet.keyed.acts import KeyedAct

Value = TypeVar("Value")

FOLLOW_THROUGH = 0.3
"""How much of the filter's second derivative is taken off."""

FOLLOW_WIDTH = 0.06
"""Seconds of the filter's width."""


class HandPose(NamedTuple):
    """A :class:`motet.keyed.keys.HandKey` with its numbers drawn.

    offset: (3,) in metres from the place, in the axes of its bone. palm, fingers: (3,) directions seen from the upper
    chest, zeros where they are as the forearm has them. touch: metres from the wrist to what goes there.
    """

    place: str
    offset: Array
    elbow: float
    palm: Array
    fingers: Array
    touch: float


class HandTrack(NamedTuple):
    """The way of a hand: from pose ``before`` (T,) to the next one by ``share`` (T,), and how much of it counts against
    the base: ``weight`` (T,)."""

    poses: Sequence[HandPose]
    before: NDArray[np.intp]
    share: Array
    weight: Array

    def mixed(self, values: Array) -> Array:
        """Values (T, ...) on the way between those (N, T, ...) of the N poses."""
        frames = np.arange(len(self.share))
        share = self.share.reshape(-1, *[1] * (values.ndim - 2))
        return (1 - share) * values[self.before, frames] + share * values[self.after, frames]

    @property
    def after(self) -> NDArray[np.intp]:
        """(T,) the pose that comes next."""
        return np.minimum(self.before + 1, len(self.poses) - 1)


@dataclass(frozen=True)
class Drawn:
    """An act of some frames: numbers (T,) of parts by their names, and hands."""

    frames: int
    numbers: Mapping[str, Mapping[str, Array]]
    hands: Mapping[str, HandTrack] = field(default_factory=dict)

    def number(self, part: str, name: str) -> Array:
        """The number of a part (T,), zeros where no key has it."""
        values = self.numbers.get(part, {}).get(name)
        return np.zeros(self.frames) if values is None else values


class _Timed(NamedTuple):
    """A key at its time, in seconds."""

    time: float
    hold: float
    key: Key


Points = list[tuple[float, float]]
"""Times in seconds and values."""


def drawn(act: "KeyedAct", rng: np.random.Generator, fps: float) -> Drawn:
    """A draw of an act at a frame rate."""
    is_mirrored = act.mirrored and rng.random() < 0.5
    keys = mirrored_keys(act.keys) if is_mirrored else act.keys
    speed = _chosen(act.speed, rng)
    ease = _chosen(act.ease, rng) / speed
    timed = _timed(keys, act.repeat, speed, rng)
    points = _points(timed, _chosen(act.amplitude, rng), rng)
    hands = _hand_poses(timed, rng)

    # all of them last until the last one is back at the base
    last = max(key.time + key.hold for key in timed)
    frames = int(np.ceil((last + ease) * fps)) + 1
    times = np.arange(frames) / fps
    numbers: dict[str, dict[str, Array]] = {}
    for (part, name), track in points.items():
        numbers.setdefault(part, {})[name] = with_follow_through(curve(_eased(track, ease), times), fps)
    return Drawn(frames, numbers, {hand: _hand_track(poses, ease, times) for hand, poses in hands.items()})


def _points(timed: Sequence[_Timed], amplitude: float, rng: np.random.Generator) -> dict[tuple[str, str], Points]:
    """The points of each number of each part."""
    points: dict[tuple[str, str], Points] = {}
    for time, hold, key in timed:
        for part, spans in key.numbers.items():
            for name, span in spans.items():
                value = amplitude * _chosen(span, rng)
                points.setdefault((part, name), []).extend(_held(time, hold, value))
    return points


def _hand_poses(timed: Sequence[_Timed], rng: np.random.Generator) -> dict[str, list[tuple[float, HandPose]]]:
    """The poses of each hand, with their times."""
    poses: dict[str, list[tuple[float, HandPose]]] = {}
    for time, hold, key in timed:
        for hand, where in key.hands.items():
            poses.setdefault(hand, []).extend(_held(time, hold, _hand_pose(hand, where, rng)))
    return poses


def _timed(keys: Sequence[Key], repeat: Repeat | None, speed: float, rng: np.random.Generator) -> list[_Timed]:
    """The keys, those that are repeated as often as they are, at rising times."""
    every = 0.0 if repeat is None else _chosen(repeat.every, rng)
    timed: list[_Timed] = []
    earliest = 0.0
    for number, key in _rounds(keys, repeat, rng):
        time = max((_chosen(key.at, rng) + number * every) / speed, earliest)
        hold = _chosen(key.hold, rng) / speed
        timed.append(_Timed(time, hold, key))
        earliest = time + hold
    return timed


def _rounds(keys: Sequence[Key], repeat: Repeat | None, rng: np.random.Generator) -> list[tuple[int, Key]]:
    """The keys, each with how many rounds are over before it."""
    if repeat is None:
        return [(0, key) for key in keys]
    count = int(rng.integers(repeat.times[0], repeat.times[1] + 1))
    rounds = [(0, key) for key in keys[: repeat.first]]
    for number in range(count):
        rounds += [(number, key) for key in keys[repeat.first : repeat.last + 1]]
    return [*rounds, *((count - 1, key) for key in keys[repeat.last + 1 :])]


def _chosen(span: Span, rng: np.random.Generator) -> float:
    low, high = span
    return low if low == high else float(rng.uniform(low, high))


def _held(time: float, hold: float, value: Value) -> list[tuple[float, Value]]:
    return [(time, value), (time + hold, value)] if hold else [(time, value)]


def _hand_pose(hand: str, where: HandKey, rng: np.random.Generator) -> HandPose:
    side = SIDE_OF_HAND[hand]
    offset = np.array([side * _chosen(where.out, rng), _chosen(where.up, rng), _chosen(where.forward, rng)])
    return HandPose(
        where.place,
        offset,
        _chosen(where.elbow, rng),
        direction(where.palm, side) if where.palm else np.zeros(3),
        direction(where.fingers, side) if where.fingers else np.zeros(3),
        TOUCHES[where.touch],
    )


def _hand_track(keys: Sequence[tuple[float, HandPose]], ease: float, times: Array) -> HandTrack:
    key_times = np.array([time for time, _ in keys])
    weight = curve(_eased([(key_times[0], 1.0), (key_times[-1], 1.0)], ease), times)

    # between two poses the share rises from 0 to 1
    before = np.searchsorted(key_times, times, side="right").clip(1, max(1, len(keys) - 1)) - 1
    after = np.minimum(before + 1, len(keys) - 1)
    span = np.maximum(key_times[after] - key_times[before], 1e-6)
    share = rise((times - key_times[before]) / span, 0, 1)
    return HandTrack([pose for _, pose in keys], before, share, weight)


def _eased(points: Points, ease: float) -> Points:
    """Points that begin and end at 0; one at time 0 is there from the begin."""
    first = points[0][0]
    last = points[-1][0]
    begin = [(max(0.0, first - ease), 0.0)] if first > 0 else []
    return [*begin, *points, (last + ease, 0.0)]


def curve(points: Iterable[tuple[float, float]], times: Array) -> Array:
    """Values (T,) at times (T,) of a curve through points, at rest in each of them."""
    knots, values = np.array(list(points), dtype=np.float64).T
    before = np.searchsorted(knots, times, side="right").clip(1, len(knots) - 1) - 1
    span = np.maximum(knots[before + 1] - knots[before], 1e-6)
    share = rise((times - knots[before]) / span, 0, 1)
    through: Array = values[before] + share * (values[before + 1] - values[before])
    return through


def with_follow_through(values: Array, fps: float) -> Array:
    """Values (T,) that begin the other way and go a little beyond their ends."""
    acceleration = np.gradient(np.gradient(values)) * fps**2
    smooth = smoothed(acceleration[:, None, None], FOLLOW_WIDTH, fps)[:, 0, 0]
    return values - FOLLOW_THROUGH * FOLLOW_WIDTH**2 * smooth
