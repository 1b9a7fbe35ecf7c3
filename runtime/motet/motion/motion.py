"""The motion: frames of named channels with units and a frame rate. Immutable, finite, never guessed."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from motet.errors import MotionError
from motet.motion.rotations import Array, continuous_euler
from motet.motion.skeleton import Skeleton

UNITS = ("deg", "rad", "length", "m", "deg/s", "rad/s", "m/s", "1")
"""Units a channel can have; "length" is the length unit of the skeleton, "1" a number without unit."""

TURN = {"deg": 360.0, "rad": 2 * np.pi}
"""A whole turn in each unit of angle."""


@dataclass(frozen=True, eq=False)
class Motion:
    """A motion of T frames and D channels.

    values: (T, D) float64, read-only. Any array is accepted and copied; NaN and infinity are refused.
    channels: D different names, "JOINT.rx" for an Euler angle about x, "JOINT.tx" for a translation along x.
    units: D units out of :data:`UNITS`.
    fps: frames per second.
    skeleton: what the channels move, or None.
    Raises MotionError where these do not fit together.
    """

    values: Array
    channels: tuple[str, ...]
    units: tuple[str, ...]
    fps: float
    skeleton: Skeleton | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", _frozen(self.values))
        object.__setattr__(self, "channels", tuple(self.channels))
        object.__setattr__(self, "units", tuple(self.units))
        object.__setattr__(self, "fps", float(self.fps))
        if self.values.ndim != 2 or self.values.shape[1] != len(self.channels):
            raise MotionError(f"values of shape {self.values.shape} do not fit {len(self.channels)} channels")
        if len(set(self.channels)) != len(self.channels):
            raise MotionError("channel names must differ")
        if len(self.units) != len(self.channels) or set(self.units) - set(UNITS):
            raise MotionError(f"a motion needs one unit for each channel, out of {', '.join(UNITS)}")
        if not (np.isfinite(self.fps) and self.fps > 0):
            raise MotionError(f"the frame rate must be a positive number, not {self.fps}")
        self._refuse_not_finite()

    def _refuse_not_finite(self) -> None:
        bad = np.argwhere(~np.isfinite(self.values))
        if len(bad):
            frame, channel = bad[0]
            place = f"frame {frame}, channel {self.channels[channel]!r} is {self.values[frame, channel]}"
            raise MotionError(f"{place}: {len(bad)} values are not finite")

    def __len__(self) -> int:
        return len(self.values)

    @property
    def duration(self) -> float:
        """Seconds: the number of frames over fps."""
        return len(self) / self.fps

    def __getitem__(self, frames: slice) -> "Motion":
        """The motion of a slice of its frames, with the frame rate divided by the slice's step."""
        step = frames.step or 1
        if step < 1:
            raise MotionError(f"frames are taken forward: a step of {step} is not possible")
        return replace(self, values=self.values[frames], fps=self.fps / step)

    def cut(self, start: float = 0.0, stop: float | None = None) -> "Motion":
        """The part from ``start`` to ``stop``, in seconds; MotionError outside of the motion."""
        stop = self.duration if stop is None else stop
        if not 0 <= start < stop <= self.duration + 0.5 / self.fps:
            raise MotionError(f"cannot cut {start:g} to {stop:g} s out of a motion of {self.duration:g} s")
        return self[round(start * self.fps) : round(stop * self.fps)]

    def select(self, channels: tuple[str, ...], units: tuple[str, ...] | None = None) -> "Motion":
        """The named channels in the order given, converted to ``units``; MotionError names those that lack."""
        missing = [name for name in channels if name not in self.channels]
        if missing:
            raise MotionError(f"the motion lacks {len(missing)} of {len(channels)} channels: {', '.join(missing)}")
        columns = [self.channels.index(name) for name in channels]
        units = units or tuple(self.units[column] for column in columns)
        factors = [self._factor(column, unit) for column, unit in zip(columns, units, strict=True)]
        return replace(self, values=self.values[:, columns] * factors, channels=channels, units=units)

    def _factor(self, column: int, unit: str) -> float:
        old = self.units[column]
        if old == unit:
            return 1.0
        if old in TURN and unit in TURN:
            return TURN[unit] / TURN[old]
        if {old, unit} == {"length", "m"} and self.skeleton is not None:
            metres = self.skeleton.unit_factor(1.0)
            return metres if unit == "m" else 1 / metres
        raise MotionError(f"channel {self.channels[column]!r} is in {old!r}, which does not convert to {unit!r}")

    def scaled(self, metres_per_unit: float) -> "Motion":
        """The same motion with skeleton and "length" channels in another length unit."""
        if self.skeleton is None:
            raise MotionError("a motion without a skeleton has no length unit to convert from")
        factor = self.skeleton.unit_factor(metres_per_unit)
        factors = [factor if unit == "length" else 1.0 for unit in self.units]
        return replace(self, values=self.values * factors, skeleton=self.skeleton.scaled(metres_per_unit))

    def with_unit(self, metres_per_unit: float) -> "Motion":
        """The same motion, its skeleton's length unit now known: for files that do not say it."""
        if self.skeleton is None:
            raise MotionError("a motion without a skeleton has no length unit")
        return replace(self, skeleton=replace(self.skeleton, metres_per_unit=metres_per_unit))

    def resample(self, fps: float) -> "Motion":
        """The motion at another frame rate, starting at the same frame and as long.

        Where the old rate is a multiple of the new one, frames are picked; else channels are interpolated linearly,
        Euler angles after their leaps are taken out (:meth:`continuous`).
        """
        if not (np.isfinite(fps) and fps > 0):
            raise MotionError(f"the frame rate must be a positive number, not {fps}")
        ratio = self.fps / fps
        if abs(ratio - round(ratio)) < 1e-9 and ratio > 0.5:
            return replace(self[:: round(ratio)], fps=fps)
        smooth = self.continuous().values
        old = np.arange(len(self)) / self.fps
        new = np.arange(max(1, round(len(self) / ratio)) if len(self) else 0) / fps
        columns = [np.interp(new, old, column) for column in smooth.T] if len(self) else []
        return replace(self, values=np.reshape(columns, (len(self.channels), len(new))).T, fps=fps)

    def continuous(self) -> "Motion":
        """The same poses with Euler angles that do not leap between frames (whole turns and gimbal flips)."""
        values = np.array(self.values)
        for joint, columns in self.rotation_columns().items():
            turns = [TURN[self.units[column]] for column in columns]
            order = self._order(joint)
            if len(columns) == 3 and order is not None:
                ordered = [columns["xyz".index(axis)] for axis in order]
                radians = values[:, ordered] * 2 * np.pi / turns
                values[:, ordered] = continuous_euler(radians) * turns / (2 * np.pi)
            else:
                for column, turn in zip(columns, turns, strict=True):
                    values[:, column] = np.unwrap(values[:, column], period=turn)
        return replace(self, values=values)

    def rotation_columns(self) -> dict[str, list[int]]:
        """For each joint with Euler channels their columns, in the order x, y, z."""
        found: dict[str, list[int]] = {}
        for column in sorted(range(len(self.channels)), key=lambda column: self.channels[column][-2:]):
            joint, _, kind = self.channels[column].rpartition(".")
            if kind in ("rx", "ry", "rz") and self.units[column] in TURN:
                found.setdefault(joint, []).append(column)
        return found

    def _order(self, joint: str) -> str | None:
        if self.skeleton is None or joint not in self.skeleton.names:
            return None
        return self.skeleton.joints[self.skeleton.index(joint)].order


def _frozen(values: ArrayLike) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise MotionError(f"the values of a motion must be numbers: {error}") from error
    array.flags.writeable = False
    return array
