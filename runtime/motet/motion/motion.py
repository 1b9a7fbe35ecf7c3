"""The motion: frames of named channels with units and a frame rate. Immutable, finite, never guessed."""

import logging
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from os import PathLike
from typing import Any, SupportsIndex

import numpy as np

from motet.errors import ArgumentError, MotionError, listed, quoted
from motet.motion.rotations import (
    Array,
    Indices,
    continuous_euler,
    continuous_rotvec,
    without_turns,
)
from motet.motion.skeleton import Names, Skeleton

log = logging.getLogger(__name__)

UNITS = ("deg", "rad", "length", "m", "deg/s", "rad/s", "m/s", "1")
"""Units of channels; "length" is the skeleton's length unit, "1" a number without unit."""

TURN = {"deg": 360.0, "rad": 2 * np.pi}
"""A whole turn in each unit of angle."""


@dataclass(frozen=True, eq=False, repr=False)
class Motion:
    """A motion of T frames and D channels.

    values: (T, D) float64, read-only. Any array is accepted and copied; NaN and infinity are refused.
    channels: D unique names, "JOINT.rx" for an Euler angle about x, "JOINT.tx" for a translation along x.
    units: D units from :data:`UNITS`.
    fps: frames per second.
    skeleton: the skeleton that the channels move, or None.
    MotionError if these do not match.
    """

    values: Array
    channels: Names
    units: Names
    fps: float
    skeleton: Skeleton | None = None

    def __post_init__(self) -> None:
        try:
            values = np.array(self.values, dtype=np.float64, order="C")  # frames are contiguous, whatever the source
        except (TypeError, ValueError) as error:
            raise MotionError(f"the values of a motion must be numbers: {error}") from error
        values.flags.writeable = False
        # a frozen dataclass refuses assignments, here too
        self.__dict__.update(
            values=values,
            channels=tuple(self.channels),
            units=tuple(self.units),
            fps=float(self.fps),
        )
        if values.ndim != 2 or values.shape[1] != len(self.channels):
            raise MotionError(f"values of shape {values.shape} do not fit {len(self.channels)} channels")
        _check_channels(self.channels, self.units)
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise MotionError(f"the frame rate must be a positive number, not {self.fps}")
        if not np.isfinite(values).all():
            raise MotionError(self._not_finite())

    def _not_finite(self) -> str:
        """A sentence naming the first value that is not finite."""
        bad = np.argwhere(~np.isfinite(self.values))
        frame, channel = bad[0]
        place = f"frame {frame}, channel {self.channels[channel]!r} is {self.values[frame, channel]}"
        return f"{place}: {len(bad)} values are not finite"

    def __len__(self) -> int:
        return len(self.values)

    @property
    def duration(self) -> float:
        """Seconds: the number of frames divided by fps."""
        return len(self) / self.fps

    def __repr__(self) -> str:
        return f"Motion({len(self)} frames, {len(self.channels)} channels, {self.fps:g} fps, {self.duration:.1f} s)"

    def __reduce__(self) -> tuple[Any, ...]:
        # pickle and deepcopy return writeable arrays: rebuilding the motion makes it read-only again
        return Motion, (self.values, self.channels, self.units, self.fps, self.skeleton)

    def __getitem__(self, frames: slice | SupportsIndex) -> "Motion":
        """The motion of a slice of its frames, with the frame rate divided by the slice's step; or of one frame.

        IndexError for a frame that does not exist.
        """
        if not isinstance(frames, slice):
            index = range(len(self))[frames]
            return replace(self, values=self.values[index : index + 1])
        step = 1 if frames.step is None else frames.step
        if step < 1:
            raise MotionError(f"the step of a slice must be positive, not {step}")
        return replace(self, values=self.values[frames], fps=self.fps / step)

    def __iter__(self) -> Iterator["Motion"]:
        return (self[index] for index in range(len(self)))

    def cut(self, start: float = 0.0, stop: float | None = None) -> "Motion":
        """The part from ``start`` to ``stop``, in seconds; MotionError outside the motion."""
        stop = self.duration if stop is None else stop
        if not 0 <= start < stop <= self.duration + 0.5 / self.fps:
            raise MotionError(f"cannot cut {start:g} to {stop:g} s out of a motion of {self.duration:g} s")
        part = self[round(start * self.fps) : round(stop * self.fps)]
        if not len(part):
            raise MotionError(f"no frame between {start:g} and {stop:g} s at {self.fps:g} fps")
        return part

    def select(self, channels: Names, units: Names | None = None) -> "Motion":
        """The named channels in the order given, converted to ``units``; MotionError names what is missing."""
        if channels == self.channels and units in (None, self.units):
            return self
        places = _places(self.channels)
        missing = [name for name in channels if name not in places]
        if missing:
            raise MotionError(f"the motion lacks {len(missing)} of {len(channels)} channels: {listed(missing)}")
        # each column in its wanted unit
        columns = [places[name] for name in channels]
        units = units or tuple(self.units[column] for column in columns)
        factors = [self._factor(column, unit) for column, unit in zip(columns, units, strict=True)]
        return replace(
            self,
            values=self.values[:, columns] * factors,
            channels=channels,
            units=units,
        )

    def _factor(self, column: int, unit: str) -> float:
        old = self.units[column]
        if old == unit:
            return 1.0
        angles = old.removesuffix("/s"), unit.removesuffix("/s")
        if set(angles) <= TURN.keys() and old.endswith("/s") == unit.endswith("/s"):
            return TURN[angles[1]] / TURN[angles[0]]
        if {old, unit} == {"length", "m"} and self.skeleton is not None:
            metres = self.skeleton.unit_factor(1.0)
            return metres if unit == "m" else 1 / metres
        raise MotionError(f"channel {self.channels[column]!r} is in {old!r}, which does not convert to {unit!r}")

    def scaled(self, metres_per_unit: float) -> "Motion":
        """The same motion with skeleton and "length" channels in another length unit."""
        if self.skeleton is None:
            raise MotionError("a motion without a skeleton has no length unit to convert from")
        if not isinstance(metres_per_unit, int | float) or not 0 < metres_per_unit < np.inf:
            raise MotionError(f"a unit is a positive number of metres, not {metres_per_unit!r}")
        factor = self.skeleton.unit_factor(metres_per_unit)
        factors = [factor if unit == "length" else 1.0 for unit in self.units]
        return replace(
            self,
            values=self.values * factors,
            skeleton=self.skeleton.scaled(metres_per_unit),
        )

    def with_unit(self, metres_per_unit: float) -> "Motion":
        """The same motion with the skeleton's length unit set, for files that do not state it."""
        if self.skeleton is None:
            raise MotionError("a motion without a skeleton has no length unit")
        return replace(self, skeleton=replace(self.skeleton, metres_per_unit=metres_per_unit))

    def resample(self, fps: float, to_end: bool = False) -> "Motion":
        """The motion at another frame rate, by the rule of :func:`resampled`.

        The first frame is kept, or the last one (``to_end``). Unless frames are merely picked, jumps of angles are
        removed first (:meth:`continuous`).
        """
        if not isinstance(fps, int | float | np.number) or not 0 < fps < np.inf:
            raise MotionError(f"the frame rate must be a positive number, not {fps!r}")
        if fps == self.fps:
            return self
        # no more than memory holds
        ratio = self.fps / fps
        if self.values.size / ratio > 2**28:  # 2 GiB, six hours of a hundred channels at 120 fps
            raise MotionError(f"{self.duration:g} s at {fps:g} fps is too many frames")
        log.debug("resampling %r to %g fps", self, fps)
        source = self if is_whole(ratio) else self.continuous()
        return replace(self, values=resampled(source.values, ratio, to_end), fps=fps)

    def continuous(self) -> "Motion":
        """The same poses with angles that do not jump between frames.

        Euler angles change by whole turns and gimbal flips, forward from the first frame; exponential maps ("JOINT.ex",
        "JOINT.ey", "JOINT.ez") by whole turns, backward from the last one.
        """
        values = np.array(self.values)
        turns = np.array([TURN.get(unit, np.inf) for unit in self.units])

        # three angles of a joint change together; those of joints with fewer, or without a skeleton, one by one
        triples, singles = self._euler_columns()
        if triples:
            values[:, triples] = continuous_euler(values[:, triples], turns[triples])
        if singles:
            values[:, singles] = without_turns(values[:, singles], turns[singles])

        # exponential maps
        maps = [columns for columns in self.rotation_columns("e").values() if len(columns) == 3]
        if maps:
            radians = 2 * np.pi / turns[maps]
            values[:, maps] = continuous_rotvec(values[:, maps] * radians) / radians
        return replace(self, values=values)

    def _euler_columns(self) -> tuple[list[list[int]], list[int]]:
        """The columns of joints with three Euler angles, three each in the joint's order, and those of all others."""
        triples = []
        singles = []
        for name, columns in self.rotation_columns().items():
            if self.skeleton is not None and len(columns) == 3 and name in self.skeleton.places:
                order = self.skeleton.joints[self.skeleton.places[name]].order
                triples.append([columns["xyz".index(axis)] for axis in order])
            else:
                singles += columns
        return triples, singles

    def rotation_columns(self, letter: str = "r") -> Mapping[str, list[int]]:
        """The columns, in the order x, y, z, of each joint with Euler angles ("r") or an exponential map ("e")."""
        return _rotation_columns(self.channels, self.units, letter)


