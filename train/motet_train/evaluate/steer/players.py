"""How feet stand while a player steers: a walk that is reversed again and again, and a stick that never rests."""

from collections.abc import Iterator

import numpy as np

from motet.motion.rotations import Array
from motet.steering.model import SteerModel
from motet_train.evaluate.steer import following
from motet_train.evaluate.steer.following import Track, slide_of

STEERED_FIGURES = 24
"""Figures that are steered."""

STEERED_SECONDS = 20.0
"""How long they are steered."""

COMMANDS_SEED = 4
"""Of the commands; it was not used to choose anything of the model."""

REVERSED_AT = 1.28
"""m/s of a walk that is reversed."""

REVERSED_AFTER = (1.6, 2.4)
"""Shortest and longest time between reversals in seconds."""

STICK_PACES = (0.72, 1.28)
"""m/s between which a stick's speed oscillates."""

STICK_PERIOD = 9.0
"""Seconds of this oscillation."""

STICK_TURNS = 85.0
"""Standard deviation of a stick's rate of turning, degrees a second."""

STICK_CALM = 0.5
"""Seconds in which the rate of turning changes (the time constant of its autocorrelation)."""


def reversal_figures(model: SteerModel) -> dict[str, float]:
    """slide_cm, slide_p95_cm as in :func:`motet_train.evaluate.steer.following.standing`, of figures that walk to and
    fro."""
    return slide_of([_steered(model, _reversals(model.fps))])


def stick_figures(model: SteerModel) -> dict[str, float]:
    """The same of figures whose walk follows a stick in every tick: its direction turns smoothly at random, and its
    speed oscillates."""
    return slide_of([_steered(model, _sticks(model.fps))])


def _steered(model: SteerModel, commands: Iterator[tuple[Array, Array]]) -> Track:
    """Figures that are steered by speeds (B,) and directions (B,), in degrees, after the first seconds."""
    session = model.start("walk", characters=STEERED_FIGURES)
    first = round(following.SETTLE * model.fps)
    before = np.full((2, STEERED_FIGURES), np.nan)
    poses = []
    for _ in range(first + round(STEERED_SECONDS * model.fps)):
        speed, direction = next(commands)
        # a new command only where it changes
        command = np.array([speed, direction])
        if (command != before).any():
            session.control(speed=speed, direction=direction)
        before = command
        poses.append(session.tick())
    return Track.of(poses[first:], model.fps)


def _reversals(fps: float) -> Iterator[tuple[Array, Array]]:
    rng = np.random.default_rng(COMMANDS_SEED)
    speed = np.full(STEERED_FIGURES, REVERSED_AT)
    direction = np.zeros(STEERED_FIGURES)
    seconds_left = rng.uniform(0, REVERSED_AFTER[1], STEERED_FIGURES)
    while True:
        yield speed, direction
        seconds_left = seconds_left - 1 / fps
        reverses = seconds_left < 0
        seconds_left = np.where(reverses, rng.uniform(*REVERSED_AFTER, STEERED_FIGURES), seconds_left)
        direction = np.where(reverses, 180 - direction, direction)


def _sticks(fps: float) -> Iterator[tuple[Array, Array]]:
    rng = np.random.default_rng(COMMANDS_SEED)
    dt = 1 / fps
    low, high = STICK_PACES
    direction = rng.uniform(-180, 180, STEERED_FIGURES)
    phase = rng.uniform(-np.pi, np.pi, STEERED_FIGURES)
    turn_rate = rng.normal(0, STICK_TURNS, STEERED_FIGURES)
    decay = np.exp(-dt / STICK_CALM)
    while True:
        speed = (low + high) / 2 + (high - low) / 2 * np.sin(phase)
        yield speed, direction
        # an Ornstein-Uhlenbeck process
        turn_rate = decay * turn_rate + rng.normal(0, STICK_TURNS * np.sqrt(1 - decay**2), STEERED_FIGURES)
        direction = direction + turn_rate * dt
        phase = phase + 2 * np.pi * dt / STICK_PERIOD
