"""How steered figures follow their commands: how soon, and how exactly.

All changes are measured from several phases of the stride: each figure follows one command for :data:`SETTLE` seconds
and a fraction of a second more, and then gets another. The measures use its place over the ground and its facing.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.figures.humanoid import sole_points
from motet.motion.rotations import Array, quat_to_rotmat, wrapped
from motet.representation.root_block import poses_of
from motet.representation.root_sixd import ROOT_SIXD
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.recorded import Recording
from motet.steering.rows import MatchingRows
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import (
    BALLS,
    Flags,
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
"""Times at which a command changes, four ticks apart."""

SETTLE = 3.0
"""Seconds before a change or a measurement."""

STRAIGHT_SECONDS = 10.0
"""Seconds for which going straight on is measured."""

MEASURED_SPEEDS = {"walk": 1.4, "run": 3.0}
"""m/s at which a gait is measured."""

CHANGED_SPEEDS = (0.0, 0.6, 1.0, 1.4, 1.8, 2.0, 2.5, 3.0, 3.5, 4.0)
"""Speeds in m/s of the changes in speed."""

FASTEST_WALK = 1.8
"""m/s of :data:`CHANGED_SPEEDS` up to which figures walk; above they run."""

TRAVEL_DIRECTIONS = np.arange(-165.0, 195.0, 15.0)
"""24 directions of travel, in degrees from the facing."""

WAYS_PACES = {"walk": (0.8, 1.28), "run": (1.2, 2.0, 3.0)}
"""m/s at which a gait goes in these directions."""

CREEPS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
"""The slowest measured speeds of a walk in m/s."""

MEASURED_TURNS = (45, 90, 135, 180)
"""Degrees of the measured turns, to both sides."""

SLOW_SIDE_STEP = 0.8
"""m/s of the measured side steps."""

Command = dict[str, Any]
"""A command to N figures: keyword arguments of :meth:`SteerSession.control`."""

STRAIGHT_AHEAD: Command = {"direction": 0.0, "facing": 0.0}


@dataclass(frozen=True, eq=False)
class Track:
    """B figures in T frames; metres, y up. ground: (T, B, 3) x, z and facing in radians, float64. rotations:
    (T, B, J, 4) quaternions (x, y, z, w) and height (T, B) as in :class:`motet.steering.pose.Pose`."""

    ground: Array
    rotations: Floats
    height: Floats
    fps: float

    @staticmethod
    def of(poses: Sequence[Pose], fps: float) -> "Track":
        """From consecutive poses."""
        ground = np.stack([pose.ground for pose in poses])
        rotations = np.stack([pose.rotations for pose in poses])
        height = np.stack([pose.height for pose in poses])
        return Track(ground, rotations, height, fps)

    def __len__(self) -> int:
        """T."""
        return len(self.ground)

    def __getitem__(self, frames: slice) -> "Track":
        """Some of the frames."""
        return Track(self.ground[frames], self.rotations[frames], self.height[frames], self.fps)

    def in_place(self) -> "Track":
        """The same in the figures' own space: all at the origin, facing z."""
        return replace(self, ground=np.zeros_like(self.ground))

    @cached_property
    def transforms(self) -> tuple[Floats, Array]:
        """Rotations (T, B, J', 4) and positions (T, B, J', 3) of all joints of the humanoid in the world."""
        # all figures and frames as one batch
        ground = _flat(self.ground)
        rotations = _flat(self.rotations)
        height = _flat(self.height)
        velocity = np.zeros((len(height), 2), np.float32)
        turned, places = Pose(ground, rotations, height, velocity).global_transforms()
        return turned.reshape(*self.height.shape, -1, 4), places.reshape(*self.height.shape, -1, 3)

    @property
    def places(self) -> Array:
        """Positions (T, B, J', 3) of all joints of the humanoid in the world."""
        return self.transforms[1]

    @cached_property
    def soles(self) -> Array:
        """Points (T, B, 6, 3): heel, ball and tip of the left sole, then of the right one."""
        turned, places = self.transforms
        matrices = quat_to_rotmat(_flat(turned).astype(np.float64))
        points = sole_points(matrices, _flat(places).astype(np.float64))
        return points.reshape(*self.height.shape, -1, 3)


