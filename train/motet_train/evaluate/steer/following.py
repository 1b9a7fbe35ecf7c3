"""What figures that are steered do, and whether they go where they are told: how soon, and how well.

All changes are measured from several phases of the stride: each figure goes on as it was told before for
:data:`SETTLE` seconds and a part of a second more, and is then told something else. What a figure does is seen in its
place over the ground and its facing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.figures.humanoid import sole_points
from motet.motion.rotations import Array, quat_to_rotmat, wrapped
from motet.representation.root_sixd import ROOT_SIXD
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet_train.data.matching_rows import MatchingRows
from motet_train.data.recorded import Recording
from motet_train.data.sixd_windows import poses_of
from motet_train.evaluate.positions import (
    BALLS,
    acceleration,
    arrival,
    length,
    mean_and_tail,
    running_mean,
    slide,
    slides,
    speed,
    spells,
    stances,
)

PHASES = 8
"""Times of a change, four ticks apart."""

SETTLE, STRAIGHT = 3.0, 10.0
"""Seconds before a change or a measurement, and of going straight on that are measured."""

MEASURED_SPEEDS = {"walk": 1.4, "run": 3.0}
"""m/s at which a gait is measured."""

PACES = (0.0, 0.6, 1.0, 1.4, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0)
"""Speeds in m/s between which is changed."""

WAYS = np.arange(-165.0, 195.0, 15.0)
"""24 directions of travel, in degrees from the facing."""

WAYS_PACES = {"walk": (0.8, 1.28), "run": (1.2, 2.0, 3.0)}
"""m/s at which a gait goes there."""

CREEPS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""The slowest speeds in m/s, at which a walk is measured."""

Asked = dict[str, Any]
"""What N figures are told: all that :meth:`SteerSession.control` takes of them."""

AHEAD: Asked = {"direction": 0.0, "facing": 0.0}


@dataclass(frozen=True, eq=False)
class Track:
    """B figures in T frames; metres, y up. ground: (T, B, 3) x, z and facing in radians, float64. rotations:
    (T, B, J, 4) quaternions (x, y, z, w) and height (T, B) as :class:`motet.steering.pose.Pose` has them."""

    ground: Array
    rotations: Floats
    height: Floats
    fps: float

    @staticmethod
    def of(poses: Sequence[Pose], fps: float) -> "Track":
        """What poses that follow each other show."""
        columns = ([getattr(pose, name) for pose in poses] for name in ("ground", "rotations", "height"))
        ground, rotations, height = map(np.stack, columns)
        return Track(ground, rotations, height, fps)

    def __len__(self) -> int:
        """T."""
        return len(self.ground)

    def __getitem__(self, frames: slice) -> "Track":
        """Some of the frames."""
        return Track(self.ground[frames], self.rotations[frames], self.height[frames], self.fps)

    def seen(self) -> "Track":
        """The same as the figures themselves see it: all at the origin, and facing z."""
        return replace(self, ground=np.zeros_like(self.ground))

    @cached_property
    def transforms(self) -> tuple[Floats, Array]:
        """Rotations (T, B, J', 4) and places (T, B, J', 3) of all joints of the humanoid in the world."""
        ground, rotations, height = _flat(self.ground), _flat(self.rotations), _flat(self.height)
        turned, places = Pose(ground, rotations, height, np.zeros((len(height), 2), np.float32)).global_transforms()
        return turned.reshape(*self.height.shape, -1, 4), places.reshape(*self.height.shape, -1, 3)

    @property
    def places(self) -> Array:
        """Places (T, B, J', 3) of all joints of the humanoid in the world."""
        return self.transforms[1]

    @cached_property
    def soles(self) -> Array:
        """Points (T, B, 6, 3): heel, ball and tip of the left sole, then of the right one."""
        turned, places = (_flat(part).astype(np.float64) for part in self.transforms)
        return sole_points(quat_to_rotmat(turned), places).reshape(*self.height.shape, -1, 3)


def tracks_of(found: Sequence[Recording], rows: MatchingRows) -> list[Track]:
    """What recordings show, each as one figure; ``rows`` are those of all of them."""
    tracks, start = [], 0
    for one in found:
        own = rows.poses[start : (start := start + len(one.features))].astype(np.float32)
        ground = poses_of(one.features.select(ROOT_SIXD).values, one.features.fps)[:, None]
        tracks.append(Track(ground, own[:, :-1].reshape(len(own), 1, -1, 4), own[:, -1:], one.features.fps))
    return tracks


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Values (T, B, ...) as (T B, ...)."""
    return values.reshape(-1, *values.shape[2:])


def stretches(track: Track, pace: float) -> list[Track]:
    """The parts of a recording, of a second at least, whose mean speed over half a second is within a fifth of
    ``pace``, m/s."""
    steps = length(np.gradient(track.ground[:, 0, :2], axis=0)).astype(np.float64) * track.fps
    paces = running_mean(steps, min(round(0.5 * track.fps), len(steps)))
    inside = spells(np.abs(paces - pace) <= 0.2 * pace)
    return [track[start:stop] for start, stop in inside if stop - start >= track.fps]


def standing(tracks: Sequence[Track]) -> dict[str, float]:
    """By the measures of :mod:`motet_train.evaluate.positions`: how far the balls of the feet and the points of the
    soles slide in a stance, cm; how fast the balls are while they stand, m/s; and the acceleration of all joints,
    m/s^2. Means over stances or frames, and of the balls' slide the 95th percentile."""
    stood, soles_stood, speeds, calm, frames = list[Array](), list[Array](), list[float](), list[float](), list[int]()
    for track in tracks:
        for figure in range(track.height.shape[1]):
            places, soles = (of[:, figure].astype(np.float64) for of in (track.places, track.soles))
            root = places[:, 0]
            stood += stances(places[:, BALLS], root, track.fps)
            soles_stood += stances(soles, root, track.fps)
            speeds.append(speed(places[:, BALLS], root, track.fps))
            calm.append(acceleration(places, root, track.fps))
            frames.append(len(places))
    mean, tail = mean_and_tail(100 * slides(stood))
    return {
        "slide_cm": mean,
        "slide_p95_cm": tail,
        "sole_slide_cm": 100 * slide(soles_stood),
        "toe_speed": _mean(speeds, frames),
        "acceleration": _mean(calm, frames),
    }


