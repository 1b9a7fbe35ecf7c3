"""Commands of characters that are on their way to a point, and of those that keep apart, tick by tick."""

from dataclasses import replace

import numpy as np

from motet.errors import ControlError
from motet.motion.rotations import Array
from motet.steering.avoidance import kept_apart
from motet.steering.gaits import Command, Gaits
from motet.steering.matching import Playback, Rows
from motet.steering.targets import Guidance

SUDDEN = 0.2
"""m/s or radians by which a target changes in a tick, before rows are searched for it at once."""

WAITS = 0.2
"""m/s: who would go around others more slowly than this stands and lets them pass."""


def led(
    guidance: Guidance, gaits: Gaits, playback: Playback, told: Command, before: Array, seconds: float
) -> tuple[Guidance, Command, Array]:
    """A tick later, the command to those that are on their way, and the targets (B, 3) of all, as :meth:`Gaits.target`
    has them. Those that come to rest are moved by what their steps leave. before: (B, 3) their last targets."""
    gait = told.gait
    going, velocity = guidance.going.after(playback, gaits.settings)
    guidance = replace(guidance, going=going)
    if going.goes.any():
        step = going.settled(playback, gaits.settings, seconds)
        playback.root = playback.root + np.insert(step, 2, 0.0, axis=1)  # poses share the array
        speed = np.hypot(*velocity.T)
        told = replace(
            told,
            gait=np.where(going.goes, _slowed(gaits, going.gait, told.gait, speed), told.gait),
            speed=np.where(going.goes, speed, told.speed),
            direction=np.where(going.goes & (speed > 0), np.arctan2(*velocity.T), told.direction),
            facing=np.where(going.goes, going.faces(playback, velocity), told.facing),
            faces_way=told.faces_way & ~going.goes,
        )
    target, _ = gaits.target(told)
    if guidance.room:
        target, _ = gaits.target(_aside(guidance, playback, told, target))
    playback.hasten((np.abs(target - before).max(axis=1) > SUDDEN) | (told.gait != gait))
    return guidance, told, target


def speed_of(gaits: Gaits, which: Rows, speed: Array | None) -> Array:
    """The speeds (n,) at which characters go in gaits (n,), by default the usual ones; ControlError for a gait that
    goes nowhere."""
    _, usual, high = gaits.speeds[which, :3].T
    for n in which[high == 0].tolist():
        raise ControlError(f"{gaits.names[n]!r} goes nowhere: give a gait such as {gaits.names[0]!r}")
    found: Array = usual if speed is None else speed
    return found


def _slowed(gaits: Gaits, gait: Rows, now: Rows, speed: Array) -> Rows:
    """The gaits (B,) of figures that are to go at a speed in gaits (B,): the slowest that goes any way, where theirs is
    too fast for it; and what they have now, where they stand."""
    low = gaits.speeds[:, 0]
    slow = np.where(gaits.speeds[:, 3:].min(axis=1) > 0, low, np.inf).argmin()
    slower = np.where((speed < low[gait]) & (low[slow] < low[gait]), slow, gait)
    return np.where(speed > 0, slower, now)


def _aside(guidance: Guidance, playback: Playback, told: Command, target: Array) -> Command:
    """The command by which those that move keep apart; they go no faster for it."""
    change = kept_apart(playback.root[:, :2], playback.spring[:, :2], guidance.room)
    velocity = target[:, :2] + np.where(told.speed[:, None] > 0, change, 0.0)
    speed, before = np.hypot(*velocity.T), np.hypot(*target[:, :2].T)
    direction = np.where(speed > WAITS, np.arctan2(*velocity.T), told.direction)
    facing = np.where((told.speed > 0) & (told.facing == told.direction), direction, target[:, 2])
    pace = np.where(speed > WAITS, np.minimum(speed, before), 0.0)
    return replace(told, speed=pace, direction=direction, facing=facing)
