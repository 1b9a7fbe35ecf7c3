"""Crowds that meet: how near figures come to each other, and whether they arrive, with and without keeping apart."""

from collections.abc import Callable, Mapping

import numpy as np

from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.session import SteerSession
from motet_train.evaluate.positions import length
from motet_train.evaluate.steer.following import floats

CROWD_SEEDS = (51, 52, 53, 54, 55)
"""Of the places where figures begin; they chose no setting."""

CROWD_SECONDS = 30.0
"""How long a crowd is looked at."""

ROOM = 0.8
"""Metres that figures are to keep."""

NEAR = 0.4
"""Metres below which two bodies touch."""

CROSSING_FIGURES = 40
"""Figures on a circle, each of which goes to the other side."""

CIRCLE = (6.0, 7.0)
"""Radii between which they begin, metres."""

JITTER = 0.25
"""Largest deviation of a figure in a stream along x and z, metres."""

FILES = np.array([-1.5, 0.0, 1.5])
"""x of the files of each stream."""

RANK_DISTANCES = np.arange(3.0, 12.0, 1.8)
"""Distances of the ranks of each stream from the middle, metres."""


def _crossing(rng: np.random.Generator) -> Array:
    """Places (B, 2) all around the origin, 82 cm apart at least."""
    angles = np.arange(CROSSING_FIGURES) * 2 * np.pi / CROSSING_FIGURES + rng.uniform(-0.01, 0.01, CROSSING_FIGURES)
    radii = rng.uniform(*CIRCLE, CROSSING_FIGURES)
    places: Array = radii[:, None] * np.stack([np.sin(angles), np.cos(angles)], axis=1)
    return places


def _streams(rng: np.random.Generator) -> Array:
    """Places (B, 2) of two groups in files, a metre apart at least."""
    x, z = np.meshgrid(FILES, RANK_DISTANCES)
    group = np.column_stack([x.ravel(), z.ravel()])
    places = np.concatenate([group, -group])
    deviation: Array = rng.uniform(-JITTER, JITTER, places.shape)
    return places + deviation


CROWDS: Mapping[str, tuple[Callable[[np.random.Generator], Array], Array]] = {
    "crossing": (_crossing, np.array([-1.0, -1.0])),
    "streams": (_streams, np.array([1.0, -1.0])),
}
"""Name -> where figures begin, and what each place is multiplied by to get where that figure goes."""


def crowd_figures(model: SteerModel, crowd: str) -> dict[str, float]:
    """Figures of :data:`CROWDS` that walk to their points, for each of :data:`CROWD_SEEDS` and each of
    :data:`CROWD_SECONDS` seconds.

    near: the share of the time in which two are nearer than :data:`NEAR`; near_worst: of the worst seed. nearest_m:
    the smallest distance. never: how many do not arrive, of all seeds. s: mean seconds until the others do. Those
    without "free" keep :data:`ROOM`.
    """
    kept = _figures(model, crowd, ROOM)
    free = _figures(model, crowd, None)
    return floats(kept | {f"free_{name}": value for name, value in free.items()})


def _figures(model: SteerModel, crowd: str, room: float | None) -> dict[str, float]:
    nearest = list[Array]()
    seconds = list[Array]()
    for seed in CROWD_SEEDS:
        distances, arrival = _met(model, crowd, room, np.random.default_rng(seed))
        nearest.append(distances)
        seconds.append(arrival)
    near = (np.stack(nearest) < NEAR).mean(axis=1)
    arrivals = np.concatenate(seconds)
    arrived = np.isfinite(arrivals)
    return {
        "near": near.mean(),
        "near_worst": near.max(),
        "nearest_m": np.min(nearest),
        "never": (~arrived).sum(),
        "s": arrivals[arrived].mean() if arrived.any() else np.inf,
    }


def _met(model: SteerModel, crowd: str, room: float | None, rng: np.random.Generator) -> tuple[Array, Array]:
    """The distances (T,) of the two figures that are nearest to each other in each tick, and the seconds (B,) until
    figures arrive, infinite for those that do not."""
    session = _begun(model, crowd, rng)
    session.keep_apart(room)
    distances = list[float]()
    arrival = np.full(session.characters, np.inf)
    for tick in range(round(CROWD_SECONDS * model.fps)):
        distances.append(_smallest_distance(session.tick().ground[:, :2]))
        arrival = np.where(session.arrived, np.minimum(arrival, (tick + 1) / model.fps), arrival)
    return np.array(distances), arrival


def _begun(model: SteerModel, crowd: str, rng: np.random.Generator) -> SteerSession:
    """Figures of a crowd that begin to go, each facing its point."""
    begins, mirrors = CROWDS[crowd]
    places = begins(rng)
    points = mirrors * places
    x, z = (points - places).T
    facings = np.degrees(np.arctan2(x, z))
    session = model.start("walk", characters=len(places), places=np.column_stack([places, facings]))
    session.go_to(points)
    return session


def _smallest_distance(places: Array) -> float:
    """The distance of the two of places (B, 2) that are nearest to each other."""
    first, second = np.triu_indices(len(places), 1)
    return float(length(places[first] - places[second]).min())