@lru_cache(maxsize=64)
def _check_channels(channels: Names, units: Names) -> None:
    """MotionError for names that are not unique, and units that are unknown or not one for each."""
    if len(set(channels)) != len(channels):
        raise MotionError("channel names must be unique")
    if len(units) != len(channels) or set(units) - set(UNITS):
        raise MotionError(f"a motion needs one unit per channel, from {', '.join(UNITS)}")


@lru_cache(maxsize=64)
def _places(channels: Names) -> Mapping[str, int]:
    """The column of each channel."""
    return {name: column for column, name in enumerate(channels)}


@lru_cache(maxsize=64)
def _rotation_columns(channels: Names, units: Names, letter: str) -> Mapping[str, list[int]]:
    columns_of: dict[str, list[int]] = {}
    for column in sorted(range(len(channels)), key=lambda column: channels[column][-2:]):
        joint, _, kind = channels[column].rpartition(".")
        if kind in (f"{letter}x", f"{letter}y", f"{letter}z") and units[column] in TURN:
            columns_of.setdefault(joint, []).append(column)
    return columns_of


def rest_motion(skeleton: Skeleton) -> Motion:
    """One frame, of 1/30 s, of a skeleton with every angle 0."""
    return Motion(np.zeros((1, 0)), (), (), 30.0, skeleton)


