"""Motion matching: which recorded frame a steered figure plays next.

A table holds rows, one for each recorded frame. A few times a second the row is searched that fits best: its feet and
hips are as they are now, and where it goes in the next second is where the figure is asked to go (Clavet 2016; Buettner
and Clavet 2015). Every row stands for its mirror image, too. A jump to another row leaves no jump to be seen: what it
would change is added to the pose, and fades (inertialization: Bollo 2018).

Letters in shapes: B figures, N rows, K codes of a pose, F features, G gaits. The ground's axes are x and z; an angle
of 0 faces z, and positive ones are to the left (towards x). Units are metres, seconds and radians.
"""

from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.motion.pose import damped, damped_path, damping_of
from motet.motion.rotations import Array, wrapped
from motet.settings import Range, Settings

HalfLife = Annotated[float, Range(0.01, 10, "s")]
Radians = Annotated[float, Range(0, 3.15, "rad")]
Share = Annotated[float, Range(0, 1)]
Factor = Annotated[float, Range(0, 100)]
Count = Annotated[int, Range(0, 10_000, "rows")]


@dataclass(frozen=True)
class SteeringSettings(Settings):
    """Settings of a figure steered by motion matching.

    The desired trajectory:
        velocity, facing: half-lives of the springs by which target velocity and facing are approached.
        horizon: how far ahead rows are compared with it, at each third. half_speed: the speed that is half way from
        standing to any speed, on the scale on which speeds are compared.

    The search:
        search_every: ticks between searches. lag: the cost of each metre by which a row covers less than half the
        desired displacement within the horizon (others start, or turn aside, if not as smoothly). lasting: the fewest
        rows left after a jump target. jump_back, jump_ahead: jumps within this window are ignored, or playback would
        loop on the spot. row_step: one in so many rows is a jump target. stands: the least contact of a foot in rows
        that are jumped to and from, so that flights are played to their end.

    The step:
        blend: half-life of the inertialization offset. slowest, fastest: limits of the playback rate. shortest,
        longest: limits of the stride, relative to the recorded one. idle: speed below which a row is played as it is.
        turn: half-life of the error of the facing; turn_still, turn_moving, turn_turning: limits of its correction, in
        rad/s at a standstill, for each m/s up to turn_speed, and for each rad/s of the recorded turn.
        veer: the largest correction of the direction of travel; veer_within: it is made where the cosine of the angle
        is above this share of its sine.

    What gaits can do:
        aside, back: angles from the facing at which going sideways and going backwards begin. ahead: how far from its
        facing a gait goes that goes neither way.
    """

    FEATURE: ClassVar[str] = "steering"

    velocity: HalfLife = 0.22
    facing: HalfLife = 0.18
    horizon: Annotated[float, Range(0.1, 10, "s")] = 1.0
    half_speed: Annotated[float, Range(0.01, 100, "m/s")] = 0.7
    search_every: Annotated[int, Range(1, 60, "ticks")] = 6
    lag: Annotated[float, Range(0, 1e6, "per metre")] = 50.0
    lasting: Count = 20
    jump_back: Count = 20
    jump_ahead: Count = 5
    row_step: Annotated[int, Range(1, 100, "rows")] = 2
    stands: Share = 0.1
    blend: HalfLife = 0.13
    slowest: Annotated[float, Range(0.1, 1)] = 0.8
    fastest: Annotated[float, Range(1, 10)] = 1.15
    shortest: Annotated[float, Range(0.1, 1)] = 0.8
    longest: Annotated[float, Range(1, 10)] = 1.25
    idle: Annotated[float, Range(0.01, 100, "m/s")] = 0.4
    turn: HalfLife = 0.15
    turn_still: Factor = 0.1
    turn_moving: Factor = 1.0
    turn_speed: Annotated[float, Range(0, 100, "m/s")] = 1.5
    turn_turning: Factor = 0.5
    veer: Radians = 0.35
    veer_within: Factor = 0.4
    aside: Radians = 1.0471975511965976
    back: Radians = 2.0943951023931953
    ahead: Radians = 0.5235987755982988