def turns(track: Track) -> Array:
    """Degrees (T - 1, B, J) by which bones turn between frames, relative to their parents."""
    before = track.rotations[:-1].astype(np.float64)
    after = track.rotations[1:]
    # of the two quaternions of a rotation the nearer one
    signs = np.where((before * after).sum(axis=-1, keepdims=True) < 0, -1, 1)
    # half the chord between unit quaternions is the sine of a quarter of the angle
    half_chords = length(before - signs * after) / 2
    angles: Array = np.degrees(4 * np.arcsin(np.minimum(half_chords, 1)))
    return angles


def joint_steps(track: Track) -> Array:
    """Metres (T - 1, B, J') by which joints move between frames, in the figures' own space."""
    return length(np.diff(track.in_place().places, axis=0))


def tracks_of(recordings: Sequence[Recording], rows: MatchingRows) -> list[Track]:
    """The tracks of recordings, a figure each. rows: those of all recordings."""
    tracks = []
    start = 0
    for recording in recordings:
        features = recording.features
        stop = start + len(features)
        # the rows of this recording
        poses = rows.poses[start:stop].astype(np.float32)
        start = stop
        ground = poses_of(features.select(ROOT_SIXD).values, features.fps)[:, None]
        rotations = poses[:, :-1].reshape(len(poses), 1, -1, 4)
        tracks.append(Track(ground, rotations, poses[:, -1:], features.fps))
    return tracks


def _flat(values: NDArray[Any]) -> NDArray[Any]:
    """Values (T, B, ...) as (T B, ...)."""
    return values.reshape(-1, *values.shape[2:])


def stretches(track: Track, pace: float) -> list[Track]:
    """The parts of a recording of a second or more whose mean speed over half a second is within a fifth of ``pace``,
    m/s."""
    # the speed over the ground, smoothed
    steps = np.gradient(track.ground[:, 0, :2], axis=0)
    speeds = length(steps).astype(np.float64) * track.fps
    paces = running_mean(speeds, min(round(0.5 * track.fps), len(speeds)))

    # runs of frames near the pace
    near = np.abs(paces - pace) <= 0.2 * pace
    return [track[start:stop] for start, stop in spells(near) if stop - start >= track.fps]


def standing(tracks: Sequence[Track]) -> dict[str, float]:
    """By the measures of :mod:`motet_train.evaluate.positions`: how far the balls of the feet and the points of the
    soles slide in a stance, cm; how fast the balls move while they stand, m/s; and the acceleration of all joints,
    m/s^2. Means over stances or frames, and for the slide of the balls also the 95th percentile."""
    ball_stances = []
    sole_stances = []
    speeds = []
    accelerations = []
    frames = []
    # figure after figure
    for places, soles, fps in _figures(tracks):
        root = places[:, 0]
        ball_stances += stances(places[:, BALLS], root, fps)
        sole_stances += stances(soles, root, fps)
        speeds.append(speed(places[:, BALLS], root, fps))
        accelerations.append(acceleration(places, root, fps))
        frames.append(len(places))
    # over all figures
    mean, tail = mean_and_tail(100 * slides(ball_stances))
    return {
        "slide_cm": mean,
        "slide_p95_cm": tail,
        "sole_slide_cm": 100 * slide(sole_stances),
        "toe_speed": _mean(speeds, frames),
        "acceleration": _mean(accelerations, frames),
    }


def _figures(tracks: Sequence[Track]) -> Iterator[tuple[Array, Array, float]]:
    """The joints (T, J', 3), soles (T, 6, 3) and frame rate of each figure of all tracks."""
    for track in tracks:
        for figure in range(track.height.shape[1]):
            places = track.places[:, figure].astype(np.float64)
            soles = track.soles[:, figure].astype(np.float64)
            yield places, soles, track.fps


def slide_of(tracks: Sequence[Track]) -> dict[str, float]:
    """The figures of :func:`standing` for the slide of the balls of the feet."""
    figures = standing(tracks)
    return {name: figures[name] for name in ("slide_cm", "slide_p95_cm")}


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """The weighted mean of the finite values; NaN without any."""
    known = [pair for pair in zip(values, weights, strict=True) if np.isfinite(pair[0]) and pair[1]]
    if not known:
        return np.nan
    table = np.array(known)
    return float(np.average(table[:, 0], weights=table[:, 1]))


