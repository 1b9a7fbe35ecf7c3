"""Where feet are most likely to drag: slow walks with the facing kept, turns on the spot, a stick that is thrown about;
and whether stops end in balance, and figures that stand are alive."""

from collections.abc import Iterator

import numpy as np

from motet.figures.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import Flags, length, mean_and_tail, slides, spells
from motet_train.evaluate.steer.following import SETTLE, TRAVEL_DIRECTIONS, Track, floats, way_off
from motet_train.evaluate.steer.players import COMMANDS_SEED

SIDE_STEPS = (0.1, 0.2, 0.3, 0.4, 0.5)
"""m/s of slow walks in all directions."""

SLOW_SECONDS = 6.0
"""How long they are measured."""

DRAG_SPEED = 0.15
"""m/s above which a foot moves."""

DRAG_HEIGHT = 0.01
"""Metres of the ball of a foot below which one that moves drags."""

STANCE_HEIGHT = 0.035
"""Metres of the lowest point of a sole below which it stands, as seen from outside."""

STANCE_SPEED = 1.2
"""m/s of that point below which it does."""

SPOT_TURNS = (30.0, 45.0, 90.0, 135.0, 180.0)
"""Degrees of turns on the spot, to both sides."""

WILD_FIGURES = 20
"""Figures that a wild stick steers, and as many with a facing that is not where they go."""

WILD_SECONDS = 60.0

RUNS_FROM = 1.95
"""m/s above which a wild stick makes a figure run, until it is below ``WALKS_BELOW``."""

WALKS_BELOW = 1.6

STICK_SHARE = 0.35
"""Share of what is left of its way by which a stick moves in a tick."""

STICK_TREMBLE = 0.01
"""Standard deviation of its tremble, m/s."""

STOPPED_AT = {"walk": 1.2, "run": 3.0}
"""m/s at which a gait is stopped."""

AFTER_STOP = 1.0
"""Seconds after a figure has come to rest, which is below ``RESTS_BELOW``, in m/s."""

RESTS_BELOW = 0.1

WATCHED_SECONDS = 60.0
"""How long figures that stand are measured."""


def slow_side_figures(model: SteerModel) -> dict[str, float]:
    """Walking in each of :data:`TRAVEL_DIRECTIONS` at each of :data:`SIDE_STEPS` with the facing kept.

    direction, direction_worst: degrees. drag: the share of ticks in which a foot moves over the ground with its ball
    less than a centimetre above it. lift_cm: how high the soles of the foot that is lifted least are lifted.
    slide_cm, slide_p95_cm: of the balls, as seen from outside.
    """
    directions = np.tile(TRAVEL_DIRECTIONS, len(SIDE_STEPS))
    speeds = np.repeat(SIDE_STEPS, len(TRAVEL_DIRECTIONS))
    session = model.start("walk", characters=len(directions))
    session.control(speed=speeds, direction=directions, facing=0.0)
    track = _track(session, SETTLE, SLOW_SECONDS)
    gone = track.ground[-1, :, :2] - track.ground[0, :, :2]
    direction_errors = np.abs(way_off(gone, directions))
    lowest = _soles(track)[..., 1].min(axis=3)
    slide, slide_tail = mean_and_tail(_slides(track))
    return floats(
        {
            "direction": direction_errors.mean(),
            "direction_worst": direction_errors.max(),
            "drag": dragging(track).mean(),
            "lift_cm": 100 * lowest.max(axis=0).min(),
            "slide_cm": slide,
            "slide_p95_cm": slide_tail,
        }
    )


def spot_turn_figures(model: SteerModel) -> dict[str, float]:
    """The same measures of figures that stand and turn on the spot by :data:`SPOT_TURNS`."""
    angles = np.concatenate([SPOT_TURNS, np.negative(SPOT_TURNS)])
    session = model.start("walk", characters=len(angles))
    session.control(speed=0.0, facing=angles)
    track = _track(session, 0.0, SETTLE)
    slide, slide_tail = mean_and_tail(_slides(track))
    return floats({"drag": dragging(track).mean(), "slide_cm": slide, "slide_p95_cm": slide_tail})


