"""What steered figures are told, and what their gaits allow of it."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.errors import BundleError, ControlError
from motet.motion.rotations import Array, wrapped
from motet.steering.matching import Rows
from motet.steering.settings import SteeringSettings


@dataclass(frozen=True, eq=False)
class Gaits:
    """G gaits. speeds: (G, 5) m/s, the slowest, the usual one, and the fastest forward, sideways and
    backwards; 0 where a gait cannot move that way."""

    names: tuple[str, ...]
    speeds: Array
    settings: SteeringSettings

    @staticmethod
    def read(config: Fields, settings: SteeringSettings) -> "Gaits":
        """Those of a manifest's configuration; BundleError naming the wrong key."""
        names, speeds = config.texts("gaits"), config.table("speeds", 5)
        if not names or len(speeds) != len(names) or not ((speeds >= 0) & (speeds <= 100)).all():
            raise BundleError("manifest, config.speeds: must hold a row of 5 speeds, 0 to 100 m/s, for each gait")
        slowest, usual, forward = speeds[:, :3].T
        if not ((slowest <= usual) & (usual <= forward)).all():
            raise BundleError(
                "manifest, config.speeds: must rise from the slowest to the usual and the fastest forward"
            )
        return Gaits(names, speeds, settings)

    @cached_property
    def ahead(self) -> NDArray[np.bool_]:
        """Which gaits (G,) only go forward."""
        found: NDArray[np.bool_] = self.speeds[:, 3:].min(axis=1) == 0
        return found

    def number(self, name: str) -> int:
        """The number of a gait; ControlError for an unknown one."""
        if name not in self.names:
            raise ControlError(f"unknown gait {name!r}; expected one of {', '.join(self.names)}")
        return self.names.index(name)

    def target(self, command: "Command") -> tuple[Array, list[tuple[str, str]]]:
        """A command's velocity along x and z, m/s, and its facing, radians, (B, 3), within limits; and what exceeds
        them: gait and message."""
        how, speeds, told, moving = self.settings, self.speeds[command.gait], command.speed, command.speed > 0
        # not all gaits go sideways and backwards: those face the way they go, or nearly
        farthest = np.where(self.ahead[command.gait], how.ahead, np.pi)
        aside = np.clip(wrapped(command.direction - command.facing), -farthest, farthest)
        facing = np.where(moving, command.direction - aside, command.facing)
        sector = np.digitize(np.abs(wrapped(command.direction - facing)), (how.aside, how.back))
        high = np.take_along_axis(speeds, 2 + sector[:, None], axis=1)[:, 0]
        low = np.minimum(speeds[:, 0], high)
        speed = np.where(moving, np.clip(told, low, high), 0.0)
        x, z = speed * np.sin(command.direction), speed * np.cos(command.direction)
        names = [self.names[gait] for gait in command.gait.tolist()]
        beyond = [
            (names[n], f"{names[n]!r} allows 0 or {low[n]:g}-{high[n]:g} m/s in this direction, not {told[n]:g}")
            for n in np.flatnonzero(np.abs(speed - told) > 1e-6).tolist()
        ]
        return np.stack([x, z, wrapped(facing)], axis=1), beyond

    def curved(self, target: Array, gait: Rows, facing: Array) -> Array:
        """Targets (B, 3) as figures with facings (B,) go for them in gaits (B,): those that only go forward lead and
        turn no farther aside than they go anyway, so that a figure goes a curve instead of turning on the spot."""
        ahead = self.ahead[gait]
        if not ahead.any():
            return target
        x, z, to = target.T
        direction, speed = facing + self._near(np.arctan2(x, z) - facing), np.hypot(x, z)
        led = np.column_stack([speed * np.sin(direction), speed * np.cos(direction), facing + self._near(to - facing)])
        return np.where((ahead & ((x != 0) | (z != 0)))[:, None], led, target)

    def _near(self, angle: Array) -> Array:
        found: Array = np.clip(wrapped(angle), -self.settings.ahead, self.settings.ahead)
        return found


@dataclass(frozen=True, eq=False)
class Command:
    """The last command to B figures; its arrays are never modified.

    gait: (B,) numbers. speed: (B,) m/s. direction: of travel, and facing: (B,) radians. faces_way: (B,) whether they
    are to face the way they move.
    """

    gait: Rows
    speed: Array
    direction: Array
    facing: Array
    faces_way: NDArray[np.bool_]

    def told(self, gait: Rows | None = None, **given: Array) -> "Command":
        """With new speeds, directions and facings. Given a direction but no facing, they face it once they move."""
        faces_way = self.faces_way
        if given.keys() & {"direction", "facing"}:
            faces_way = np.full_like(faces_way, "facing" not in given)
        new = replace(self, gait=self.gait if gait is None else gait, faces_way=faces_way, **given)
        return replace(new, facing=np.where(faces_way & (new.speed > 0), new.direction, new.facing))