def straight_on(model: SteerModel, gait: str, hold_feet: bool) -> Track:
    """Six figures going straight on, in different directions, at the speed of :data:`MEASURED_SPEEDS`."""
    session = model.start(gait, characters=6, hold_feet=hold_feet)
    session.control(speed=MEASURED_SPEEDS[gait], direction=np.arange(6) * 60.0)
    poses = [session.tick() for _ in range(round((SETTLE + STRAIGHT_SECONDS) * model.fps))]
    return Track.of(poses, model.fps)[round(SETTLE * model.fps) :]


def settled(session: SteerSession, fps: float, phase: int) -> Pose:
    """The last pose before a change: let figures follow their command for :data:`SETTLE` seconds and a phase."""
    pose = session.tick()
    for _ in range(round(SETTLE * fps) + 4 * phase - 1):
        pose = session.tick()
    return pose


def responses(
    model: SteerModel, before: Command, after: Command, seconds: float, hold_feet: bool = False
) -> list[Track]:
    """The tracks of N figures from the tick of a change on, one for each phase."""
    tracks = []
    for phase in range(PHASES):
        session = model.start(characters=len(before["gait"]), hold_feet=hold_feet)
        session.control(**before)
        poses = [settled(session, model.fps, phase)]
        # the next pose is the first that follows the new command
        session.control(**after)
        poses += [session.tick() for _ in range(round(seconds * model.fps))]
        tracks.append(Track.of(poses, model.fps))
    return tracks


@dataclass(frozen=True)
class Ground:
    """Places over the ground (T, B, 3), x, z and facing, of N figures in each phase."""

    places: Array
    fps: float

    @staticmethod
    def of(tracks: list[Track]) -> "Ground":
        """From the tracks of :func:`responses`."""
        places = np.concatenate([track.ground for track in tracks], axis=1)
        return Ground(places.astype(np.float64), tracks[0].fps)

    def velocity(self, start: float, stop: float) -> Array:
        """The mean velocity (B, 2) over the ground between two times."""
        first = round(start * self.fps)
        last = round(stop * self.fps)
        return (self.places[last, :, :2] - self.places[first, :, :2]) * self.fps / (last - first)

    def pace(self, start: float, stop: float) -> Array:
        """The mean speed (B,) between two times."""
        return length(self.velocity(start, stop))

    def way_off(self, directions: Array, start: float, stop: float) -> Array:
        """Degrees (B,) between the commanded and the actual directions of travel (B,) between two times; 180 for a
        figure that does not go."""
        errors = np.abs(way_off(self.velocity(start, stop), directions))
        return np.where(self.pace(start, stop) > 0.05, errors, 180.0)

    def facing_off(self, facings: Array, start: float, stop: float) -> Array:
        """Degrees (B,) between the commanded facings (B,) and the mean facings between two times."""
        facing = self.places[round(start * self.fps) : round(stop * self.fps), :, 2]
        errors: Array = np.abs(np.degrees(wrapped(facing - np.radians(facings))).mean(axis=0))
        return errors

    def seconds(self, directions: Array, calm: float) -> Array:
        """Seconds (B,) until the direction of travel, averaged over ``calm`` seconds, is within 10 degrees of the
        commanded one (B,), in degrees, and stays there to the end; infinite if it never does."""
        half = round(calm * self.fps / 2)
        steps = self.places[2 * half :, :, :2] - self.places[: -2 * half, :, :2]  # around ticks half, half + 1, ...
        inside = np.abs(way_off(steps, directions)) <= 10
        return arrival(inside, self.fps) + half / self.fps


def way_off(velocity: Array, directions: Array | Floats) -> Array:
    """Degrees (..., B) from commanded directions (B,) to those of velocities (..., B, 2)."""
    angles = np.arctan2(velocity[..., 0], velocity[..., 1])
    errors: Array = np.degrees(wrapped(angles - np.radians(directions)))
    return errors


