"""How well a gait stands and how calmly it moves, steered and recorded.

By the measures of :mod:`motet_train.evaluate.feet`: the slide in a stance, in centimetres, of the joints in the
balls of the feet and of the points of the soles (heel, ball, tip); the speed of the balls while they stand; and the
acceleration of all joints.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from motet.models.steer import SteerModel
from motet.motion.rotations import Array
from motet_train.evaluate.feet import acceleration, slide, speed, stances
from motet_train.evaluate.steer.track import BALLS, Track

SPEEDS = {"walk": 1.4, "run": 3.0}
"""m/s at which a gait is measured."""

NEAR = 0.2
"""Stretches of recordings are measured that are as fast within so much of it..."""

LONG, STEADY = 1.0, 0.5
"""... for so many seconds; how fast is a mean over seconds."""

CHARACTERS, SETTLE, MEASURED = 6, 3.0, 10.0
"""Figures that are steered straight on, in different directions; seconds that pass before, and that are measured."""


@dataclass(frozen=True)
class Part:
    """One figure: points (T, 6, 3) of the soles, balls (T, 2, 3), joints (T, J', 3) and the root (T, 3)."""

    soles: Array
    balls: Array
    joints: Array
    root: Array
    fps: float


def held_on(model: SteerModel, gait: str, hold_feet: bool) -> Track:
    """Figures that go straight on at the speed of :data:`SPEEDS`."""
    session = model.start(gait, characters=CHARACTERS, hold_feet=hold_feet)
    session.control(speed=SPEEDS[gait], direction=np.arange(CHARACTERS) * 360 / CHARACTERS)
    poses = [session.tick() for _ in range(round((SETTLE + MEASURED) * model.fps))]
    return Track.of(poses, model.fps)[round(SETTLE * model.fps) :]


def stretches(track: Track, pace: float) -> list[Track]:
    """The parts of a recording, of :data:`LONG` seconds at least, that are about as fast as ``pace``, m/s."""
    steps = np.linalg.norm(np.gradient(track.ground[:, 0, :2], axis=0), axis=1) * track.fps
    window = np.ones(min(round(STEADY * track.fps), len(steps)))
    mean = np.convolve(steps, window, "same") / np.convolve(np.ones(len(steps)), window, "same")
    inside = np.abs(mean - pace) <= NEAR * pace
    edges = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]]).astype(int))).reshape(-1, 2)
    return [track[a:b] for a, b in edges.tolist() if b - a >= LONG * track.fps]


def standing(tracks: Sequence[Track]) -> dict[str, float]:
    """The slides in cm, the speed of standing balls in m/s, the acceleration in m/s^2: means over stances or frames."""
    parts = [part for track in tracks for part in _parts(track)]
    frames = [len(part.root) for part in parts]
    return {
        "slide_cm": _slide([(part.balls, part.root, part.fps) for part in parts]),
        "sole_slide_cm": _slide([(part.soles, part.root, part.fps) for part in parts]),
        "toe_speed": _mean([speed(part.balls, part.root, part.fps) for part in parts], frames),
        "acceleration": _mean([acceleration(part.joints, part.root, part.fps) for part in parts], frames),
    }


def _slide(parts: Sequence[tuple[Array, Array, float]]) -> float:
    """The mean over the stances of all points of figures, centimetres."""
    return 100 * _mean([slide(*part) for part in parts], [len(stances(*part)) for part in parts])


def _parts(track: Track) -> list[Part]:
    places, soles = track.places.astype(np.float64), track.soles.astype(np.float64)
    count = places.shape[1]
    return [Part(soles[:, i], places[:, i, BALLS], places[:, i], places[:, i, 0], track.fps) for i in range(count)]


def _mean(values: Sequence[float], weights: Sequence[int]) -> float:
    """The weighed mean of the values that are numbers; NaN where none is."""
    known, counts = np.array(values), np.array(weights, dtype=np.float64)
    usable = np.isfinite(known) & (counts > 0)
    return float(np.average(known[usable], weights=counts[usable])) if usable.any() else np.nan
