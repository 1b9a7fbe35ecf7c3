"""Commands to steered figures, and what their gaits allow of them."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.decode.matching import Rows, SteeringSettings
from motet.errors import BundleError, ControlError
from motet.motion.rotations import Array, wrapped


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
        return Gaits(names, speeds, settings)

    def number(self, name: str) -> int:
        """The number of a gait; ControlError for an unknown one."""
        if name not in self.names:
            raise ControlError(f"unknown gait {name!r}; expected one of {', '.join(self.names)}")
        return self.names.index(name)

    def facing(self, direction: Array, facing: Array, gait: Rows) -> Array:
        """Facings (B,) in radians in which gaits can move in a direction: not all go sideways and backwards."""
        farthest = np.where(self.speeds[gait, 3:].min(axis=1) > 0, np.pi, self.settings.ahead)
        found: Array = direction - np.clip(wrapped(direction - facing), -farthest, farthest)
        return found

    def range(self, aside: Array, gait: Rows) -> tuple[Array, Array]:
        """The lowest and highest speed (B,) of gaits at angles from the facing."""
        sector = np.digitize(np.abs(wrapped(aside)), (self.settings.aside, self.settings.back))
        high = self.speeds[gait, 2 + sector]
        return np.minimum(self.speeds[gait, 0], high), high


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

    @staticmethod
    def standing(figures: int, gait: int) -> "Command":
        """Stand, and face z."""
        zero = np.zeros(figures)
        return Command(np.full(figures, gait), zero, zero, zero, zero > 0)

    def told(
        self,
        gait: Rows | None = None,
        speed: Array | None = None,
        direction: Array | None = None,
        facing: Array | None = None,
    ) -> "Command":
        """With new values. Given a direction but no facing, they face it once they move."""
        faces_way = self.faces_way if facing is None else np.zeros_like(self.faces_way)
        if direction is not None and facing is None:
            faces_way = np.ones_like(faces_way)
        speed = self.speed if speed is None else speed
        direction = self.direction if direction is None else direction
        facing = self.facing if facing is None else facing
        facing = np.where(faces_way & (speed > 0), direction, facing)
        return Command(self.gait if gait is None else gait, speed, direction, facing, faces_way)

    def steered(self, velocity: Array, gait: Rows | None = None, facing: Array | None = None) -> "Command":
        """With speed and direction of velocities (B, 2) along x and z; zero stops, and keeps all else."""
        speed = np.hypot(*velocity.T)
        goes = speed > 0
        direction = np.where(goes, np.arctan2(*velocity.T), self.direction)
        found = self.told(gait, speed, direction, facing)
        if facing is not None:
            return found
        return replace(found, faces_way=np.where(goes, True, self.faces_way))

    def put(self, facing: Array) -> "Command":
        """Of figures placed elsewhere with another facing: standing ones move that way next."""
        direction = np.where(self.speed > 0, self.direction, facing)
        return replace(self, direction=direction, facing=facing, faces_way=np.zeros_like(self.faces_way))

    @property
    def heading(self) -> Array:
        """Their facing (B,) once they move."""
        return np.where(self.faces_way, self.direction, self.facing)

    def target(self, gaits: Gaits) -> tuple[Array, list[tuple[str, str]]]:
        """The velocity along x and z, m/s, and the facing, radians, (B, 3), within the gaits' limits; and what exceeds
        them: gait and message."""
        facing = np.where(self.speed > 0, gaits.facing(self.direction, self.facing, self.gait), self.facing)
        low, high = gaits.range(self.direction - facing, self.gait)
        speed = np.where(self.speed > 0, np.clip(self.speed, low, high), 0.0)
        found = np.stack([speed * np.sin(self.direction), speed * np.cos(self.direction), wrapped(facing)], axis=1)
        names = [gaits.names[gait] for gait in self.gait.tolist()]
        beyond = [
            (names[n], f"{names[n]!r} allows 0 or {low[n]:g}-{high[n]:g} m/s in this direction, not {self.speed[n]:g}")
            for n in np.flatnonzero(np.abs(speed - self.speed) > 1e-6).tolist()
        ]
        return found, beyond
