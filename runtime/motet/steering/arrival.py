"""Steered figures that go along paths and arrive at their ends.

A figure goes towards the point of its path that is a little ahead of where it is (pure pursuit). It slows down to the
end as if it braked evenly, and its target becomes standing where the springs of :mod:`motet.steering.step` then take it
to the end. The rest, centimetres, is made up for as it comes to rest, while its feet stay where they stand.

Letters in shapes: B figures, n of them, P points of all paths. Metres, seconds, radians; the ground's axes are x and z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, wrapped
from motet.motion.springs import damping_of
from motet.settings import Range, Settings
from motet.steering.matching import Flags, Playback, Rows
from motet.steering.settings import Metres, Radians, Seconds, Speed, SteeringSettings


@dataclass(frozen=True)
class ArrivalSettings(Settings):
    """Settings of figures on paths."""

    FEATURE: ClassVar[str] = "arrival"

    ahead: Metres = 0.3
    """How far ahead on its path a figure aims."""
    ahead_moving: Annotated[float, Range(0, 10, "s")] = 0.25
    """What each m/s adds to that."""
    brakes: Annotated[float, Range(0.1, 100, "m/s^2")] = 1.5
    """Deceleration towards the end."""
    near: Metres = 0.08
    """Distance from the end within which a figure has arrived."""
    sidestep: Metres = 0.7
    """Distance from the end within which a figure steps to it without turning there first."""
    glides_from: Metres = 0.16
    """Distance from the end within which a figure that stands stays there; beyond it, it goes again."""
    glides: Speed = 0.05
    """Final correction: its largest speed at a standstill."""
    glides_moving: Annotated[float, Range(0, 10)] = 0.15
    """What each m/s of walking adds to that speed."""
    settles: Seconds = 0.25
    """Time constant of the final correction."""
    faces: Radians = float(np.radians(8))
    """How far off the facing of a figure that has arrived may be."""
    stands: Speed = 0.1
    """Speed below which a figure stands."""
    sudden: Annotated[float, Range(0, 100, "m/s or rad")] = 0.2
    """Change of a target in a tick above which rows are searched for it at once."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths of B figures laid end to end."""

    points: Array
    """(P, 2)"""
    along: Array
    """(P,) metres to each point from where its path begins."""
    first: Rows
    """(B + 1,) the points at which the paths begin."""

    @staticmethod
    def of(paths: Sequence[Array]) -> "Paths":
        """The path (2 or more points, 2) of each figure."""
        points = np.concatenate(paths)
        first = np.cumsum([0, *map(len, paths)])
        steps = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
        steps[first[:-1]] = 0.0
        along = [np.cumsum(part) for part in np.split(steps, first[1:-1])]  # rounded as it would be alone
        return Paths(points, np.concatenate(along), first)

    @property
    def lengths(self) -> Array:
        """Metres of each path (B,)."""
        lengths: Array = self.along[self.first[1:] - 1]
        return lengths

    @property
    def ends(self) -> Array:
        """Where the paths end (B, 2)."""
        ends: Array = self.points[self.first[1:] - 1]
        return ends

    def at(self, gone: Array) -> Array:
        """The points (B, 2) of the paths at distances (B,) from their beginnings, in metres."""
        # the first point beyond that distance, by bisection
        after = self.first[:-1] + 1
        last = self.first[1:] - 1
        while (after < last).any():
            middle = (after + last) // 2
            beyond = self.along[middle] > gone
            after = np.where(beyond, after, np.minimum(middle + 1, last))
            last = np.where(beyond, middle, last)
        # and between the point before it and itself
        start = self.along[after - 1]
        stop = self.along[after]
        part = ((gone - start) / np.maximum(stop - start, 1e-9)).clip(0, 1)[:, None]
        points: Array = self.points[after - 1] + part * (self.points[after] - self.points[after - 1])
        return points