Rows = NDArray[np.int64]


@dataclass(eq=False)
class Playback:
    """Of B figures; K are the codes of a pose. Whole numbers are int64, others float64.

    row, part: (B,) the row that is played, and the part of the way to the next one. mirror: (B,) 1 for the mirror image
    of the row, else 0. rate: (B,) rows that are played in the next tick. ticks_to_search: (B,).
    root: (B, 3) x, z in metres and facing in radians. spring, spring_rate: (B, 3) the springs that approach the target:
    velocity along x and z in m/s and facing in radians, and how fast they change. offset, offset_rate: (B, K) the
    inertialization offset of the codes, and how fast it changes.
    """

    row: Rows
    part: Array
    mirror: Rows
    rate: Array
    ticks_to_search: Rows
    root: Array
    spring: Array
    spring_rate: Array
    offset: Array
    offset_rate: Array

    @staticmethod
    def at(row: int, figures: int, codes: int) -> "Playback":
        """Figures at the origin that play a row, and search in the next tick."""
        # all search in the same tick: each moves as it would alone
        whole, ground, pose = (np.zeros(shape) for shape in (figures, (figures, 3), (figures, codes)))
        rows, count = np.full(figures, row, dtype=np.int64), np.zeros(figures, dtype=np.int64)
        found = Playback(rows, whole, count, whole + 1, count, ground, ground, ground, pose, pose)
        return found.copy()

    def copy(self) -> "Playback":
        """One that shares no array."""
        return Playback(*(getattr(self, field.name).copy() for field in fields(self)))


HORIZONS = 3
"""Number of times ahead at which trajectories are compared: thirds of the settings' horizon."""

TRAJECTORY = 4 * HORIZONS + 1
"""The features that say where a row goes: places (left, forward) at each of the horizons, facings (sin, cos), and the
speed at the second of them. The others say how it is now, all seen from the facing: places and velocities of the balls
of both feet, three numbers each, the hips' velocity, and the places of both hands."""

FEATURES = TRAJECTORY + 21


def mirrored_features() -> tuple[NDArray[np.intp], Floats]:
    """Of which columns (F,), with which signs (F,), the features of a mirror image are made."""
    pair, three = [-1.0, 1.0], [-1.0, 1.0, 1.0]
    now = np.arange(7).reshape(7, 1) * 3 + np.arange(3)  # feet, their velocities, the hips', hands
    columns = [*range(TRAJECTORY), *(TRAJECTORY + now[[1, 0, 3, 2, 4, 6, 5]].ravel()).tolist()]
    signs = pair * (2 * HORIZONS) + [1.0] + three * 7
    return np.array(columns), np.array(signs, dtype=np.float32)


def horizons(settings: SteeringSettings) -> list[float]:
    """The times ahead, in seconds."""
    return [settings.horizon * (n + 1) / HORIZONS for n in range(HORIZONS)]


def speed_feature(speed: NDArray[Any], settings: SteeringSettings) -> NDArray[Any]:
    """Speeds (...) in m/s on a scale on which a slow walk is as far from standing as a run from a walk."""
    found: NDArray[Any] = speed / (speed + settings.half_speed)
    return found