def gait_figures(model: SteerModel, gait: str) -> dict[str, float]:
    """The figures of :func:`standing` of a gait with the foot lock, and without it ("free")."""
    free = standing([straight_on(model, gait, False)])
    locked = standing([straight_on(model, gait, True)])
    return locked | {f"free_{name}": value for name, value in free.items()}


def speed_errors(model: SteerModel) -> dict[str, float]:
    """Relative errors of the speed: the mean velocity from 1 to 2 s after a change between all pairs of
    :data:`CHANGED_SPEEDS`, straight on, as a walk up to :data:`FASTEST_WALK` and as a run above. Mean, worst, and the
    mean for each new speed; rest: m/s where 0 was commanded."""
    old, new = np.array([(old, new) for old, new in product(CHANGED_SPEEDS, CHANGED_SPEEDS) if old != new]).T
    # a figure stands in the gait that follows, and stops in the gait that it was in
    before = {**STRAIGHT_AHEAD, "gait": _gaits(np.where(old > 0, old, new)), "speed": old}
    after = {**STRAIGHT_AHEAD, "gait": _gaits(np.where(new > 0, new, old)), "speed": new}
    paces = Ground.of(responses(model, before, after, 2.0)).pace(1.0, 2.0)

    # relative to the new speed, or in m/s where figures stop
    errors = np.abs(paces.reshape(PHASES, -1) - new) / np.where(new > 0, new, 1)
    return floats(_speed_figures(errors, new))


def _speed_figures(errors: Array, new: Array) -> dict[str, float]:
    """Means and maxima of errors (P, N) by the new speeds (N,)."""
    moving = errors[:, new > 0]
    rest = errors[:, new == 0]
    figures = {"mean": moving.mean(), "worst": moving.max(), "rest": rest.mean(), "rest_worst": rest.max()}
    for pace in CHANGED_SPEEDS[1:]:
        figures[f"to_{pace:g}"] = errors[:, new == pace].mean()
    return figures


def _gaits(paces: Array) -> tuple[str, ...]:
    return tuple("walk" if pace <= FASTEST_WALK else "run" for pace in paces)


def turn_errors(model: SteerModel, gait: str, pace: float) -> dict[str, float]:
    """Turns by 45 to 180 degrees to both sides at a speed, with the facing.

    s: mean seconds until the direction of travel is reached (:meth:`Ground.seconds`) in 4 s; worst_s. direction,
    facing: mean errors in degrees, from 2 to 3 s after the change. slide_cm, slide_p95_cm: see :func:`standing`, in all
    turns and the seconds after them.
    """
    # each turn to the left and to the right, half a second longer than is measured
    calm = 0.5
    angles = np.array([side * turn for turn, side in product(MEASURED_TURNS, (1, -1))], dtype=np.float64)
    before = {**STRAIGHT_AHEAD, "gait": (gait,) * len(angles), "speed": pace}
    after = {**before, "direction": angles, "facing": angles}
    tracks = responses(model, before, after, 4.0 + calm, hold_feet=True)
    turned = _turn_figures(Ground.of(tracks), np.tile(angles, PHASES), calm)
    return floats(slide_of(tracks) | turned)


def _turn_figures(ground: Ground, angles: Array, calm: float) -> dict[str, float]:
    seconds = ground.seconds(angles, calm)
    direction_errors = ground.way_off(angles, 2.0, 3.0)
    facing_errors = ground.facing_off(angles, 2.0, 3.0)
    figures = {}
    for turn in MEASURED_TURNS:
        turned: Flags = np.abs(angles) == turn
        figures[f"s_{turn}"] = seconds[turned].mean()
        figures[f"worst_s_{turn}"] = seconds[turned].max()
        figures[f"direction_{turn}"] = direction_errors[turned].mean()
        figures[f"facing_{turn}"] = facing_errors[turned].mean()
    return figures


