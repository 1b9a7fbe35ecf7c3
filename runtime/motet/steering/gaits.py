"""Commands to steered figures, and what their gaits allow of them."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from motet.bundle.fields import Fields
from motet.errors import BundleError, ControlError
from motet.motion.rotations import Array, wrapped
from motet.steering.matching import Flags, Rows
from motet.steering.settings import SteeringSettings


@dataclass(frozen=True, eq=False)
class Gaits:
    """G gaits."""

    names: tuple[str, ...]
    speeds: Array
    """(G, 5) m/s, the slowest, the usual one, and the fastest forward, sideways and backwards; 0 where a gait cannot
    move that way."""
    settings: SteeringSettings

    @staticmethod
    def read(config: Fields, settings: SteeringSettings) -> "Gaits":
        """Those of a manifest's configuration; BundleError naming the wrong key."""
        names = config.texts("gaits")
        speeds = config.table("speeds", 5)
        if not names or len(speeds) != len(names) or not ((speeds >= 0) & (speeds <= 100)).all():
            raise BundleError("manifest, config.speeds: must hold a row of 5 speeds, 0 to 100 m/s, for each gait")
        slowest, usual, forward = speeds[:, :3].T
        if not ((slowest <= usual) & (usual <= forward)).all():
            raise BundleError(
                "manifest, config.speeds: must rise from the slowest to the usual and the fastest forward"
            )
        return Gaits(names, speeds, settings)

    @cached_property
    def ahead(self) -> Flags:
        """Which gaits (G,) only go forward."""
        ahead: Flags = self.speeds[:, 3:].min(axis=1) == 0
        return ahead

    def number(self, name: str) -> int:
        """The number of a gait; ControlError for an unknown one."""
        if name not in self.names:
            raise ControlError(f"unknown gait {name!r}; expected one of {', '.join(self.names)}")
        return self.names.index(name)

    def usual(self, numbers: Rows) -> Array:
        """The usual speeds (n,) of gaits (n,); ControlError for a gait that goes nowhere."""
        for number in numbers[self.speeds[numbers, 2] == 0].tolist():
            raise ControlError(f"{self.names[number]!r} goes nowhere: give a gait such as {self.names[0]!r}")
        usual: Array = self.speeds[numbers, 1]
        return usual

    def target(self, command: "Command") -> tuple[Array, list[tuple[str, str]]]:
        """A command's velocity along x and z, m/s, and its facing, radians, (B, 3), within limits; and gait and message
        for each figure whose command exceeds them."""
        moving = command.speed > 0
        # the facing that the gait allows, and then the speed in that direction
        facing = np.where(moving, self._facing(command), command.facing)
        lowest, highest = self._speed_limits(command, facing)
        speed = np.where(moving, np.clip(command.speed, lowest, highest), 0.0)
        x = speed * np.sin(command.direction)
        z = speed * np.cos(command.direction)
        return np.stack([x, z, wrapped(facing)], axis=1), self._exceeding(command, speed, lowest, highest)

    def _exceeding(self, command: "Command", speed: Array, lowest: Array, highest: Array) -> list[tuple[str, str]]:
        """Gait and message for each figure whose command exceeds the limits (B,) of speeds (B,)."""
        exceeding = list[tuple[str, str]]()
        for figure in np.flatnonzero(np.abs(speed - command.speed) > 1e-6).tolist():
            name = self.names[command.gait[figure]]
            limits = f"{lowest[figure]:g}-{highest[figure]:g} m/s in this direction"
            exceeding.append((name, f"{name!r} allows 0 or {limits}, not {command.speed[figure]:g}"))
        return exceeding

    def _facing(self, command: "Command") -> Array:
        """The facings (B,) of a command: gaits that only go forward face the way they go, or nearly."""
        farthest = np.where(self.ahead[command.gait], self.settings.ahead, np.pi)
        aside = np.clip(wrapped(command.direction - command.facing), -farthest, farthest)
        facing: Array = command.direction - aside
        return facing

    def _speed_limits(self, command: "Command", facing: Array) -> tuple[Array, Array]:
        """The lowest and the highest speed (B,) in the direction of a command."""
        speeds = self.speeds[command.gait]
        angle = np.abs(wrapped(command.direction - facing))
        sector = np.digitize(angle, (self.settings.aside, self.settings.back))
        highest = np.take_along_axis(speeds, 2 + sector[:, None], axis=1)[:, 0]
        return np.minimum(speeds[:, 0], highest), highest

    def curved(self, target: Array, gait: Rows, facing: Array) -> Array:
        """Targets (B, 3) as figures with facings (B,) approach them in gaits (B,): those that only go forward go and
        turn no farther aside than they go anyway, in a curve instead of turning on the spot."""
        ahead = self.ahead[gait]
        if not ahead.any():
            return target
        x, z, target_facing = target.T
        direction = facing + self._near(np.arctan2(x, z) - facing)
        speed = np.hypot(x, z)
        curved_facing = facing + self._near(target_facing - facing)
        curved = np.column_stack([speed * np.sin(direction), speed * np.cos(direction), curved_facing])
        moves = (x != 0) | (z != 0)
        return np.where((ahead & moves)[:, None], curved, target)

    def _near(self, angle: Array) -> Array:
        near: Array = np.clip(wrapped(angle), -self.settings.ahead, self.settings.ahead)
        return near


@dataclass(frozen=True, eq=False)
class Command:
    """The last command to B figures; its arrays are never modified."""

    gait: Rows
    """(B,) numbers."""
    speed: Array
    """(B,) m/s."""
    direction: Array
    """(B,) of travel, radians."""
    facing: Array
    """(B,) radians."""
    faces_way: Flags
    """(B,) whether they are to face the way they move."""

    def turned(self) -> "Command":
        """With the facings of those that move and are to face the way they do."""
        turns = self.faces_way & (self.speed > 0)
        return replace(self, facing=np.where(turns, self.direction, self.facing))