@dataclass(frozen=True, eq=False)
class Table:
    """What is recorded. frames and features begin with an axis of 2: the rows, and their mirror images.

    frames: (2, N, K + 6) float32 codes of the pose, velocity over the ground (forward, left, turn), speed, and how much
    the left and the right foot stand. features: (2, N, F) float32, from which ``mean`` (F,) has been subtracted, times
    ``scale`` (F,). shows: (N, G) whether a row shows a gait. left: (N,) rows that follow in the same recording.
    """

    frames: Floats
    features: Floats
    shows: NDArray[np.bool_]
    left: Rows
    mean: Array
    scale: Array

    @staticmethod
    def of(frames: Floats, features: Floats, odd: int, **others: Any) -> "Table":
        """The table of frames (N, K + 6) and features (N, F): the last ``odd`` codes of a mirror image have the other
        sign. others: the other fields."""
        columns, signs = mirrored_features()
        width = frames.shape[1]
        turned = np.ones(width, dtype=np.float32)
        turned[width - 6 - odd : width - 6] = turned[[-5, -4]] = -1
        image = (frames * turned)[:, [*range(width - 2), width - 1, width - 2]]
        both = np.stack([features, features[:, columns] * signs])
        return Table(np.stack([frames, image]), both, **others)

    @property
    def codes(self) -> int:
        """K."""
        return len(self.frames[0, 0]) - 6

    def at(self, playback: Playback) -> tuple[Array, Array]:
        """What is played (B, K + 6), between two rows, and by how much it changes from the one to the other."""
        first = self.frames[playback.mirror, playback.row].astype(np.float64)
        change = self.frames[playback.mirror, playback.row + 1] - first
        return first + playback.part[:, None] * change, change

    def places(self, features: NDArray[Any]) -> NDArray[Any]:
        """Where features (..., F) lead at the last of the horizons (..., 2): left and forward, metres."""
        last = slice(2 * HORIZONS - 2, 2 * HORIZONS)
        found: NDArray[Any] = features[..., last] / self.scale[last] + self.mean[last]
        return found


class Goals(NamedTuple):
    """Rows of a gait (M,) that may be jumped to; and of them, followed by their mirror images, the features (F, 2 M),
    half their squared length (2 M,), and where they lead (2 M, 2)."""

    rows: Rows
    features: Floats
    half: Floats
    places: Floats