def wild_stick_figures(model: SteerModel) -> dict[str, float]:
    """How far balls slide in a stance, cm, of figures whose walk or run follows a stick that is thrown about: mean and
    percentiles, of those that face where they go, and of those with a facing that turns by itself."""
    figures = dict[str, float]()
    for name, turns_by_itself in (("ahead", False), ("aside", True)):
        session = model.start("walk", characters=WILD_FIGURES)
        poses = list[Pose]()
        for gaits, velocity, facing in _wild_sticks(model.fps):
            session.control(gait=gaits, velocity=velocity, facing=facing if turns_by_itself else None)
            poses.append(session.tick())
        values = _slides(Track.of(poses, model.fps))
        mean, tail = mean_and_tail(values)
        largest = float(np.percentile(values, 99)) if len(values) else np.nan
        figures |= {f"{name}_cm": mean, f"{name}_p95_cm": tail, f"{name}_p99_cm": largest}
    return figures


def _wild_sticks(fps: float) -> Iterator[tuple[list[str], Array, Array]]:
    """Gaits, velocities (B, 2) and facings (B,) in degrees of each tick."""
    rng = np.random.default_rng(COMMANDS_SEED)
    goals = _wild_goals(rng, fps)
    stick = np.zeros((WILD_FIGURES, 2))
    runs = np.zeros(WILD_FIGURES, dtype=bool)
    for _ in range(round(WILD_SECONDS * fps)):
        goal, facing = next(goals)
        # it moves within some ticks, and trembles; near its middle it is at rest
        stick = stick + STICK_SHARE * (goal - stick)
        velocity = stick + rng.normal(0, STICK_TREMBLE, stick.shape)
        speeds = length(velocity)
        velocity[speeds < RESTS_BELOW] = 0
        runs = (speeds > RUNS_FROM) | (runs & (speeds >= WALKS_BELOW))
        yield np.where(runs, "run", "walk").tolist(), velocity, np.degrees(facing)


def _wild_goals(rng: np.random.Generator, fps: float) -> Iterator[tuple[Array, Array]]:
    """Where sticks are moved to in each tick, as velocities (B, 2), and facings (B,) that turn by themselves."""
    goal = np.zeros((WILD_FIGURES, 2))
    ticks_left, turn_rate, facing = np.zeros((3, WILD_FIGURES))
    while True:
        # after a third of a second to two seconds a stick goes elsewhere
        (draws,) = (ticks_left <= 0).nonzero()
        count = len(draws)
        angles = rng.uniform(-np.pi, np.pi, count)
        goal[draws] = (_wild_speeds(rng, count) * np.stack([np.sin(angles), np.cos(angles)])).T
        ticks_left[draws] = rng.uniform(10, 60, count)
        turn_rate[draws] = np.where(rng.random(count) < 0.6, 0.0, rng.normal(0, np.pi / 3, count))
        ticks_left -= 1
        facing = facing + turn_rate / fps
        yield goal, facing


def _wild_speeds(rng: np.random.Generator, count: int) -> Array:
    """Speeds (count,), m/s: a fifth to rest, others to a slow walk, a walk or a run."""
    kind = rng.random(count)
    slow = rng.uniform(0.12, 0.67, count)
    walk = rng.uniform(0.67, 1.9, count)
    run = rng.uniform(2, 4, count)
    return np.select([kind < 0.2, kind < 0.35, kind < 0.75], [np.zeros(count), slow, walk], run)


def stop_figures(model: SteerModel) -> dict[str, float]:
    """Stops from a walk and a run in each of :data:`TRAVEL_DIRECTIONS`, a second after figures have come to rest.

    lean, lean_worst: degrees from the vertical of the way from between the ankles to the neck. hips_cm, hips_worst_cm:
    from between the ankles to the hips over the ground. steps: of a foot in the nine seconds after, which nobody
    ordered.
    """
    tracks = [_stopped(model, gait, speed) for gait, speed in STOPPED_AT.items()]
    neck = np.concatenate([_after_stop(track, "neck") for track in tracks])
    lean = np.degrees(np.arctan2(length(neck[:, [0, 2]]), neck[:, 1]))
    hips = np.concatenate([_after_stop(track, "hips") for track in tracks])
    distance = 100 * length(hips[:, [0, 2]])
    return floats(
        {
            "lean": lean.mean(),
            "lean_worst": lean.max(),
            "hips_cm": distance.mean(),
            "hips_worst_cm": distance.max(),
            "steps": sum(_steps(track[-round(9 * track.fps) :]) for track in tracks),
        }
    )