def slide_of(tracks: Sequence[Track]) -> dict[str, float]:
    """The part of :func:`standing` about how far the balls of the feet slide."""
    found = standing(tracks)
    return {name: found[name] for name in ("slide_cm", "slide_p95_cm")}


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """The weighed mean of the values that are numbers; NaN where none is."""
    known = np.array([pair for pair in zip(values, weights, strict=True) if np.isfinite(pair[0]) and pair[1]])
    return float(np.average(known[:, 0], weights=known[:, 1])) if len(known) else np.nan


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
        return np.where(self.pace(start, stop) > 0.05, np.abs(way_off(self.gone(start, stop), asked)), 180.0)

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
        return arrival(np.abs(way_off(steps, asked)) <= 10, self.fps) + half / self.fps


def way_off(velocity: Array, asked: Array) -> Array:
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
    mean degrees off, from 2 to 3 s after the change. slide_cm, slide_p95_cm: as :func:`standing` has them, in all turns
    and the seconds after them.
    """
    turns, calm = (45, 90, 135, 180), 0.5
    angles = np.array([side * turn for turn in turns for side in (1, -1)], dtype=np.float64)
    before = {**AHEAD, "gait": (gait,) * len(angles), "speed": pace}
    tracks = responses(model, before, {**before, "direction": angles, "facing": angles}, 4.0 + calm, hold_feet=True)
    ground, asked = Ground.of(tracks), np.tile(angles, PHASES)
    seconds = ground.seconds(asked, calm)
    way, facing = ground.way_off(asked, 2.0, 3.0), ground.facing_off(asked, 2.0, 3.0)
    found = slide_of(tracks)
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


def ways_errors(model: SteerModel, gait: str) -> dict[str, float]:
    """Going in each of :data:`WAYS` with the facing kept, at each of :data:`WAYS_PACES`, from standing and from going
    ahead as fast: degrees that the direction is off, a mean, the 95th percentile and the largest; degrees that the
    facing is off; the error of the speed, as a share of what the gait allows that way, and the least speed as such a
    share; from 2 to 6 s after the change. slide_cm, slide_p95_cm: as :func:`standing` has them, in all these seconds.
    """
    asked, paces, moves = (part.ravel() for part in np.meshgrid(WAYS, WAYS_PACES[gait], (0.0, 1.0)))
    before = {**AHEAD, "gait": (gait,) * len(asked), "speed": paces * moves}
    after = {**before, "speed": paces, "direction": asked}
    session = model.start(gait, characters=len(asked))
    session.control(**after)
    allowed = np.tile(length(session.target[:, :2]), PHASES)
    tracks = responses(model, before, after, 6.0, hold_feet=True)
    ground, asked = Ground.of(tracks), np.tile(asked, PHASES)
    way = ground.way_off(asked, 2.0, 6.0)
    found = {"direction": way.mean(), "direction_p95": np.percentile(way, 95), "direction_worst": way.max()}
    found["facing"] = ground.facing_off(np.zeros_like(asked), 2.0, 6.0).mean()
    share = ground.pace(2.0, 6.0) / allowed
    found |= {"speed": np.abs(share - 1).mean(), "speed_least": share.min()}
    return _floats(found | slide_of(tracks))


def creep_errors(model: SteerModel) -> dict[str, float]:
    """Walking ahead at each of :data:`CREEPS`, from standing and from walking: how far the speed is off, m/s, a mean
    and the largest, and slide_cm, slide_p95_cm as :func:`standing` has them; from 3 to 6 s after the change.
    """
    asked, start = (part.ravel() for part in np.meshgrid(CREEPS, (0.0, MEASURED_SPEEDS["walk"])))
    before = {**AHEAD, "gait": ("walk",) * len(asked), "speed": start}
    tracks = responses(model, before, {**before, "speed": asked}, 6.0, hold_feet=True)
    off = np.abs(Ground.of(tracks).pace(3.0, 6.0) - np.tile(asked, PHASES))
    settled = [track[round(3.0 * track.fps) :] for track in tracks]
    return _floats({"speed": off.mean(), "speed_worst": off.max(), **slide_of(settled)})


def _floats(found: Mapping[str, float]) -> dict[str, float]:
    return {name: float(value) for name, value in found.items()}