def is_whole(ratio: float) -> bool:
    """Whether a ratio of frame rates is a whole number but for rounding, so that frames can be picked."""
    return abs(ratio - round(ratio)) < 1e-9 and ratio > 0.5


def resampled(values: Array, ratio: float, to_end: bool = False) -> Array:
    """Values (T, ...) at every ``ratio``-th frame, from the first; the ratio need not be whole.

    Nothing is extrapolated past the last frame: floor((T - 1) / ratio) + 1 frames. Whole ratios pick every n-th frame;
    otherwise lower rates interpolate linearly, and higher ones by Catmull-Rom splines, smoothly through every frame.
    to_end: keep the last frame instead of the first; the remainder is dropped at the start.
    """
    frames = len(values)
    if is_whole(ratio):
        step = round(ratio)
        return values[(frames - 1) % step if to_end and frames else 0 :: step]
    count = int((frames - 1) / ratio + 1e-9) + 1 if frames else 0
    # at the times of the new frames, counted in old ones
    times: Array = np.arange(count, dtype=np.float64) * ratio
    if to_end and frames:
        times = frames - 1 - times[::-1]
    return spline(values, times) if ratio < 1 else lines(values, times)


def lines(values: Array, times: Array) -> Array:
    """Values (S, ...) on the lines between the frames of ``values`` (T, ...), at times (S,) counted in frames."""
    if len(values) < 2:
        return np.repeat(values[:1], len(times), axis=0)
    start, part = _between(values, times)
    return values[start] + part * (values[start + 1] - values[start])


def spline(values: Array, times: Array) -> Array:
    """Like :func:`lines`, on Catmull-Rom splines."""
    if len(values) < 2:
        return np.repeat(values[:1], len(times), axis=0)
    # a cubic between the second and the third of four frames (Catmull and Rom 1974)
    padded = _extended(values)
    start, s = _between(values, times)
    a = padded[start]
    b = padded[start + 1]
    c = padded[start + 2]
    d = padded[start + 3]
    return b + 0.5 * s * (c - a + s * (2 * a - 5 * b + 4 * c - d + s * (3 * (b - c) + d - a)))


def _extended(values: Array) -> Array:
    """Values (T + 2, ...) with one more frame at each end, on the parabola through the three nearest, or the line
    through two."""
    near = np.array([3.0, -3.0, 1.0] if len(values) > 2 else [2.0, -1.0])
    before = np.tensordot(near, values[: len(near)], 1)
    after = np.tensordot(near, values[: -len(near) - 1 : -1], 1)
    return np.concatenate([before[None], values, after[None]])


def _between(values: Array, times: Array) -> tuple[Indices, Array]:
    """For each time the frame before it, and the fraction of the way to the next one (S, 1, ...)."""
    # a time that equals a frame up to rounding is that frame
    start = np.minimum((times + 1e-9).astype(np.intp), len(values) - 2)
    return start, (times - start).reshape(-1, *[1] * (values.ndim - 1))


def motions_of(source: Motion | Iterable[Motion]) -> list[Motion]:
    """A motion, or several, as a list; ArgumentError for anything else."""
    motions = []
    for motion in source if is_many(source) and not isinstance(source, Motion) else [source]:
        if not isinstance(motion, Motion):
            remedy = ": motet.read() reads a file" if isinstance(motion, str | PathLike) else ""
            raise ArgumentError(f"expected a motion, not {quoted(repr(motion))}{remedy}")
        motions.append(motion)
    return motions


def with_frames(motion: Motion) -> Motion:
    """A motion; ArgumentError if it is none, MotionError if it has no frames."""
    motions_of([motion])
    if not len(motion):
        raise MotionError("the motion has 0 frames")
    return motion


def is_many(source: object) -> bool:
    """Whether something is several things, and no text."""
    return isinstance(source, Iterable) and not isinstance(source, str | bytes)
