"""How figures get to the end of paths with many corners, to near points slowly, and after points that move."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import Flags, length
from motet_train.evaluate.steer.commands import from_path
from motet_train.evaluate.steer.following import floats
from motet_train.evaluate.steer.players import COMMANDS_SEED

BATCH = 20
"""Figures of a session: few enough that each searches after a command, not in its turn."""

LEGS_OF_POLYLINE = 6
"""Straight parts of a random polyline."""

LEG_DEVIATION = 1.2
"""Standard deviation of x and z of a leg, metres."""

ZIGZAG = np.array([[0.0, 0.0], [0.0, 2.0], [0.5, 0.0], [1.0, 2.0], [1.5, 0.0], [2.0, 2.0]])
"""Corners of 166 degrees, which figures reach from :data:`FACINGS`."""

FACINGS = np.arange(0, 360, 45)
"""Degrees in which figures stand at first."""

CIRCLE_RADII = (0.5, 1.0, 2.0)
"""Metres of the circles."""

CIRCLE_POINTS = 40
"""Points of a circle."""

SLOW_SPEEDS = (0.2, 0.5)
"""m/s at which figures go to near points."""

NEAREST_POINT = 0.3
"""Metres to the nearest of these points."""

FARTHEST_POINT = 2.0
"""Metres to the farthest of them."""

CHASED_SPEED = 0.8
"""m/s of points that move on circles of 2 m."""

PATH_SECONDS = 40.0
"""Seconds that figures have to arrive."""


def path_figures(model: SteerModel, gait: str) -> dict[str, float]:
    """How figures that stand go along 40 random polylines, a zigzag and circles at a gait's usual speed.

    never: how many do not arrive in :data:`PATH_SECONDS` seconds. late_s, late_worst_s: seconds until they arrive, less
    those that the path takes at that speed: the mean of those that do, and the largest of all. cm, p95_cm: distances
    from the path until they arrive."""
    figures = dict[str, Any]()
    for kind, batches in _paths().items():
        walked = [_along(model, gait, paths) for paths in batches]
        lateness = np.concatenate([late for late, _ in walked])
        errors = 100 * np.concatenate([distances for _, distances in walked])
        figures |= {
            f"{kind}_never": np.isinf(lateness).sum(),
            f"{kind}_late_s": _mean_of_finite(lateness),
            f"{kind}_late_worst_s": lateness.max(),
            f"{kind}_cm": errors.mean(),
            f"{kind}_p95_cm": np.percentile(errors, 95),
        }
    return floats(figures)


def _paths() -> dict[str, list[Array]]:
    """Kind -> batches of paths (B, P, 2), from the origin."""
    rng = np.random.default_rng(COMMANDS_SEED)
    corners = [rng.normal(0, LEG_DEVIATION, (BATCH, LEGS_OF_POLYLINE, 2)).cumsum(axis=1) for _ in range(2)]
    angles = np.linspace(0, 2 * np.pi, CIRCLE_POINTS)
    circle = np.stack([1 - np.cos(angles), np.sin(angles)], axis=1)
    return {
        "polylines": [np.insert(paths, 0, 0.0, axis=1) for paths in corners],
        "zigzag": [np.tile(ZIGZAG, (len(FACINGS), 1, 1))],
        "circles": [np.tile(radius * circle, (len(FACINGS), 1, 1)) for radius in CIRCLE_RADII],
    }


def _mean_of_finite(values: Array) -> float:
    """The mean of the finite ones of values (N,), infinite if there are none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else np.inf


