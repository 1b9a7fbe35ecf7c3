"""Motion matching: which recorded frame a steered figure plays next.

A table holds rows, one for each recorded frame. A few times a second the row is searched that fits best: its feet and
hips are as they are now, and where it goes in the next second is where the figure is asked to go (Clavet 2016; Buettner
and Clavet 2015). Every row stands for its mirror image, too. A jump to another row leaves no jump to be seen: what it
would change is added to the pose, and fades (inertialization: Bollo 2018).

Letters in shapes: B figures, N rows, K codes of a pose, F features, G gaits. The ground's axes are x and z; an angle
of 0 faces z, and positive ones are to the left (towards x). Units are metres, seconds and radians.
"""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.motion.rotations import Array, wrapped
from motet.motion.springs import damped, damped_path, damping_of
from motet.steering.settings import SteeringSettings

Rows = NDArray[np.int64]
ALL = slice(None)


@dataclass(eq=False)
class Playback:
    """Of B figures; K are the codes of a pose. Whole numbers are int64, others float64.

    row, part: (B,) the row that is played, and the part of the way to the next one. mirror: (B,) 1 for the mirror image
    of the row, else 0. rate: (B,) rows that are played in the next tick. ticks_to_search: (B,). in_turn: (B,) bool,
    whether a figure searches in its turn alone, or whenever it is told something.
    root: (B, 3) x, z in metres and facing in radians. spring, spring_rate: (B, 3) the springs that approach the target:
    velocity along x and z in m/s and facing in radians, and how fast they change. offset, offset_rate: (B, K) the
    inertialization offset of the codes, and how fast it changes. warp, warp_rate: (B,) radians by which hips and legs
    are turned towards the direction of travel, and how fast that changes. stride, stride_rate: (B,) how long the legs'
    strides are beside the recorded ones, and how fast that changes.
    """

    row: Rows
    part: Array
    mirror: Rows
    rate: Array
    ticks_to_search: Rows
    in_turn: NDArray[np.bool_]
    root: Array
    spring: Array
    spring_rate: Array
    offset: Array
    offset_rate: Array
    warp: Array
    warp_rate: Array
    stride: Array
    stride_rate: Array

    @staticmethod
    def at(row: int, figures: int, codes: int, phases: Rows | None = None) -> "Playback":
        """Figures at the origin that play a row, and search in the next tick; or each after as many as its phase
        (figures,), and from then on in its turn alone."""
        zero, ground, pose = (np.zeros(shape) for shape in (figures, (figures, 3), (figures, codes)))
        rows, count = np.full(figures, row, dtype=np.int64), np.zeros(figures, dtype=np.int64)
        ticks, in_turn = count if phases is None else phases, np.full(figures, phases is not None)
        springs = [ground, ground, ground, pose, pose, zero, zero, zero + 1, zero]
        return Playback(rows, zero, count, zero + 1, ticks, in_turn, *springs).copy()

    def hasten(self, who: NDArray[np.bool_]) -> None:
        """Let those of figures (B,) that wait for no turn search in the next tick."""
        self.ticks_to_search[who & ~self.in_turn] = 0

    def copy(self) -> "Playback":
        """One that shares no array."""
        return Playback(*(getattr(self, field.name).copy() for field in fields(self)))


LEAST_PACE = 0.1
"""The slowest that a figure goes, m/s."""


def hurries(velocity: Array, creeps: NDArray[np.bool_], creep: float) -> Array:
    """What velocities over the ground, with a third number that stays, (n, 3) are multiplied by to be as fast as
    recordings: 1 for those that are, and for figures that do not creep (n,)."""
    pace = np.hypot(velocity[:, 0], velocity[:, 1])
    by = np.where(creeps & (pace < creep), creep / np.maximum(pace, min(LEAST_PACE, creep)), 1.0)
    return np.stack([by, by, np.ones_like(by)], axis=1)