def aside_errors(model: SteerModel) -> dict[str, float]:
    """Side steps and walking backwards at :data:`SLOW_SIDE_STEP`, from standing and from walking: errors of direction
    and facing in degrees, and the relative error of the speed, from 2 to 4 s after the change."""
    ways = {"left": 90.0, "right": -90.0, "back": 180.0}
    directions = np.repeat(list(ways.values()), 2)
    before = {**STRAIGHT_AHEAD, "gait": ("walk",) * len(directions), "speed": np.tile([0.0, 1.4], len(ways))}
    after = {**before, "speed": SLOW_SIDE_STEP, "direction": directions}
    ground = Ground.of(responses(model, before, after, 4.0))

    # the figures of each phase follow those of the one before
    directions = np.tile(directions, PHASES)
    errors = {
        "direction": ground.way_off(directions, 2.0, 4.0),
        "facing": ground.facing_off(np.zeros_like(directions), 2.0, 4.0),
        "speed": np.abs(ground.pace(2.0, 4.0) / SLOW_SIDE_STEP - 1),
    }
    figures = {}
    for way, angle in ways.items():
        for key, values in errors.items():
            figures[f"{way}_{key}"] = values[directions == angle].mean()
    return floats(figures)


def ways_errors(model: SteerModel, gait: str) -> dict[str, float]:
    """Going in each of :data:`TRAVEL_DIRECTIONS` with the facing kept, at each of :data:`WAYS_PACES`, from standing and
    from going ahead at the same speed: the error of the direction in degrees, its mean, 95th percentile and maximum;
    the error of the facing in degrees; the error of the speed relative to the fastest that the gait allows in that
    direction, and the lowest speed relative to it; from 2 to 6 s after the change. slide_cm, slide_p95_cm: see
    :func:`standing`, in all these seconds."""
    grid = np.meshgrid(TRAVEL_DIRECTIONS, WAYS_PACES[gait], (0.0, 1.0))
    directions, paces, moving = (part.ravel() for part in grid)

    # from standing, and from going ahead at the same speed
    before = {**STRAIGHT_AHEAD, "gait": (gait,) * len(directions), "speed": paces * moving}
    after = {**before, "speed": paces, "direction": directions}

    # the speed that a gait allows in each direction
    session = model.start(gait, characters=len(directions))
    session.control(**after)
    allowed = length(session.target[:, :2])
    tracks = responses(model, before, after, 6.0, hold_feet=True)
    errors = _way_figures(Ground.of(tracks), np.tile(directions, PHASES), np.tile(allowed, PHASES))
    return floats(errors | slide_of(tracks))


def _way_figures(ground: Ground, directions: Array, allowed: Array) -> dict[str, float]:
    direction_errors = ground.way_off(directions, 2.0, 6.0)
    facing_errors = ground.facing_off(np.zeros_like(directions), 2.0, 6.0)
    relative_speed = ground.pace(2.0, 6.0) / allowed
    return {
        "direction": direction_errors.mean(),
        "direction_p95": np.percentile(direction_errors, 95),
        "direction_worst": direction_errors.max(),
        "facing": facing_errors.mean(),
        "speed": np.abs(relative_speed - 1).mean(),
        "speed_least": relative_speed.min(),
    }


def creep_errors(model: SteerModel) -> dict[str, float]:
    """Walking ahead at each of :data:`CREEPS`, from standing and from walking: the error of the speed, m/s, its mean
    and maximum, and slide_cm, slide_p95_cm, see :func:`standing`; from 3 to 6 s after the change.
    """
    grid = np.meshgrid(CREEPS, (0.0, MEASURED_SPEEDS["walk"]))
    speeds, old_speeds = (part.ravel() for part in grid)
    before = {**STRAIGHT_AHEAD, "gait": ("walk",) * len(speeds), "speed": old_speeds}
    tracks = responses(model, before, {**before, "speed": speeds}, 6.0, hold_feet=True)

    # once figures have had time to slow down
    errors = np.abs(Ground.of(tracks).pace(3.0, 6.0) - np.tile(speeds, PHASES))
    last_seconds = [track[round(3.0 * track.fps) :] for track in tracks]
    return floats({"speed": errors.mean(), "speed_worst": errors.max(), **slide_of(last_seconds)})


def floats(figures: Mapping[str, float]) -> dict[str, float]:
    """Figures as Python's floats."""
    return {name: float(value) for name, value in figures.items()}
