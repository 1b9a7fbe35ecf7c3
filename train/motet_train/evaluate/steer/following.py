"""Whether figures go where they are told: how soon, and how well.

All changes are measured from several phases of the stride: each figure goes on as it was told before for
:data:`SETTLE` seconds and a part of a second more, and is then told something else. What a figure does is seen in its
place over the ground and its facing.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.models.steer import SteerModel
from motet.motion.rotations import Array, wrapped
from motet_train.evaluate.positions import arrival, length
from motet_train.evaluate.steer.track import Track, standing

PHASES = 8
"""Times of a change, four ticks apart."""

SETTLE, STRAIGHT = 3.0, 10.0
"""Seconds before a change or a measurement, and of going straight on that are measured."""

MEASURED_SPEEDS = {"walk": 1.4, "run": 3.0}
"""m/s at which a gait is measured."""

PACES = (0.0, 0.6, 1.0, 1.4, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0)
"""Speeds in m/s between which is changed."""


Asked = dict[str, Any]
"""What N figures are told: all that :meth:`SteerSession.control` takes of them."""

AHEAD: Asked = {"direction": 0.0, "facing": 0.0}


def straight_on(model: SteerModel, gait: str, hold_feet: bool) -> Track:
    """Six figures that go straight on, in different directions, at the speed of :data:`MEASURED_SPEEDS`."""
    session = model.start(gait, characters=6, hold_feet=hold_feet)
    session.control(speed=MEASURED_SPEEDS[gait], direction=np.arange(6) * 60.0)
    poses = [session.tick() for _ in range(round((SETTLE + STRAIGHT) * model.fps))]
    return Track.of(poses, model.fps)[round(SETTLE * model.fps) :]


def responses(model: SteerModel, before: Asked, after: Asked, seconds: float, hold_feet: bool = False) -> list[Track]:
    """What N figures do from the tick of a change on, for each phase."""
    tracks = []
    for phase in range(PHASES):
        session = model.start(characters=len(before["gait"]), hold_feet=hold_feet)
        session.control(**before)
        poses = [session.tick() for _ in range(round(SETTLE * model.fps) + 4 * phase)][-1:]
        session.control(**after)
        poses += [session.tick() for _ in range(round(seconds * model.fps))]
        tracks.append(Track.of(poses, model.fps))
    return tracks


@dataclass(frozen=True)
class Ground:
    """Places over the ground (T, B, 3), x, z and facing, of N figures of each phase."""

    places: Array
    fps: float

    @staticmethod
    def of(tracks: list[Track]) -> "Ground":
        """Those of :func:`responses`."""
        return Ground(np.concatenate([track.ground for track in tracks], axis=1).astype(np.float64), tracks[0].fps)

    def gone(self, start: float, stop: float) -> Array:
        """The mean velocity (B, 2) over the ground between two times."""
        first, last = round(start * self.fps), round(stop * self.fps)
        return (self.places[last, :, :2] - self.places[first, :, :2]) * self.fps / (last - first)

    def pace(self, start: float, stop: float) -> Array:
        """The mean speed (B,) between two times."""
        return length(self.gone(start, stop))

    def way_off(self, asked: Array, start: float, stop: float) -> Array:
        """By how many degrees (B,) figures go elsewhere than asked (B,), between two times; 180 for none that goes."""
        return np.where(self.pace(start, stop) > 0.05, np.abs(_off(self.gone(start, stop), asked)), 180.0)

    def facing_off(self, asked: Array, start: float, stop: float) -> Array:
        """By how many degrees (B,) figures face elsewhere than is asked (B,), in the mean between two times."""
        facing = self.places[round(start * self.fps) : round(stop * self.fps), :, 2]
        found: Array = np.abs(np.degrees(wrapped(facing - np.radians(asked))).mean(axis=0))
        return found

    def seconds(self, asked: Array, calm: float) -> Array:
        """Seconds (B,) until the direction of travel, a mean over ``calm`` seconds, is within 10 degrees of what is
        asked (B,), in degrees, and stays so to the end; infinite where it does not."""
        half = round(calm * self.fps / 2)
        steps = self.places[2 * half :, :, :2] - self.places[: -2 * half, :, :2]  # around ticks half, half + 1, ...
        return arrival(np.abs(_off(steps, asked)) <= 10, self.fps) + half / self.fps


def _off(velocity: Array, asked: Array) -> Array:
    """Degrees (..., B) from the directions asked (B,) to those of velocities (..., B, 2)."""
    found: Array = np.degrees(wrapped(np.arctan2(velocity[..., 0], velocity[..., 1]) - np.radians(asked)))
    return found


def gait_figures(model: SteerModel, gait: str) -> dict[str, float]:
    """How a gait stands, see :func:`standing`, with the foot lock, and without ("free")."""
    free = standing([straight_on(model, gait, False)])
    return standing([straight_on(model, gait, True)]) | {f"free_{name}": value for name, value in free.items()}


def speed_errors(model: SteerModel) -> dict[str, float]:
    """How far the speed is off, as a share of what was asked: the mean velocity from 1 to 2 s after a change between
    all pairs of :data:`PACES`, straight on; up to 1.8 m/s it is a walk, above a run. Mean, worst, the mean for each new
    speed; rest: m/s where 0 was asked.
    """
    old, new = np.array([(a, b) for a, b in product(PACES, PACES) if a != b]).T
    # who stands, stands in the gait that comes, and stops in the gait that was
    gaits = (np.where(own > 0, own, other) for own, other in ((old, new), (new, old)))
    before, after = (
        {**AHEAD, "gait": tuple("walk" if pace <= 1.8 else "run" for pace in own), "speed": speed}
        for own, speed in zip(gaits, (old, new), strict=True)
    )
    ground = Ground.of(responses(model, before, after, 2.0))
    off = np.abs(ground.pace(1.0, 2.0).reshape(PHASES, -1) - new) / np.where(new > 0, new, 1)
    moving, rest = off[:, new > 0], off[:, new == 0]
    found = {"mean": moving.mean(), "worst": moving.max(), "rest": rest.mean(), "rest_worst": rest.max()}
    return _floats(found | {f"to_{value:g}": off[:, new == value].mean() for value in PACES[1:]})


def turn_errors(model: SteerModel, gait: str, pace: float) -> dict[str, float]:
    """Turns by 45 to 180 degrees to both sides at a speed, and the facing with it.

    s: mean seconds until the direction of travel is there (:meth:`Ground.seconds`) in 4 s; worst_s. direction, facing:
    mean degrees off, from 2 to 3 s after the change. slide_cm: as :func:`standing` has it, in all turns and the seconds
    after them.
    """
    turns, calm = (45, 90, 135, 180), 0.5
    angles = np.array([side * turn for turn in turns for side in (1, -1)], dtype=np.float64)
    before = {**AHEAD, "gait": (gait,) * len(angles), "speed": pace}
    tracks = responses(model, before, {**before, "direction": angles, "facing": angles}, 4.0 + calm, hold_feet=True)
    ground, asked = Ground.of(tracks), np.tile(angles, PHASES)
    seconds = ground.seconds(asked, calm)
    way, facing = ground.way_off(asked, 2.0, 3.0), ground.facing_off(asked, 2.0, 3.0)
    found = {"slide_cm": standing(tracks)["slide_cm"]}
    for turn in turns:
        own: NDArray[np.bool_] = np.abs(asked) == turn
        found |= {f"s_{turn}": seconds[own].mean(), f"worst_s_{turn}": seconds[own].max()}
        found |= {f"direction_{turn}": way[own].mean(), f"facing_{turn}": facing[own].mean()}
    return _floats(found)


def aside_errors(model: SteerModel) -> dict[str, float]:
    """Side steps and walking backwards at 0.8 m/s, from standing and from walking: degrees that direction and facing
    are off, and the error of the speed as a share, from 2 to 4 s after the change."""
    ways, slowly = {"left": 90.0, "right": -90.0, "back": 180.0}, 0.8
    asked = np.repeat(list(ways.values()), 2)
    before = {**AHEAD, "gait": ("walk",) * len(asked), "speed": np.tile([0.0, 1.4], len(ways))}
    ground = Ground.of(responses(model, before, {**before, "speed": slowly, "direction": asked}, 4.0))
    asked = np.tile(asked, PHASES)
    off = {
        "direction": ground.way_off(asked, 2.0, 4.0),
        "facing": ground.facing_off(np.zeros_like(asked), 2.0, 4.0),
        "speed": np.abs(ground.pace(2.0, 4.0) / slowly - 1),
    }
    return _floats(
        {f"{name}_{key}": of[asked == angle].mean() for name, angle in ways.items() for key, of in off.items()}
    )


def _floats(found: Mapping[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in found.items()}