def is_faster(speed: NDArray[Any], settings: SteeringSettings) -> bool:
    """Whether a gait is faster than a creep, by the speeds (n,) of its rows."""
    moving = np.sort(speed[speed > settings.idle])
    return len(moving) > 0 and bool(moving[len(moving) // 2] > settings.creep)


HORIZONS = 3
"""Number of times ahead at which trajectories are compared: thirds of the settings' horizon."""

TRAJECTORY = 4 * HORIZONS + 1
"""The features that say where a row goes: places (left, forward) at each of the horizons, facings (sin, cos), and the
speed at the second of them. The others say how it is now, all seen from the facing: places and velocities of the balls
of both feet, three numbers each, the hips' velocity, and the places of both hands."""

FEATURES = TRAJECTORY + 21

LAST = slice(2 * HORIZONS - 2, 2 * HORIZONS)
"""The features that say where a row leads at the last of the horizons: left and forward."""


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


STRIDE_ROWS = 15
"""Rows before and after a row that are a stride, over which the hips' sway is none."""


def stride_velocities(moves: NDArray[Any], left: Rows) -> Array:
    """The mean of a recording's velocities (N, 2), forward and left, over the stride around each row. left: as in
    :class:`Table`."""
    rows = np.arange(len(left))
    last = rows + left
    first = np.maximum(np.searchsorted(last, last), rows - STRIDE_ROWS).clip(max=rows)
    stop = np.minimum(last, rows + STRIDE_ROWS) + 1
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0, dtype=np.float64)])
    found: Array = (sums[stop] - sums[first]) / (stop - first)[:, None]
    return found


@dataclass(frozen=True, eq=False)
class Table:
    """What is recorded. frames and features begin with an axis of 2: the rows, and their mirror images.

    frames: (2, N, K + 6) float32 codes of the pose, velocity over the ground (forward, left, turn), speed, and how much
    the left and the right foot stand. features: (2, N, F) float32, from which ``mean`` (F,) has been subtracted, times
    ``scale`` (F,). way: (2, N) the angle from the facing to where a recording goes in the stride around a row.
    shows: (N, G) whether a row shows a gait. left: (N,) rows that follow in the same recording.
    """

    frames: Floats
    features: Floats
    way: Array
    shows: NDArray[np.bool_]
    left: Rows
    mean: Array
    scale: Array

    @staticmethod
    def of(frames: Floats, features: Floats, odd: int, left: Rows, **others: Any) -> "Table":
        """The table of frames (N, K + 6) and features (N, F): the last ``odd`` codes of a mirror image have the other
        sign. left, others: the other fields."""
        columns, signs = mirrored_features()
        width = frames.shape[1]
        turned = np.ones(width, dtype=np.float32)
        turned[width - 6 - odd : width - 6] = turned[[-5, -4]] = -1
        image = (frames * turned)[:, [*range(width - 2), width - 1, width - 2]]
        both = np.stack([features, features[:, columns] * signs])
        forward, aside = stride_velocities(frames[:, -6:-4], left).T
        way = np.arctan2(aside, forward)
        return Table(np.stack([frames, image]), both, np.stack([way, -way]), left=left, **others)

    @property
    def codes(self) -> int:
        """K."""
        return len(self.frames[0, 0]) - 6

    def at(self, playback: Playback, who: Rows | slice = ALL) -> tuple[Array, Array]:
        """What figures (n,) play (n, K + 6), between two rows, and by how much it changes from the one to the other."""
        mirror, row = playback.mirror[who], playback.row[who]
        first = self.frames[mirror, row].astype(np.float64)
        change = self.frames[mirror, row + 1] - first
        return first + playback.part[who, None] * change, change