@dataclass(frozen=True, eq=False)
class Going:
    """B figures on their paths; replaced, never written into."""

    paths: Paths
    gone: Array
    """(B,) metres along the path."""
    speed: Array
    """(B,) m/s at which they go."""
    gait: Rows
    """(B,) numbers of gaits."""
    facing: Array
    """(B,) at the end, radians, NaN for any."""
    goes: Flags
    """(B,) whether they are on a path."""
    stops: Flags
    """(B,) whether their target is standing."""
    arrived: Flags
    """(B,) whether they stand at the end."""

    @staticmethod
    def nowhere(figures: int) -> "Going":
        """Figures that are on no path."""
        none = np.zeros(figures, dtype=bool)
        zero = np.zeros(figures)
        return Going(
            Paths.of([np.zeros((2, 2))] * figures),
            gone=zero,
            speed=zero,
            gait=np.zeros(figures, np.int64),
            facing=np.full(figures, np.nan),
            goes=none,
            stops=none,
            arrived=none,
        )

    def sent(self, figures: Rows, paths: Sequence[Array], **new_values: NDArray[Any]) -> "Going":
        """With new paths and other values for some figures (n,)."""
        all_paths = np.split(self.paths.points, self.paths.first[1:-1])
        for figure, path in zip(figures.tolist(), paths, strict=True):
            all_paths[figure] = path
        changed = {"goes": True, "stops": False, "arrived": False, "gone": 0.0} | new_values
        values = {name: getattr(self, name).copy() for name in changed}
        for name, value in changed.items():
            values[name][figures] = value
        return replace(self, paths=Paths.of(all_paths), **values)

    def after(self, playback: Playback, settings: ArrivalSettings, steering: SteeringSettings) -> tuple["Going", Array]:
        """A tick later, and the velocities (B, 2) at which figures on paths are to go, 0 for standing."""
        root = playback.root[:, :2]
        speed_now = np.hypot(*playback.spring[:, :2].T)
        lengths = self.paths.lengths
        # how far they have come along their paths, and the point that they aim at
        gone = self._progress(root)
        aim = gone + settings.ahead + settings.ahead_moving * speed_now
        # how far it is to the end
        to_end = self.paths.ends - root
        distance = np.hypot(*to_end.T)
        on_last_stretch = aim >= lengths
        left = np.where(on_last_stretch, distance, np.maximum(lengths - gone, distance))
        # stop where the springs roll on to the end; go again if that was too far from it
        passes_end = (_rolling_distance(playback, steering) * to_end).sum(axis=1) >= distance**2
        near = distance < settings.near
        stands = speed_now < settings.stands
        too_far = stands & (distance > settings.glides_from)
        stops = np.where(self.stops & ~too_far, True, on_last_stretch & (passes_end | near))
        # arrived: standing there, facing as wanted
        turned = self._is_turned(playback.root[:, 2], settings)
        arrived = self.goes & stops & (self.arrived | (stands & near & turned))
        # towards the aim, braking evenly
        speed = np.where(stops, 0.0, np.minimum(self.speed, np.sqrt(2 * settings.brakes * left)))
        velocity = _unit(self.paths.at(aim) - root) * speed[:, None]
        going = replace(self, gone=np.minimum(gone, lengths), stops=self.goes & stops, arrived=arrived)
        return going, velocity

    def _progress(self, root: Array) -> Array:
        """How far (B,) figures at roots (B, 2) have come along their paths, metres."""
        here = self.paths.at(self.gone)
        way = _unit(self.paths.at(self.gone + 0.05) - here)
        progress: Array = self.gone + ((root - here) * way).sum(axis=1).clip(0, 0.5)
        return progress

    def _is_turned(self, facing: Array, settings: ArrivalSettings) -> Flags:
        """Whether facings (B,) are those that figures are to have at the end."""
        turned: Flags = np.isnan(self.facing) | (np.abs(wrapped(facing - self.facing)) < settings.faces)
        return turned

    def faces(self, playback: Playback, velocity: Array, settings: ArrivalSettings) -> Array:
        """The facings (B,), in radians, of figures that go at velocities (B, 2): where they go; near the end as they
        face now, or as they are to face there."""
        facing_now = playback.spring[:, 2]
        near = np.hypot(*(self.paths.ends - playback.root[:, :2]).T) < settings.sidestep
        facing = np.where(near, facing_now, np.arctan2(*velocity.T))
        return np.where(near & ~np.isnan(self.facing), self.facing, facing)

    def settled(
        self, playback: Playback, settings: ArrivalSettings, steering: SteeringSettings, seconds: float
    ) -> Array:
        """The step (B, 2) by which figures that come to rest are moved to where they are to stand."""
        missing = self.paths.ends - playback.root[:, :2] - _rolling_distance(playback, steering)
        distance = np.hypot(*missing.T)
        speed = np.hypot(*playback.spring[:, :2].T)
        most = (settings.glides + settings.glides_moving * speed) * seconds
        share = np.minimum(seconds / settings.settles, most / np.maximum(distance, 1e-9))
        glides = self.stops & (distance < settings.glides_from)
        return np.where(glides[:, None], missing * share[:, None], 0.0)


def _rolling_distance(playback: Playback, steering: SteeringSettings) -> Array:
    """How far (B, 2) figures still go whose target is standing: the integral of the spring."""
    damping = damping_of(steering.velocity)
    return (2 * playback.spring[:, :2] + playback.spring_rate[:, :2] / damping) / damping


def _unit(vectors: Array) -> Array:
    units: Array = vectors / np.maximum(np.hypot(*vectors.T), 1e-9)[:, None]
    return units
