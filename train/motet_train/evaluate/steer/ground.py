"""Figures on ground that is not flat: whether feet stand on it and stay, and legs and hips move as legs and hips do."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet.steering.pose import Pose
from motet.steering.terrain import TerrainSettings
from motet_train.evaluate.positions import mean_and_tail, slides, stances
from motet_train.evaluate.steer.following import MEASURED_SPEEDS, SETTLE, Track, turns

GROUND_SEED = 4
"""Of the places where figures begin; it chose no setting."""

GROUND_FIGURES = 12
"""Figures side by side, a metre apart."""

GROUND_SECONDS = 6.0
"""How long they go up, down or across."""

GENTLE = float(np.tan(np.radians(20)))
"""Rise of the slopes in a metre."""

RISER = 0.17
TREAD = 0.29
"""Height and depth of the steps of stairs, metres."""


def _stairs(x: Array, z: Array) -> Array:
    return RISER * np.floor(z / TREAD)


GROUNDS: Mapping[str, Callable[[Array, Array], Array]] = {
    "flat": lambda x, z: 0 * x,
    "flat_slow": lambda x, z: 0 * x,
    "up": lambda x, z: GENTLE * z,
    "down": lambda x, z: -GENTLE * z,
    "across": lambda x, z: GENTLE * x,
    "stairs_up": _stairs,
    "stairs_down": lambda x, z: -_stairs(x, z),
}
"""Heights at places x and z of figures that go along z; on the slow plane as fast as uphill."""

UPHILL_SHARE = 1 / (1 + TerrainSettings().uphill * GENTLE)
"""Share of its speed that a figure has uphill."""


def ground_figures(model: SteerModel, ground: str, gait: str) -> dict[str, float]:
    """Figures that go straight on over ground in a gait, at the speed of :data:`MEASURED_SPEEDS`, less uphill.

    off_cm, off_p95_cm: how far the lowest point of a sole is from the ground while its contact is above a half, which
    includes the begin of leaving it. slide_cm, slide_p95_cm: of heels, balls and tips in their stances. turn: the
    largest turn of a joint in a tick, degrees. hips: the largest acceleration of the hips up or down, m/s^2.
    """
    height = GROUNDS[ground]
    share = UPHILL_SHARE if ground == "flat_slow" else 1
    poses = _poses(model, height, gait, share * MEASURED_SPEEDS[gait])
    track = Track.of(poses, model.fps)
    # heights above the ground, and how far feet that stand are from it
    soles = track.soles.astype(np.float64)
    above = soles[..., 1] - height(soles[..., 0], soles[..., 2])
    off, off_p95 = mean_and_tail(100 * _off(poses, above))
    slide, slide_p95 = mean_and_tail(100 * slides(_stances(track, soles, above)))
    # and how the hips go up and down
    jolts = np.diff(track.height.astype(np.float64), 2, axis=0) * model.fps**2
    return {
        "off_cm": off,
        "off_p95_cm": off_p95,
        "slide_cm": slide,
        "slide_p95_cm": slide_p95,
        "turn": float(turns(track).max()),
        "hips": float(np.abs(jolts).max()),
    }


def _off(poses: Sequence[Pose], above: Array) -> Array:
    """How far (N,) the lowest points of feet that stand are from the ground, of heights (T, B, 6) above it."""
    stands = np.stack([pose.contacts for pose in poses]) > 0.5
    lowest = above.reshape(*stands.shape, 3).min(axis=-1)
    off: Array = np.abs(lowest[stands])
    return off


def _poses(model: SteerModel, height: Callable[[Array, Array], Array], gait: str, speed: float) -> Sequence[Pose]:
    """The poses of figures that begin somewhere in a step of stairs, once they go at a speed in m/s."""
    begins = np.random.default_rng(GROUND_SEED).uniform(0, TREAD, GROUND_FIGURES)
    session = model.start(gait, characters=GROUND_FIGURES)
    session.put(np.column_stack([np.arange(GROUND_FIGURES), begins, np.zeros(GROUND_FIGURES)]))
    session.set_ground(height)
    session.control(speed=speed, direction=0.0)
    poses = [session.tick() for _ in range(round((SETTLE + GROUND_SECONDS) * model.fps))]
    return poses[round(SETTLE * model.fps) :]


def _stances(track: Track, soles: Array, above: Array) -> list[Array]:
    """The stances of points (T, B, 6, 3) of soles, by their heights above the ground (T, B, 6)."""
    levelled = soles.copy()
    levelled[..., 1] = above
    runs = list[Array]()
    for figure in range(soles.shape[1]):
        runs += stances(levelled[:, figure], track.places[:, figure, 0].astype(np.float64), track.fps)
    return runs
