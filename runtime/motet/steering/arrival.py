"""Steered figures that go along paths and arrive at their ends.

A figure goes towards the point of its path that is a little ahead of where it is (pure pursuit). It slows down to the
end as if it braked evenly, and is told to stand where the springs of :mod:`motet.steering.step` then take it to the
end. What is left after that, centimetres, is made up for as it comes to rest, while its feet stay where they stand.

Letters in shapes: B figures, P points of all paths. Metres, seconds, radians; the ground's axes are x and z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, wrapped
from motet.motion.springs import damping_of
from motet.steering.matching import Playback
from motet.steering.settings import SteeringSettings

AHEAD, SOONER = 0.3, 0.25
"""How far ahead on its path a figure aims: metres, and more for each m/s."""

BRAKES = 1.5
"""m/s^2 at which a figure slows down to the end."""

NEAR, SIDESTEP = 0.08, 0.7
"""Metres within which a figure has arrived; and within which it steps to the end without turning there first."""

GLIDES_FROM, GLIDES, SETTLES = 0.16, (0.05, 0.15), 0.25
"""Metres from the end within which a figure that stands stays there, else it goes again; the most m/s at which what is
left is made up for, standing and for each m/s of walking; and in how many seconds."""

FACES = np.radians(8)
"""How far off a figure faces that has arrived, at most."""

STANDS = 0.1
"""m/s below which a figure stands."""


@dataclass(frozen=True, eq=False)
class Paths:
    """Paths of B figures laid end to end. points: (P, 2). along: (P,) metres to each from where its path
    begins. first: (B + 1,) where the paths begin."""

    points: Array
    along: Array
    first: NDArray[np.int64]

    @staticmethod
    def of(paths: Sequence[Array]) -> "Paths":
        """Those of each figure, of two points (2 or more, 2) at least."""
        points = np.concatenate(paths)
        first = np.cumsum([0, *map(len, paths)])
        steps = np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T)
        steps[first[:-1]] = 0.0
        along = [np.cumsum(part) for part in np.split(steps, first[1:-1])]  # rounded as it would be alone
        return Paths(points, np.concatenate(along), first)

    @property
    def lengths(self) -> Array:
        """Metres of each path (B,)."""
        found: Array = self.along[self.first[1:] - 1]
        return found

    @property
    def ends(self) -> Array:
        """Where the paths end (B, 2)."""
        found: Array = self.points[self.first[1:] - 1]
        return found

    def at(self, gone: Array) -> Array:
        """The points (B, 2) of the paths that are so many metres from their beginnings (B,)."""
        # the first point after so many metres, by halving what lies between two others
        after, last = self.first[:-1] + 1, self.first[1:] - 1
        while (after < last).any():
            middle = (after + last) // 2
            beyond = self.along[middle] > gone
            after = np.where(beyond, after, np.minimum(middle + 1, last))
            last = np.where(beyond, middle, last)
        start, stop = self.along[after - 1], self.along[after]
        part = ((gone - start) / np.maximum(stop - start, 1e-9)).clip(0, 1)[:, None]
        found: Array = self.points[after - 1] + part * (self.points[after] - self.points[after - 1])
        return found


@dataclass(frozen=True, eq=False)
class Going:
    """Figures on their paths; replaced, never written into. gone: (B,) metres. speed: (B,) m/s at which they go.
    gait: (B,) numbers. facing: (B,) at the end, radians, NaN for any. goes: (B,) whether they are on a path. stops:
    (B,) whether they are told to stand. arrived: (B,) whether they stand at the end."""

    paths: Paths
    gone: Array
    speed: Array
    gait: NDArray[np.int64]
    facing: Array
    goes: NDArray[np.bool_]
    stops: NDArray[np.bool_]
    arrived: NDArray[np.bool_]

    @staticmethod
    def nowhere(figures: int) -> "Going":
        """Of figures that are on no path."""
        none, zero = np.zeros(figures, dtype=bool), np.zeros(figures)
        paths = Paths.of([np.zeros((2, 2))] * figures)
        return Going(paths, zero, zero, np.zeros(figures, np.int64), zero + np.nan, none, none, none)

    def sent(self, who: NDArray[np.int64], paths: Sequence[Array], **told: NDArray[Any]) -> "Going":
        """With new paths and other values for some figures (n,)."""
        own = np.split(self.paths.points, self.paths.first[1:-1])
        for at, path in zip(who.tolist(), paths, strict=True):
            own[at] = path
        changed = {"goes": True, "stops": False, "arrived": False, "gone": 0.0} | told
        values = {name: getattr(self, name).copy() for name in changed}
        for name, value in changed.items():
            values[name][who] = value
        return replace(self, paths=Paths.of(own), **values)

    def after(self, playback: Playback, how: SteeringSettings) -> tuple["Going", Array]:
        """A tick later, and the velocities (B, 2) at which those that go are to go, 0 for standing."""
        root, velocity = playback.root[:, :2], playback.spring[:, :2]
        here = self.paths.at(self.gone)
        way = _unit(self.paths.at(self.gone + 0.05) - here)
        gone = self.gone + ((root - here) * way).sum(axis=1).clip(0, 0.5)
        pace, lengths = np.hypot(*velocity.T), self.paths.lengths
        ahead = gone + AHEAD + SOONER * pace
        off = self.paths.ends - root
        last, far = ahead >= lengths, np.hypot(*off.T)
        left = np.where(last, far, np.maximum(lengths - gone, far))
        rolls = _rolling(playback, how)
        passed = (rolls * off).sum(axis=1) >= far**2
        arrives = last & (passed | (far < NEAR))
        stands = pace < STANDS
        stops = np.where(self.stops & ~(stands & (far > GLIDES_FROM)), True, arrives)
        turned = np.isnan(self.facing) | (np.abs(wrapped(playback.root[:, 2] - self.facing)) < FACES)
        arrived = self.goes & stops & (self.arrived | (stands & (far < NEAR) & turned))
        speed = np.where(stops, 0.0, np.minimum(self.speed, np.sqrt(2 * BRAKES * left)))
        wanted = _unit(self.paths.at(ahead) - root) * speed[:, None]
        return replace(self, gone=np.minimum(gone, lengths), stops=self.goes & stops, arrived=arrived), wanted

    def faces(self, playback: Playback, wanted: Array) -> Array:
        """Where figures that go at velocities (B, 2) face, radians (B,): where they go; near the end as they do, and at
        the end as they are to."""
        now = playback.spring[:, 2]
        near = np.hypot(*(self.paths.ends - playback.root[:, :2]).T) < SIDESTEP
        ahead = np.where(near, now, np.arctan2(*wanted.T))
        return np.where(near & ~np.isnan(self.facing), self.facing, ahead)

    def settled(self, playback: Playback, how: SteeringSettings, seconds: float) -> Array:
        """The step (B, 2) by which figures that come to rest are moved to where they are to stand."""
        off = self.paths.ends - playback.root[:, :2] - _rolling(playback, how)
        far = np.hypot(*off.T)
        standing, walking = GLIDES
        most = (standing + walking * np.hypot(*playback.spring[:, :2].T)) * seconds
        share = np.minimum(seconds / SETTLES, most / np.maximum(far, 1e-9))
        return np.where((self.stops & (far < GLIDES_FROM))[:, None], off * share[:, None], 0.0)


def _rolling(playback: Playback, how: SteeringSettings) -> Array:
    """How far (B, 2) figures still go that are told to stand: the integral of the spring."""
    damping = damping_of(how.velocity)
    return (2 * playback.spring[:, :2] + playback.spring_rate[:, :2] / damping) / damping


def _unit(vectors: Array) -> Array:
    found: Array = vectors / np.maximum(np.hypot(*vectors.T), 1e-9)[:, None]
    return found