class Goals(NamedTuple):
    """Rows of a gait (M,) that may be jumped to. costs: (T, F + 1, W) of them, followed by their mirror images, the
    features and half their squared length; in T tiles of W columns, the last filled up with what costs infinitely much.
    lags: (T, 3, W) the features that say where they lead, and ones."""

    rows: Rows
    costs: Floats
    lags: Floats

    @staticmethod
    def of(rows: Rows, columns: Floats, width: int) -> "Goals":
        """Those of rows (M,), of columns (2 M, F + 1), in tiles of a width."""
        costs = np.zeros((-(-len(columns) // width) * width, FEATURES + 1), dtype=np.float32)
        costs[:, -1] = np.inf
        costs[: len(columns)] = columns
        costs = np.ascontiguousarray(costs.reshape(-1, width, FEATURES + 1).swapaxes(1, 2))
        return Goals(rows, costs, np.concatenate([costs[:, LAST], np.ones_like(costs[:, :1])], axis=1))


class Query(NamedTuple):
    """What n figures look for, in float32 steps of 1 / ``Matcher.STEPS``: times a row's columns of :class:`Goals` it is
    what that row costs, more than a constant, and the lag, where it is above 0.

    features: (n, F + 1). lags: (n, 3)."""

    features: Floats
    lags: Floats


class Matcher:
    """Searches a table, and jumps.

    What is asked is rounded to 1 / ``STEPS`` of a feature's scaled unit, as features are to 1 / 16: products are then
    whole multiples of a number, and their sums as exact in float32 as they are small, below ``STEPS`` x 16. So a figure
    finds the same row alone as in a block, whatever the order in which a processor adds.
    """

    STEPS = 256
    LARGEST = 16.0
    """Features that are asked are no larger, on either side of 0."""

    BLOCK, TILE = 32, 224
    """Figures and columns of the products: they stay in a processor's cache, and OpenBLAS starts no threads for them,
    which on a busy machine wait for each other."""

    def __init__(self, table: Table, settings: SteeringSettings, fps: float) -> None:
        self.table, self.settings, self.fps = table, settings, fps
        # the rows that are played until the next search, at most
        self.reserve = int(np.ceil((settings.search_every + 1) * settings.fastest)) + 2
        self.least_left = max(self.reserve, settings.lasting)
        half: Floats = (table.features[0] ** 2).sum(axis=1) / 2
        self.costs = np.concatenate([table.features, np.stack([half, half])[..., None]], axis=2)
        self.flies = table.frames[0, :, -2:].max(axis=1) < settings.stands
        self.goals, speed = list[Goals](), table.frames[0, :, -3]
        # gaits that are recorded as slow as a creep have no need to
        self.creeps = np.array([is_faster(speed[shows], settings) for shows in table.shows.T], dtype=np.bool_)
        # what is played at its own rate leads to a leap, with arms that swing: it is entered well before
        leaps = (speed == 0) & (np.convolve(self.flies, np.ones(settings.prepares + 1))[settings.prepares :] > 0)
        for shows in table.shows.T:
            rows = np.flatnonzero(shows & (table.left >= self.least_left) & ~(self.flies | leaps))[:: settings.row_step]
            self.goals.append(Goals.of(rows, self.costs[:, rows].reshape(-1, FEATURES + 1), self.TILE))

    def stillest(self, gait: int) -> int:
        """The row of a gait in which there is the least speed; of those that something follows, on the ground."""
        rows = np.flatnonzero(self.table.shows[:, gait] & (self.table.left >= self.reserve) & ~self.flies)
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
        creeps = self.creeping(target[who], kind)
        trajectory = self.desired_trajectory(playback, target, creeps, who)
        query = self.query(self.asked(trajectory, row, mirror))
        best, image, cost = self.best(query, kind)
        near = (best >= row - self.settings.jump_back) & (best <= row + self.settings.jump_ahead)  # on either side
        bias = np.where(creeps, 0, self.settings.continuing)
        fits = self.table.shows[row, kind] & (near | (self.cost_at(query, row, mirror) <= cost + bias))
        stays = (self.flies[row] | fits) & (self.table.left[row] >= self.reserve)  # who flies lands first
        self.jump(playback, who[~stays], best[~stays], image[~stays])

    def creeping(self, target: Array, gait: Rows) -> NDArray[np.bool_]:
        """Which figures with targets (n, 3) in gaits (n,) are to go slower than recordings do."""
        pace = np.hypot(target[:, 0], target[:, 1])
        found: NDArray[np.bool_] = self.creeps[gait] & (pace >= LEAST_PACE / 2) & (pace < self.settings.creep)
        return found

    def desired_trajectory(
        self, playback: Playback, target: Array, creeps: NDArray[np.bool_], who: Rows | slice = ALL
    ) -> Array:
        """Where the springs of figures (n,) lead: features (n, TRAJECTORY), not yet scaled. creeps: (n,)."""
        how, facing, target = self.settings, playback.root[who, 2], target[who]
        cos, sin = np.cos(facing), np.sin(facing)
        spring, rate = playback.spring[who], playback.spring_rate[who]
        hurry = hurries(spring, creeps, how.creep)
        target = target * hurries(target, creeps, how.creep)
        off, rate = spring * hurry - target, rate * hurry
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

    def asked(self, trajectory: Array, row: Rows, mirror: Rows) -> Floats:
        """Features (n, F) of trajectories (n, TRAJECTORY) that are not yet scaled, from the poses of rows (n,)."""
        found = self.table.features[mirror, row]
        found[:, :TRAJECTORY] = (trajectory - self.table.mean[:TRAJECTORY]) * self.table.scale[:TRAJECTORY]
        return found

    def query(self, asked: Floats) -> Query:
        """What is looked for, of features (n, F) that are asked."""
        asked, scale, mean = self._rounded(asked.clip(-self.LARGEST, self.LARGEST)), self.table.scale, self.table.mean
        place = asked[:, LAST] / scale[LAST] + mean[LAST]
        far = np.hypot(place[:, 0], place[:, 1])
        way = place * (self.settings.lag / np.maximum(far, 1e-6))[:, None]
        lacks = far * self.settings.lag / 2 - (way * mean[LAST]).sum(axis=1)
        lags = self._rounded(np.column_stack([-way / scale[LAST], lacks]))
        return Query(np.concatenate([-asked, np.ones_like(asked[:, :1])], axis=1), lags)

    def _rounded(self, values: NDArray[Any]) -> Floats:
        found: Floats = (np.rint(values * self.STEPS) / self.STEPS).astype(np.float32)
        return found

    def best(self, query: Query, gait: Rows) -> tuple[Rows, Rows, Floats]:
        """For what n figures look for and gaits (n,) the row (n,), 1 where it is mirrored (n,), and its cost (n,)."""
        (row, mirror), cost = np.empty((2, len(gait)), np.int64), np.empty(len(gait), np.float32)
        for kind in set(gait.tolist()):
            goals, figures = self.goals[kind], np.flatnonzero(gait == kind)
            for start in range(0, len(figures), self.BLOCK):
                who = figures[start : start + self.BLOCK]
                costs, lags = np.empty((2, len(who), len(goals.costs), self.TILE), np.float32)
                np.matmul(query.features[who], goals.costs, out=costs.swapaxes(0, 1))
                np.matmul(query.lags[who], goals.lags, out=lags.swapaxes(0, 1))
                costs = np.add(costs, np.maximum(lags, 0, out=lags), out=costs).reshape(len(who), -1)
                column = costs.argmin(axis=1)
                mirror[who], place = np.divmod(column, len(goals.rows))
                row[who], cost[who] = goals.rows[place], costs[np.arange(len(who)), column]
        return row, mirror, cost

    def cost_at(self, query: Query, row: Rows, mirror: Rows) -> Floats:
        """The cost (n,) of given rows, as :meth:`best` gives it."""
        own = self.costs[mirror, row]
        lag = (query.lags[:, :2] * own[:, LAST]).sum(axis=1) + query.lags[:, 2]
        found: Floats = (query.features * own).sum(axis=1) + np.maximum(lag, 0)
        return found

    def jump(self, playback: Playback, who: Rows, row: Rows, mirror: Rows) -> None:
        """Let figures (n,) continue from rows (n,) and mirror images (n,); what their poses lose goes into the
        inertialization offset."""
        if not len(who):
            return
        before, speed = self._codes(playback, who)
        playback.row[who], playback.part[who], playback.mirror[who] = row, 0, mirror
        after, speed_after = self._codes(playback, who)
        playback.offset[who] += before - after
        playback.offset_rate[who] += speed - speed_after

    def pose(self, playback: Playback, codes: Array) -> None:
        """Let all figures have the codes (B, K) of another pose; they come back to what they play."""
        now, _ = self._codes(playback)
        playback.offset, playback.offset_rate = codes - now, np.zeros_like(now)
        playback.warp, playback.warp_rate = np.zeros((2, len(now)))

    def _codes(self, playback: Playback, who: Rows | slice = ALL) -> tuple[Array, Array]:
        """The codes (n, K) that figures (n,) play, and how fast they change, a second."""
        now, change = self.table.at(playback, who)
        return now[:, : self.table.codes], change[:, : self.table.codes] * self.fps
