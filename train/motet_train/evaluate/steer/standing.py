"""How well a gait stands and how calmly it moves, steered and recorded.

By the measures of :mod:`motet_train.evaluate.positions`: the slide in a stance, in centimetres, of the joints in the
balls of the feet and of the points of the soles (heel, ball, tip); the speed of the balls while they stand; and the
acceleration of all joints.
"""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import find_objects, label, uniform_filter1d

from motet.models.steer import SteerModel
from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.rotations import Array
from motet_train.evaluate.positions import acceleration, slide, speed, stances
from motet_train.evaluate.steer.track import Track

MEASURED_SPEEDS = {"walk": 1.4, "run": 3.0}
"""m/s at which a gait is measured."""

STRAIGHT_FIGURES, STRAIGHT_SETTLE, STRAIGHT_MEASURED = 6, 3.0, 10.0
"""Figures that are steered straight on, in different directions; seconds that pass before, and that are measured."""


def held_on(model: SteerModel, gait: str, hold_feet: bool) -> Track:
    """Figures that go straight on at the speed of :data:`MEASURED_SPEEDS`."""
    session = model.start(gait, characters=STRAIGHT_FIGURES, hold_feet=hold_feet)
    session.control(speed=MEASURED_SPEEDS[gait], direction=np.arange(STRAIGHT_FIGURES) * 360 / STRAIGHT_FIGURES)
    poses = [session.tick() for _ in range(round((STRAIGHT_SETTLE + STRAIGHT_MEASURED) * model.fps))]
    return Track.of(poses, model.fps)[round(STRAIGHT_SETTLE * model.fps) :]


def stretches(track: Track, pace: float) -> list[Track]:
    """The parts of a recording, of a second at least, whose mean speed over half a second is within a fifth of
    ``pace``, m/s."""
    steps = np.linalg.norm(np.gradient(track.ground[:, 0, :2], axis=0), axis=1).astype(np.float64) * track.fps
    window = min(round(0.5 * track.fps), len(steps))
    total, frames = (uniform_filter1d(of, window, mode="constant") for of in (steps, np.ones_like(steps)))
    inside = np.abs(total / frames - pace) <= 0.2 * pace
    return [track[part] for (part,) in find_objects(label(inside)[0]) if part.stop - part.start >= track.fps]


def standing(tracks: Sequence[Track]) -> dict[str, float]:
    """The slides in cm, the speed of standing balls in m/s, the acceleration in m/s^2: means over stances or frames."""
    balls = [HUMANOID.index(sided(side, "Toes")) for side in LEFT_RIGHT]
    stood, soles_stood, speeds, calm, frames = list[Array](), list[Array](), list[float](), list[float](), list[int]()
    for track in tracks:
        for figure in range(track.height.shape[1]):
            places, soles = (of[:, figure].astype(np.float64) for of in (track.places, track.soles))
            root = places[:, 0]
            stood += stances(places[:, balls], root, track.fps)
            soles_stood += stances(soles, root, track.fps)
            speeds.append(speed(places[:, balls], root, track.fps))
            calm.append(acceleration(places, root, track.fps))
            frames.append(len(places))
    return {
        "slide_cm": 100 * slide(stood),
        "sole_slide_cm": 100 * slide(soles_stood),
        "toe_speed": _mean(speeds, frames),
        "acceleration": _mean(calm, frames),
    }


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """The weighed mean of the values that are numbers; NaN where none is."""
    known, counts = np.array(values), np.array(weights, dtype=np.float64)
    usable = np.isfinite(known) & (counts > 0)
    return float(np.average(known[usable], weights=counts[usable])) if usable.any() else np.nan