def _stopped(model: SteerModel, gait: str, speed: float) -> Track:
    """Twelve seconds of figures that have just been told to stop."""
    session = model.start(gait, characters=len(TRAVEL_DIRECTIONS))
    session.control(gait=gait, speed=speed, direction=TRAVEL_DIRECTIONS)
    _track(session, SETTLE, 0.0)
    session.control(speed=0.0)
    return _track(session, 0.0, 12.0)


def _after_stop(track: Track, joint: str) -> Array:
    """The way (B, 3) from between the ankles to a joint, :data:`AFTER_STOP` seconds after each figure has come to
    rest, or of those that never do at the end."""
    moves = length(np.diff(track.ground[..., :2], axis=0)) * track.fps >= RESTS_BELOW
    stopped = len(moves) - moves[::-1].argmax(axis=0) + round(AFTER_STOP * track.fps)
    stopped = np.minimum(stopped, len(moves))
    left, right = (track.places[:, :, HUMANOID.index(sided(side, "Foot"))] for side in LEFT_RIGHT)
    ways = track.places[:, :, HUMANOID.index(joint)] - (left + right) / 2
    way: Array = ways[stopped, np.arange(len(stopped))]
    return way


def minute_figures(model: SteerModel) -> dict[str, float]:
    """How far hips, head and hands of a figure go in a minute of standing, cm, mean over figures of their largest
    distance from the mean; how far its feet go, the largest; and the steps that nobody ordered."""
    session = model.start("walk", characters=12)
    track = _track(session, SETTLE, WATCHED_SECONDS)
    joints = {"hips": ("hips",), "head": ("head",), "hands": ("leftHand", "rightHand")}
    figures = dict[str, float]()
    for name, members in joints.items():
        places = track.places[:, :, [HUMANOID.index(member) for member in members]]
        figures[f"{name}_cm"] = float(100 * length(places - places.mean(axis=0)).max(axis=0).mean())
    balls = _soles(track)[..., 1, :]
    figures["feet_cm"] = float(100 * length(balls - balls.mean(axis=0)).max())
    figures["steps"] = float(_steps(track))
    return figures


def dragging(track: Track) -> Flags:
    """Ticks (T - 1, B) in which the ball of a foot moves over the ground, less than a centimetre above it."""
    balls = _soles(track)[..., 1, :]
    speeds = length(np.diff(balls[..., [0, 2]], axis=0)) * track.fps
    drags = (speeds > DRAG_SPEED) & (balls[1:, ..., 1] < DRAG_HEIGHT)
    return np.asarray(drags.any(axis=2))


def _slides(track: Track) -> Array:
    """How far balls slide (N,), cm, in stances as seen from outside: runs of a tenth of a second or more in which the
    lowest point of a sole is low and slow, in the frames in which the ball is low."""
    # the lowest point of a sole bears the foot, and stands if it is low and hardly moves
    soles = _soles(track)
    lowest = soles[..., 1].argmin(axis=3)
    speeds = length(np.gradient(soles[..., [0, 2]], axis=0)) * track.fps
    bearing_speed = np.take_along_axis(speeds, lowest[..., None], axis=3)[..., 0]
    stands = (soles[..., 1].min(axis=3) < STANCE_HEIGHT) & (bearing_speed < STANCE_SPEED)
    # of the ball, where it is low in a stance
    stances = list[Array]()
    for figure, foot in np.ndindex(stands.shape[1:]):
        for start, stop in spells(stands[:, figure, foot]):
            ball = soles[start:stop, figure, foot, 1]
            low = ball[ball[:, 1] < STANCE_HEIGHT]
            if stop - start >= 0.1 * track.fps and len(low) >= 3:
                stances.append(low)
    return 100 * slides(stances)


def _steps(track: Track) -> int:
    """How many times a foot is lifted off the ground by 2 cm."""
    up = _soles(track)[..., 1].min(axis=3) > 0.02
    return int((up[1:] & ~up[:-1]).sum())


def _soles(track: Track) -> Array:
    """Points (T, B, 2, 3, 3) of the soles: heel, ball and tip of the left and the right foot."""
    return track.soles.reshape(*track.height.shape, 2, 3, 3)


def _track(session: SteerSession, wait: float, seconds: float) -> Track:
    """The track of a session's figures for some seconds after a wait."""
    fps = session.model.fps
    for _ in range(round(wait * fps)):
        session.tick()
    return Track.of([session.tick() for _ in range(max(1, round(seconds * fps)))], fps)
