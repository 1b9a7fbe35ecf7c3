"""Commands of characters that are on their way to a point, and of those that keep apart, tick by tick."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from motet.errors import ControlError
from motet.motion.rotations import Array
from motet.steering.arrival import ArrivalSettings, Going
from motet.steering.avoidance import AvoidanceSettings, kept_apart
from motet.steering.gaits import Command, Gaits
from motet.steering.matching import Playback, Rows
from motet.steering.targets import Guidance


class Ways(NamedTuple):
    """How characters go on their ways."""

    gaits: Gaits
    arrival: ArrivalSettings
    avoidance: AvoidanceSettings

    def lead(
        self, guidance: Guidance, playback: Playback, command: Command, target_before: Array, seconds: float
    ) -> tuple[Guidance, Command, Array]:
        """A tick later, the command to those that are on their way, and the targets (B, 3) of all, as
        :meth:`Gaits.target` has them. Those that come to rest are moved by what their steps leave. target_before:
        (B, 3)."""
        gait_before = command.gait
        # figures on paths
        going, velocity = guidance.going.after(playback, self.arrival, self.gaits.settings)
        guidance = replace(guidance, going=going)
        if going.goes.any():
            step = going.settled(playback, self.arrival, self.gaits.settings, seconds)
            playback.root = playback.root + np.insert(step, 2, 0.0, axis=1)  # poses share the array
            command = self._on_path(going, playback, command, velocity)
        target, _ = self.gaits.target(command)
        # figures that keep apart
        if guidance.room:
            target, _ = self.gaits.target(self._aside(guidance.room, playback, command, target))
        # search at once for targets that change much
        sudden = np.abs(target - target_before).max(axis=1) > self.arrival.sudden
        playback.hasten(sudden | (command.gait != gait_before))
        return guidance, command, target

    def _on_path(self, going: Going, playback: Playback, command: Command, velocity: Array) -> Command:
        """The command by which figures on paths go at velocities (B, 2)."""
        goes = going.goes
        speed = np.hypot(*velocity.T)
        gait = _slowed(self.gaits, going.gait, command.gait, speed)
        return replace(
            command,
            gait=np.where(goes, gait, command.gait),
            speed=np.where(goes, speed, command.speed),
            direction=np.where(goes & (speed > 0), np.arctan2(*velocity.T), command.direction),
            facing=np.where(goes, going.faces(playback, velocity, self.arrival), command.facing),
            faces_way=command.faces_way & ~goes,
        )

    def _aside(self, room: float, playback: Playback, command: Command, target: Array) -> Command:
        """The command by which those that move keep apart; they go no faster for it."""
        change = kept_apart(playback.root[:, :2], playback.spring[:, :2], room, self.avoidance)
        moves = command.speed > 0
        velocity = target[:, :2] + np.where(moves[:, None], change, 0.0)
        speed = np.hypot(*velocity.T)
        speed_before = np.hypot(*target[:, :2].T)
        goes = speed > self.avoidance.waits
        direction = np.where(goes, np.arctan2(*velocity.T), command.direction)
        faces_way = moves & (command.facing == command.direction)
        facing = np.where(faces_way, direction, target[:, 2])
        pace = np.where(goes, np.minimum(speed, speed_before), 0.0)
        return replace(command, speed=pace, direction=direction, facing=facing)


def speed_of(gaits: Gaits, numbers: Rows, speed: Array | None) -> Array:
    """The speeds (n,) at which characters go in gaits (n,), by default the usual ones; ControlError for a gait that
    goes nowhere."""
    _, usual, fastest = gaits.speeds[numbers, :3].T
    for number in numbers[fastest == 0].tolist():
        raise ControlError(f"{gaits.names[number]!r} goes nowhere: give a gait such as {gaits.names[0]!r}")
    speeds: Array = usual if speed is None else speed
    return speeds


def _slowed(gaits: Gaits, gait: Rows, gait_now: Rows, speed: Array) -> Rows:
    """The gaits (B,) of figures that are to go at speeds (B,) in gaits (B,): the slowest that goes any way, where
    theirs is too fast for the speed; and the present ones, where they stand."""
    slowest = gaits.speeds[:, 0]
    goes_any_way = gaits.speeds[:, 3:].min(axis=1) > 0
    slow_gait = np.where(goes_any_way, slowest, np.inf).argmin()
    too_fast = (speed < slowest[gait]) & (slowest[slow_gait] < slowest[gait])
    return np.where(speed > 0, np.where(too_fast, slow_gait, gait), gait_now)
