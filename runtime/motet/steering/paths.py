"""Steered figures that go along paths, arrive at their ends, and keep apart on the way.

A figure goes towards the point of its path that is a little ahead of where it is (pure pursuit). It slows down to the
end as if it braked evenly, and its target becomes standing where the springs of :mod:`motet.steering.step` then take it
to the end. The rest, centimetres, is made up for as it comes to rest, while its feet stay where they stand.

Letters in shapes: B figures, n of them, P points of all paths. Metres, seconds, radians; the ground's axes are x and z.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array, wrapped
from motet.motion.springs import damping_of
from motet.settings import Range, Settings
from motet.steering.avoidance import AvoidanceSettings, directions_of, kept_apart
from motet.steering.gaits import Command, Gaits
from motet.steering.matching import Flags, Playback, Rows
from motet.steering.settings import Metres, Radians, Seconds, Share, Speed, SteeringSettings


@dataclass(frozen=True)
class ArrivalSettings(Settings):
    """Settings of figures on paths."""

    FEATURE: ClassVar[str] = "arrival"

    ahead: Metres = 0.2
    """How far ahead, and behind, bends of its path slow a figure down."""
    ahead_moving: Annotated[float, Range(0, 10, "s")] = 0.1
    """What each m/s adds to that."""
    turns_back: Share = 0.35
    """Share of the speed where a path turns back; bends are between this and 1."""
    brakes: Annotated[float, Range(0.1, 100, "m/s^2")] = 6.0
    """Deceleration of the place where a figure would come to rest, towards the end."""
    catches_up: Seconds = 0.3
    """Time constant by which a figure returns to its path."""
    strays: Metres = 0.4
    """How far from its path a figure goes straight on to the next corner."""
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
    def each(self) -> list[Array]:
        """The points of each path."""
        return np.split(self.points, self.first[1:-1])

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
        after = self._next(gone)
        # between the point before it and itself
        start = self.along[after - 1]
        stop = self.along[after]
        part = ((gone - start) / np.maximum(stop - start, 1e-9)).clip(0, 1)[:, None]
        points: Array = self.points[after - 1] + part * (self.points[after] - self.points[after - 1])
        return points

    def _next(self, gone: Array) -> Rows:
        """The first points (B,) beyond distances (B,) from the beginnings, or the last ones: by bisection."""
        after = self.first[:-1] + 1
        last = self.first[1:] - 1
        while (after < last).any():
            middle = (after + last) // 2
            beyond = self.along[middle] > gone
            after = np.where(beyond, after, np.minimum(middle + 1, last))
            last = np.where(beyond, middle, last)
        return after

    def rejoined(self, figures: Flags, gone: Array, places: Array) -> tuple["Paths", Array]:
        """Paths on which some figures (B,), which have gone so far (B,), go on from other places (B, 2) straight to the
        next point; and how far they have gone then."""
        after = self._next(gone)
        points = self.points.copy()
        points[after[figures] - 1] = places[figures]
        change = np.hypot(*(points[after] - points[after - 1]).T) - (self.along[after] - self.along[after - 1])
        # all points after that are nearer or farther
        counts = np.diff(self.first)
        is_later = np.arange(len(points)) >= np.repeat(after, counts)
        along = self.along + is_later * np.repeat(np.where(figures, change, 0.0), counts)
        return Paths(points, along, self.first), np.where(figures, self.along[after - 1], gone)


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
    def none(figures: int) -> "Going":
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

    def ended(self) -> "Going":
        """Without any path."""
        return Going.none(len(self.goes)) if self.goes.any() else self

    def sent(self, figures: Rows, paths: Sequence[Array], **new_values: NDArray[Any]) -> "Going":
        """With new paths and other values for some figures (n,)."""
        all_paths = self.paths.each
        for figure, path in zip(figures.tolist(), paths, strict=True):
            all_paths[figure] = path
        changed = {"goes": True, "stops": False, "arrived": False, "gone": 0.0} | new_values
        values = {name: getattr(self, name).copy() for name in changed}
        for name, value in changed.items():
            values[name][figures] = value
        return replace(self, paths=Paths.of(all_paths), **values)

    def after(
        self,
        playback: Playback,
        settings: ArrivalSettings,
        steering: SteeringSettings,
        strays_from: float,
        seconds: float,
    ) -> tuple["Going", Array]:
        """A tick later, and the velocities (B, 2) at which figures on paths are to go, 0 for standing.

        The place where a figure would come to rest moves at once as its target does. That place is led along the path,
        so nothing has to be foreseen: the figure itself follows it a third of a second later, and rounds corners.
        strays_from: metres from the path beyond which they go straight on to the next corner.
        """
        rests = playback.root[:, :2] + rolling_distance(playback, steering)
        strays = self.goes & (np.hypot(*(self.paths.at(self.gone) - rests).T) > strays_from)
        if strays.any():
            paths, gone = self.paths.rejoined(strays, self.gone, rests)
            return replace(self, paths=paths, gone=gone).after(playback, settings, steering, strays_from, seconds)
        lengths = self.paths.lengths
        # the point of the path where they are to come to rest goes on, slowly in bends and towards the end
        left = np.maximum(lengths - self.gone, 0.0)
        speed = np.minimum(self.speed * self._slowness(settings), np.sqrt(2 * settings.brakes * left))
        here = self.paths.at(self.gone)
        gone = np.minimum(self.gone + self._step(here, rests, speed * seconds, settings), lengths)
        there = self.paths.at(gone)
        # stop at the end; arrived: standing there, facing as wanted
        at_end = (gone >= lengths) & (np.hypot(*(self.paths.ends - rests).T) < settings.near)
        stops, arrived = self._arrival(at_end, playback, settings)
        going = replace(self, gone=gone, stops=self.goes & stops, arrived=self.goes & arrived)
        # the velocity at which they come to that point
        velocity = (there - here) / seconds + (here - rests) / settings.catches_up
        pace = np.hypot(*velocity.T)
        most = np.where(stops, 0.0, self.speed)
        return going, directions_of(velocity) * np.minimum(most, pace)[:, None]

    def _slowness(self, settings: ArrivalSettings) -> Array:
        """The share (B,) of their speeds at which figures go through the bend around where they are on their paths: by
        how much shorter the straight line through it is."""
        around = settings.ahead + settings.ahead_moving * self.speed
        start = np.maximum(self.gone - around, 0.0)
        stop = np.minimum(self.gone + around, self.paths.lengths)
        chord = np.hypot(*(self.paths.at(stop) - self.paths.at(start)).T)
        straightness = np.where(stop - start > 1e-6, chord / np.maximum(stop - start, 1e-6), 1.0)
        shares: Array = settings.turns_back + (1 - settings.turns_back) * straightness
        return shares

    def _step(self, here: Array, rests: Array, step: Array, settings: ArrivalSettings) -> Array:
        """Metres (B,) that points of paths ``here`` (B, 2) go on: ``step``, or less while figures, which would come to
        rest at ``rests``, are far from there; and as far as figures are ahead already."""
        off = rests - here
        waits = (1 - np.hypot(*off.T) / settings.strays).clip(0, 1)
        way = directions_of(self.paths.at(self.gone + 0.05) - here)
        ahead = (off * way).sum(axis=1).clip(0, 0.1)
        steps: Array = np.maximum(step * waits, ahead)
        return steps

    def _arrival(self, at_end: Flags, playback: Playback, settings: ArrivalSettings) -> tuple[Flags, Flags]:
        """Whether the target of figures is standing, and whether they have arrived, both (B,). at_end: whether they
        come to rest at the end."""
        distance = np.hypot(*(self.paths.ends - playback.root[:, :2]).T)
        stands = playback.pace < settings.stands
        goes_again = stands & (distance > settings.glides_from)
        stops = (self.stops & ~goes_again) | at_end
        turned = np.isnan(self.facing) | (np.abs(wrapped(playback.root[:, 2] - self.facing)) < settings.faces)
        return stops, stops & (self.arrived | (stands & (distance < settings.near) & turned))

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
        missing = self.paths.ends - playback.root[:, :2] - rolling_distance(playback, steering)
        distance = np.hypot(*missing.T)
        most = (settings.glides + settings.glides_moving * playback.pace) * seconds
        share = np.minimum(seconds / settings.settles, most / np.maximum(distance, 1e-9))
        glides = self.stops & (distance < settings.glides_from)
        return np.where(glides[:, None], missing * share[:, None], 0.0)


class Ways(NamedTuple):
    """How characters go on their ways."""

    gaits: Gaits
    arrival: ArrivalSettings
    avoidance: AvoidanceSettings

    def lead(
        self,
        going: Going,
        room: float,
        playback: Playback,
        command: Command,
        target_before: Array,
        seconds: float,
    ) -> tuple[Going, Command, Array]:
        """A tick later, the command to those that are on their way, and the targets (B, 3) of all, as
        :meth:`Gaits.target` has them. Those that come to rest are moved by what their steps leave.

        room: metres that figures keep apart, 0 for none. target_before: (B, 3).
        """
        gait_before = command.gait
        # figures on paths
        strays_from = self.avoidance.rejoins if room else self.arrival.strays
        going, velocity = going.after(playback, self.arrival, self.gaits.settings, strays_from, seconds)
        if going.goes.any():
            step = going.settled(playback, self.arrival, self.gaits.settings, seconds)
            playback.root = playback.root + np.insert(step, 2, 0.0, axis=1)  # poses share the array
            command = self._on_path(going, playback, command, velocity)
        target, _ = self.gaits.target(command)
        # figures that keep apart
        if room:
            target, _ = self.gaits.target(self._aside(room, playback, command, target, target_before))
        # search at once for targets that change much
        sudden = np.abs(target - target_before).max(axis=1) > self.arrival.sudden
        playback.hasten(sudden | (command.gait != gait_before))
        return going, command, target

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

    def _aside(self, room: float, playback: Playback, command: Command, target: Array, target_before: Array) -> Command:
        """The command by which those that move keep apart; they go no faster for it."""
        moves = command.speed > 0
        rests = playback.root[:, :2] + rolling_distance(playback, self.gaits.settings)
        wanted = target[:, :2]
        velocity = kept_apart(rests, target_before[:, :2], wanted, moves, room, self.avoidance)
        # those that need not change anything go on exactly as they do
        changes = moves & (velocity != wanted).any(axis=1)
        pace = np.hypot(*velocity.T)
        goes = pace > self.avoidance.waits
        way = np.arctan2(*velocity.T)
        # they face the way around others, unless it leads aside or back
        faces_way = changes & goes & (command.facing == command.direction)
        along = faces_way & (np.abs(wrapped(way - command.direction)) < self.gaits.settings.aside)
        return replace(
            command,
            speed=np.where(changes, np.where(goes, pace, 0.0), command.speed),
            direction=np.where(changes & goes, way, command.direction),
            facing=np.where(along, way, np.where(changes, target[:, 2], command.facing)),
        )


def _slowed(gaits: Gaits, gait: Rows, gait_now: Rows, speed: Array) -> Rows:
    """The gaits (B,) of figures that are to go at speeds (B,) in gaits (B,): the slowest that goes any way, where
    theirs is too fast for the speed; and the present ones, where they stand."""
    slowest = gaits.speeds[:, 0]
    slow_gait = np.where(gaits.ahead, np.inf, slowest).argmin()
    too_fast = (speed < slowest[gait]) & (slowest[slow_gait] < slowest[gait])
    return np.where(speed > 0, np.where(too_fast, slow_gait, gait), gait_now)


def rolling_distance(playback: Playback, steering: SteeringSettings) -> Array:
    """How far (B, 2) figures still go whose target is standing: the integral of the spring."""
    damping = damping_of(steering.velocity)
    return (2 * playback.spring[:, :2] + playback.spring_rate[:, :2] / damping) / damping
