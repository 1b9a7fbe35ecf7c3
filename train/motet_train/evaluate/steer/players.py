"""How feet stand while a player steers: a walk that is reversed again and again, and a stick that is never still."""

from collections.abc import Iterator

import numpy as np

from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet_train.evaluate.steer import following
from motet_train.evaluate.steer.following import Track, slide_of

FIGURES, SECONDS, SEED = 24, 20.0, 4
"""So many figures are steered for so long, by a seed that chose nothing of the model."""

REVERSED_AT, REVERSED_AFTER = 1.28, (1.6, 2.4)
"""m/s of a walk, and between how many seconds it is reversed."""

STICK_PACES, STICK_PERIOD = (0.72, 1.28), 9.0
"""m/s between which a stick's speed sways, and seconds of that."""

STICK_TURNS, STICK_CALM = 85.0, 0.5
"""Degrees a second that a stick turns by, a standard deviation; and in how many seconds that changes."""


def reversal_figures(model: SteerModel) -> dict[str, float]:
    """slide_cm, slide_p95_cm as :func:`motet_train.evaluate.steer.following.standing` has them, of figures that walk to
    and fro."""
    return slide_of([_steered(model, _reversals(model.fps))])


def stick_figures(model: SteerModel) -> dict[str, float]:
    """The same of figures that walk as a stick tells them in each tick, whose direction turns smoothly at random, and
    whose speed sways."""
    return slide_of([_steered(model, _sticks(model.fps))])


def _steered(model: SteerModel, told: Iterator[tuple[Array, Array]]) -> Track:
    """What figures do that are told speeds (B,) and directions (B,), in degrees, after the first seconds."""
    session = model.start("walk", characters=FIGURES)
    first, before, poses = round(following.SETTLE * model.fps), np.full((2, FIGURES), np.nan), []
    for _ in range(first + round(SECONDS * model.fps)):
        speed, direction = now = next(told)
        if (np.asarray(now) != before).any():
            session.control(speed=speed, direction=direction)
        before = np.array(now)
        poses.append(session.tick())
    return Track.of(poses[first:], model.fps)


def _reversals(fps: float) -> Iterator[tuple[Array, Array]]:
    rng, speed, direction = np.random.default_rng(SEED), np.full(FIGURES, REVERSED_AT), np.zeros(FIGURES)
    left = rng.uniform(0, REVERSED_AFTER[1], FIGURES)
    while True:
        yield speed, direction
        left = left - 1 / fps
        turns = left < 0
        left = np.where(turns, rng.uniform(*REVERSED_AFTER, FIGURES), left)
        direction = np.where(turns, 180 - direction, direction)


def _sticks(fps: float) -> Iterator[tuple[Array, Array]]:
    rng, dt, (low, high) = np.random.default_rng(SEED), 1 / fps, STICK_PACES
    direction, sway = rng.uniform(-180, 180, FIGURES), rng.uniform(-np.pi, np.pi, FIGURES)
    turn, left = rng.normal(0, STICK_TURNS, FIGURES), np.exp(-dt / STICK_CALM)
    while True:
        yield (low + high) / 2 + (high - low) / 2 * np.sin(sway), direction
        turn = left * turn + rng.normal(0, STICK_TURNS * np.sqrt(1 - left**2), FIGURES)  # an Ornstein-Uhlenbeck process
        direction, sway = direction + turn * dt, sway + 2 * np.pi * dt / STICK_PERIOD