class Matcher:
    """Searches a table, and jumps."""

    def __init__(self, table: Table, settings: SteeringSettings, fps: float) -> None:
        self.table, self.settings, self.fps = table, settings, fps
        # the rows that are played until the next search, at most
        self.reserve = int(np.ceil((settings.search_every + 1) * settings.fastest)) + 2
        self.least_left = max(self.reserve, settings.lasting)
        self.half: Floats = (table.features[0] ** 2).sum(axis=1) / 2
        self.flies = table.frames[0, :, -2:].max(axis=1) < settings.stands
        self.goals = []
        for shows in table.shows.T:
            rows = np.flatnonzero(shows & (table.left >= self.least_left) & ~self.flies)[:: settings.row_step]
            features = table.features[:, rows].reshape(-1, FEATURES)
            places = table.places(features).astype(np.float32)
            self.goals.append(Goals(rows, np.ascontiguousarray(features.T), np.tile(self.half[rows], 2), places))

    def stillest(self, gait: int) -> int:
        """The row of a gait in which there is the least speed; of those that something follows."""
        rows = np.flatnonzero(self.table.shows[:, gait] & (self.table.left >= self.reserve))
        return int(rows[self.table.frames[0, rows, -3].argmin()])

    def search(self, playback: Playback, target: Array, gait: Rows) -> None:
        """Let the figures whose search is due jump to the rows that fit best, where others than their own do.

        target: (B, 3) velocity along x and z, and facing. gait: (B,).
        """
        who = np.flatnonzero(playback.ticks_to_search <= 0)
        playback.ticks_to_search -= 1
        if not len(who):
            return
        playback.ticks_to_search[who] = self.settings.search_every - 1
        row, mirror, kind = playback.row[who] + (playback.part[who] > 0.5), playback.mirror[who], gait[who]
        query = self.table.features[mirror, row]
        wanted = self.desired_trajectory(playback, target)[who]
        query[:, :TRAJECTORY] = (wanted - self.table.mean[:TRAJECTORY]) * self.table.scale[:TRAJECTORY]
        best, image, cost = self.best(query, kind)
        stays = self.table.shows[row, kind] & (self.table.left[row] >= self.reserve)
        near = (best >= row - self.settings.jump_back) & (best <= row + self.settings.jump_ahead)  # on either side
        stays &= near | self.flies[row] | (self.cost_at(query, row, mirror) <= cost)
        self.jump(playback, who[~stays], best[~stays], image[~stays])

    def desired_trajectory(self, playback: Playback, target: Array) -> Array:
        """Where the springs lead: features (B, TRAJECTORY), not yet scaled."""
        how, facing = self.settings, playback.root[:, 2]
        cos, sin = np.cos(facing), np.sin(facing)
        off, rate = playback.spring - target, playback.spring_rate
        travel, turns = (off[:, :2], rate[:, :2]), (wrapped(off[:, 2]), rate[:, 2])
        slow, calm = damping_of(how.velocity), damping_of(how.facing)
        places, facings, times = [], [], horizons(how)
        for time in times:
            x, z = (target[:, :2] * time + damped_path(*travel, slow, time)).T
            angle = target[:, 2] + damped(*turns, calm, time)[0] - facing
            places += [cos * x - sin * z, sin * x + cos * z]
            facings += [np.sin(angle), np.cos(angle)]
        speed = np.hypot(*(target[:, :2] + damped(*travel, slow, times[1])[0]).T)
        return np.stack([*places, *facings, speed_feature(speed, how)], axis=1)

    def best(self, query: Floats, gait: Rows) -> tuple[Rows, Rows, Floats]:
        """For features (n, F) and gaits (n,) the row (n,), 1 where it is mirrored (n,), and its cost (n,)."""
        row, mirror, cost = np.empty(len(gait), np.int64), np.empty(len(gait), np.int64), np.empty_like(query[:, 0])
        # each by itself: how a product rounds depends on how many rows it has
        for one, kind in enumerate(gait.tolist()):
            goals, (way, far) = self.goals[kind], self._way(query[one])
            lag = np.maximum(far / 2 - goals.places @ way, 0)
            costs = goals.half + np.float32(self.settings.lag) * lag - query[one] @ goals.features
            at = int(costs.argmin())
            mirror[one], place = divmod(at, len(goals.rows))
            row[one], cost[one] = goals.rows[place], costs[at]
        return row, mirror, cost

    def cost_at(self, query: Floats, row: Rows, mirror: Rows) -> Floats:
        """The cost (n,) of given rows, as :meth:`best` gives it."""
        own = self.table.features[mirror, row]
        way, far = self._way(query)
        lag = np.maximum(far / 2 - (way * self.table.places(own)).sum(axis=1), 0)
        found: Floats = self.half[row] + self.settings.lag * lag - (query * own).sum(axis=1)
        return found

    def _way(self, query: Floats) -> tuple[Floats, Floats]:
        """The direction (..., 2) and how far (...) features (..., F) lead at the last of the horizons."""
        places: Floats = self.table.places(query).astype(np.float32)
        far: Floats = np.hypot(places[..., 0], places[..., 1])
        return (places / np.maximum(far, np.float32(1e-6))[..., None]).astype(np.float32), far

    def jump(self, playback: Playback, who: Rows, row: Rows, mirror: Rows) -> None:
        """Let figures (n,) continue from rows (n,) and mirror images (n,); what their poses lose goes into the
        inertialization offset."""
        if not len(who):
            return
        before, speed = self._codes(playback)
        playback.row[who], playback.part[who], playback.mirror[who] = row, 0, mirror
        after, speed_after = self._codes(playback)
        playback.offset = playback.offset + (before - after)
        playback.offset_rate = playback.offset_rate + (speed - speed_after)

    def pose(self, playback: Playback, codes: Array) -> None:
        """Let all figures have the codes (B, K) of another pose; they come back to what they play."""
        now, _ = self._codes(playback)
        playback.offset, playback.offset_rate = codes - now, np.zeros_like(now)

    def _codes(self, playback: Playback) -> tuple[Array, Array]:
        """The codes (B, K) that are played, and how fast they change, a second."""
        now, change = self.table.at(playback)
        return now[:, : self.table.codes], change[:, : self.table.codes] * self.fps