def _along(model: SteerModel, gait: str, paths: Array) -> tuple[Array, Array]:
    """How many seconds figures (B,) are late at the ends of paths (B, P, 2), infinite if they do not arrive; and the
    distances (N,) from the paths until they do, metres."""
    # all figures begin at the origin and go along their paths
    count = len(paths)
    facings = np.resize(FACINGS, count)
    session = model.start(gait, characters=count, places=np.column_stack([np.zeros((count, 2)), facings]))
    session.go_along(paths, gait=gait)
    places, arrived = _gone(session, model.fps)
    seconds = _arrival(arrived, model.fps)
    # what the length takes at the gait's usual speed, and how far they are from the path until they arrive
    usual = length(np.diff(paths, axis=1)).sum(axis=1) / model.usual[gait]
    distances = list[Array]()
    for figure, path in enumerate(paths):
        until = np.minimum(seconds[figure] * model.fps, len(places)).astype(int)
        distances.append(from_path(places[:until, figure], path))
    return seconds - usual, np.concatenate(distances)


def _gone(session: SteerSession, fps: float) -> tuple[Array, Flags]:
    """The places (T, B, 2) of figures until all have arrived, or for :data:`PATH_SECONDS` seconds; and which have (T,
    B)."""
    places = list[Array]()
    arrived = list[Flags]()
    for _ in range(round(PATH_SECONDS * fps)):
        places.append(session.tick().ground[:, :2])
        arrived.append(session.arrived)
        if np.any(arrived, axis=0).all():
            break
    return np.stack(places), np.stack(arrived)


def _arrival(arrived: Flags, fps: float) -> Array:
    """Seconds (B,) until figures have arrived (T, B), infinite for those that never have."""
    seconds: Array = np.where(arrived.any(axis=0), (arrived.argmax(axis=0) + 1) / fps, np.inf)
    return seconds


def slow_point_figures(model: SteerModel) -> dict[str, float]:
    """How figures that stand walk to near points all around at :data:`SLOW_SPEEDS` speeds.

    never: how many of 80 do not arrive in :data:`PATH_SECONDS` seconds. way, way_worst: how far they go, relative to
    the distance. long_way: of how many that is more than 1.5. late_s: seconds more than the distance takes."""
    rng = np.random.default_rng(COMMANDS_SEED)
    walked = [_to_near_points(model, speed, rng) for speed in np.repeat(SLOW_SPEEDS, 2).tolist()]
    lateness = np.concatenate([late for late, _ in walked])
    way = np.concatenate([relative for _, relative in walked])
    return floats(
        {
            "never": np.isinf(lateness).sum(),
            "way": way.mean(),
            "way_worst": way.max(),
            "long_way": (way > 1.5).sum(),
            "late_s": _mean_of_finite(lateness),
        }
    )


def _to_near_points(model: SteerModel, speed: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """How many seconds figures (B,) are late at points, infinite if they do not arrive; and how far they have gone
    (B,), relative to the distance."""
    angles = rng.uniform(-np.pi, np.pi, BATCH)
    distances = rng.uniform(NEAREST_POINT, FARTHEST_POINT, BATCH)
    places = np.column_stack([np.zeros((BATCH, 2)), rng.uniform(-180, 180, BATCH)])
    session = model.start("walk", characters=BATCH, places=places)
    session.go_to(np.stack([np.sin(angles), np.cos(angles)], axis=1) * distances[:, None], speed=speed)
    walked, arrived = _gone(session, model.fps)
    way = length(np.diff(walked, axis=0)).sum(axis=0) / distances
    return _arrival(arrived, model.fps) - distances / speed, way


def chase_figures(model: SteerModel) -> dict[str, float]:
    """behind_m, behind_worst_m: how far walking figures are behind points that move at :data:`CHASED_SPEED` m/s, to
    which they are sent anew in each tick, after the first 6 of 16 seconds."""
    starts = np.arange(8.0)
    rate = CHASED_SPEED / 2
    session = model.start("walk", characters=len(starts))
    distances = list[Array]()
    for tick in range(round(16 * model.fps)):
        points = _circling(starts + rate * tick / model.fps)
        session.go_to(points)
        distances.append(length(session.tick().ground[:, :2] - points))
    behind = np.stack(distances[round(6 * model.fps) :])
    return floats({"behind_m": behind.mean(), "behind_worst_m": behind.max()})


def _circling(angles: ArrayLike) -> Array:
    """Points (B, 2) at angles (B,) of a circle of 2 m."""
    points: Array = 2 * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    return points
