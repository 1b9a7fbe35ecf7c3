"""Motion matching: which recorded frame a steered figure plays next.

A table holds rows, one for each recorded frame. A few times a second the row is searched that fits best: its feet and
hips are as they are now, and where it goes in the next second is where the figure is steered (Clavet 2016; Buettner
and Clavet 2015). Every row stands for its mirror image, too. No jump to another row shows: the difference is added to
the pose, and fades (inertialization: Bollo 2018).

Letters in shapes: B figures, n of them, N rows, K codes of a pose, F features, G gaits. The ground's axes are x and z;
an angle of 0 faces z, and positive ones are to the left (towards x). Units are metres, seconds and radians.
"""

from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.motion.rotations import Array, wrapped
from motet.motion.springs import Inertializer, damped, damped_path, damping_of
from motet.steering.pose import seen
from motet.steering.settings import SteeringSettings

Rows = NDArray[np.int64]
Flags = NDArray[np.bool_]
ALL = slice(None)


@dataclass(eq=False)
class Playback:
    """What B figures play, and how they move. Whole numbers are int64, others float64."""

    row: Rows
    """(B,) the row that is played."""
    part: Array
    """(B,) the part of the way to the next row, 0 to 1."""
    mirror: Rows
    """(B,) 1 where the mirror image of the row is played, else 0."""
    rate: Array
    """(B,) the playback rate: rows that are played in the next tick."""
    ticks_to_search: Rows
    """(B,) ticks until the next search."""
    in_turn: Flags
    """(B,) whether a figure searches in its turn alone, or also after every command."""
    root: Array
    """(B, 3) x and z in metres, and facing in radians."""
    spring: Array
    """(B, 3) the springs that approach the target: velocity along x and z in m/s, and facing in radians."""
    spring_rate: Array
    """(B, 3) how fast the springs change, a second."""
    offset: Array
    """(B, K) the inertialization offset of the codes."""
    offset_rate: Array
    """(B, K) how fast the offset changes, a second."""
    warp: Array
    """(B,) radians by which hips and legs are turned towards the direction of travel."""
    warp_rate: Array
    """(B,) how fast the warp changes, a second."""
    stride: Array
    """(B,) length of the legs' strides, relative to the recorded ones."""
    stride_rate: Array
    """(B,) how fast the stride changes, a second."""

    @staticmethod
    def at(row: int, figures: int, codes: int, phases: Rows | None = None) -> "Playback":
        """Figures at the origin that play a row.

        phases: (figures,) ticks until the first search, after which a figure searches in its turn alone. By default all
        search in the next tick.
        """
        zero = np.zeros(figures)
        ground = np.zeros((figures, 3))
        no_offset = np.zeros((figures, codes))
        playback = Playback(
            row=np.full(figures, row, dtype=np.int64),
            part=zero,
            mirror=zero.astype(np.int64),
            rate=zero + 1,
            ticks_to_search=zero.astype(np.int64) if phases is None else phases,
            in_turn=np.full(figures, phases is not None),
            root=ground,
            spring=ground,
            spring_rate=ground,
            offset=no_offset,
            offset_rate=no_offset,
            warp=zero,
            warp_rate=zero,
            stride=zero + 1,
            stride_rate=zero,
        )
        return playback.copy()

    @property
    def pace(self) -> Array:
        """(B,) how fast the springs go, m/s."""
        return np.hypot(self.spring[:, 0], self.spring[:, 1])

    def restart(self, figures: Rows, row: Rows, mirror: Rows) -> None:
        """Let figures (n,) play rows (n,) and mirror images (n,) as they are recorded."""
        self.row[figures] = row
        self.mirror[figures] = mirror
        for values in (self.part, self.offset, self.offset_rate, self.warp, self.warp_rate, self.stride_rate):
            values[figures] = 0
        self.rate[figures] = 1
        self.stride[figures] = 1

    def hasten(self, changed: Flags) -> None:
        """Let figures (B,) search in the next tick, unless they search in their turn alone."""
        self.ticks_to_search[changed & ~self.in_turn] = 0

    def copy(self) -> "Playback":
        """A copy that shares no array."""
        return Playback(*(getattr(self, field.name).copy() for field in fields(self)))


LEAST_PACE = 0.1
"""The slowest that a figure goes, m/s."""


def pace_factors(velocity: Array, slow_walk: Flags, recorded_pace: float) -> Array:
    """Factors (n, 3) that make velocities over the ground (n, 3), with a third number that stays, as fast as
    recordings: 1 for those that are, and for figures without a slow walk (n,)."""
    pace = np.hypot(velocity[:, 0], velocity[:, 1])
    factor = recorded_pace / np.maximum(pace, min(LEAST_PACE, recorded_pace))
    factor = np.where(slow_walk & (pace < recorded_pace), factor, 1.0)
    return np.stack([factor, factor, np.ones_like(factor)], axis=1)


def is_faster(speed: NDArray[Any], settings: SteeringSettings) -> bool:
    """Whether a gait is faster than a slow walk, by the speeds (n,) of its rows."""
    moving = np.sort(speed[speed > settings.idle])
    return len(moving) > 0 and bool(moving[len(moving) // 2] > settings.creep)


HORIZONS = 3
"""Number of times ahead at which trajectories are compared: thirds of the settings' horizon."""

TRAJECTORY = 4 * HORIZONS + 1
"""Number of features of a row's trajectory: places (left, forward) at each of the horizons, facings (sin, cos), and the
speed at the second of them. The features after them are of the pose, all seen from the facing: places and velocities of
the balls of both feet, three numbers each, the hips' velocity, and the places of both hands."""

FEATURES = TRAJECTORY + 21

LAST = slice(2 * HORIZONS - 2, 2 * HORIZONS)
"""The features of the place at the last of the horizons: left and forward."""


def mirrored_features() -> tuple[NDArray[np.intp], Floats]:
    """The columns (F,) and signs (F,) that make the features of a mirror image."""
    pair = [-1.0, 1.0]
    three = [-1.0, 1.0, 1.0]
    pose_columns = np.arange(7).reshape(7, 1) * 3 + np.arange(3)  # feet, their velocities, the hips', hands
    swapped = TRAJECTORY + pose_columns[[1, 0, 3, 2, 4, 6, 5]].ravel()
    columns = [*range(TRAJECTORY), *swapped.tolist()]
    signs = pair * (2 * HORIZONS) + [1.0] + three * 7
    return np.array(columns), np.array(signs, dtype=np.float32)


def horizons(settings: SteeringSettings) -> list[float]:
    """The times ahead, in seconds."""
    return [settings.horizon * (n + 1) / HORIZONS for n in range(HORIZONS)]


def speed_feature(speed: NDArray[Any], settings: SteeringSettings) -> NDArray[Any]:
    """Speeds (...) in m/s on a scale on which a slow walk is as far from standing as a run from a walk."""
    feature: NDArray[Any] = speed / (speed + settings.half_speed)
    return feature


STRIDE_ROWS = 15
"""Rows before and after a row that make up a stride, over which the hips' sway is none."""


def stride_velocities(moves: NDArray[Any], left: Rows) -> Array:
    """The mean of a recording's velocities (N, 2), forward and left, over the stride around each row. left: as in
    :class:`Table`."""
    rows = np.arange(len(left))
    last = rows + left
    first = np.maximum(np.searchsorted(last, last), rows - STRIDE_ROWS).clip(max=rows)
    stop = np.minimum(last, rows + STRIDE_ROWS) + 1
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(moves, axis=0, dtype=np.float64)])
    velocities: Array = (sums[stop] - sums[first]) / (stop - first)[:, None]
    return velocities


@dataclass(frozen=True, eq=False)
class Table:
    """The recordings. The first axis of frames and features, of 2, holds the rows and their mirror images."""

    frames: Floats
    """(2, N, K + 6) codes of the pose, velocity over the ground (forward, left, turn), speed, and contacts of the left
    and the right foot."""
    features: Floats
    """(2, N, F) features, from which ``mean`` has been subtracted, times ``scale``."""
    way: Array
    """(2, N) the angle from the facing to where a recording goes in the stride around a row."""
    shows: Flags
    """(N, G) whether a row shows a gait."""
    left: Rows
    """(N,) rows that follow in the same recording."""
    mean: Array
    """(F,)"""
    scale: Array
    """(F,)"""

    @staticmethod
    def of(frames: Floats, features: Floats, odd: int, left: Rows, **others: Any) -> "Table":
        """The table of frames (N, K + 6) and features (N, F): the last ``odd`` codes of a mirror image have the other
        sign. left, others: the other fields."""
        # mirror images of the frames: odd codes, velocity to the left and turn change sign, contacts change places
        width = frames.shape[1]
        frame_signs = np.ones(width, dtype=np.float32)
        frame_signs[width - 6 - odd : width - 6] = -1
        frame_signs[[-5, -4]] = -1
        frame_columns = [*range(width - 2), width - 1, width - 2]
        mirrored_frames = (frames * frame_signs)[:, frame_columns]
        # and of the features
        columns, signs = mirrored_features()
        mirrored = features[:, columns] * signs
        # where recordings go
        forward, aside = stride_velocities(frames[:, -6:-4], left).T
        way = np.arctan2(aside, forward)
        return Table(
            np.stack([frames, mirrored_frames]),
            np.stack([features, mirrored]),
            np.stack([way, -way]),
            left=left,
            **others,
        )

    @property
    def codes(self) -> int:
        """K."""
        return len(self.frames[0, 0]) - 6

    def at(self, playback: Playback, figures: Rows | slice = ALL) -> tuple[Array, Array]:
        """The frames (n, K + 6) that figures (n,) play, between two rows, and the change from the first to the
        second."""
        mirror = playback.mirror[figures]
        row = playback.row[figures]
        first = self.frames[mirror, row].astype(np.float64)
        change = self.frames[mirror, row + 1] - first
        return first + playback.part[figures, None] * change, change


class Goals(NamedTuple):
    """Rows of a gait (M,) that may be jumped to, and what a :class:`Query` is multiplied by to have their costs, in T
    tiles of W columns: those of the rows and of their mirror images, the last tile filled up with infinite costs."""

    rows: Rows
    """(M,)"""
    costs: Floats
    """(T, F + 1, W) features, and half their squared length."""
    lags: Floats
    """(T, 3, W) the features of the place at the last of the horizons, and ones."""

    @staticmethod
    def of(rows: Rows, columns: Floats, width: int) -> "Goals":
        """The goals of rows (M,) with columns (2 M, F + 1), in tiles of a width."""
        costs = np.zeros((-(-len(columns) // width) * width, FEATURES + 1), dtype=np.float32)
        costs[:, -1] = np.inf
        costs[: len(columns)] = columns
        tiles = np.ascontiguousarray(costs.reshape(-1, width, FEATURES + 1).swapaxes(1, 2))
        lags = np.concatenate([tiles[:, LAST], np.ones_like(tiles[:, :1])], axis=1)
        return Goals(rows, tiles, lags)


class Query(NamedTuple):
    """The desired features of n figures, in float32 steps of 1 / ``Matcher.STEPS``. Their product with a row's columns
    of :class:`Goals` is the row's cost, less a constant; the lag adds to it where it is above 0."""

    features: Floats
    """(n, F + 1)"""
    lags: Floats
    """(n, 3)"""


class Matched(NamedTuple):
    """The rows that B figures play."""

    row: Rows
    """(B,) of the bundle's table."""
    mirrored: Flags
    """(B,) whether as its mirror image."""
    cost: Array
    """(B,) of that row for the present target, 0 for a perfect fit: half its squared distance in scaled features, and
    the cost of its lag."""
    path: Array
    """(B, 3, 2) where the figure is to be after a third, two thirds and the whole of the horizon, x and z in metres."""


class Matcher:
    """Searches a table, and jumps.

    Desired features are rounded to 1 / ``STEPS`` of a feature's scaled unit, as features are to 1 / 16: products are
    then whole multiples of a number, and their sums exact in float32 as long as they are below ``STEPS`` x 16. So a
    figure is matched with the same row alone and in a block, whatever the order in which a processor adds.
    """

    STEPS = 256
    LARGEST = 16.0
    """Desired features are limited to this, on either side of 0."""

    BLOCK = 32
    """Figures of a product: with TILE columns it stays in a processor's cache, and OpenBLAS starts no threads for it,
    which on a busy machine wait for each other."""
    TILE = 224

    def __init__(self, table: Table, settings: SteeringSettings, fps: float) -> None:
        self.table = table
        self.settings = settings
        self.fps = fps
        self.inertializer = Inertializer(settings.blend)
        # the rows that are played until the next search, at most
        self.reserve = int(np.ceil((settings.search_every + 1) * settings.fastest)) + 2
        self.least_left = max(self.reserve, settings.lasting)
        half_square: Floats = (table.features[0] ** 2).sum(axis=1) / 2
        self.costs = np.concatenate([table.features, np.stack([half_square, half_square])[..., None]], axis=2)
        self.flies = table.frames[0, :, -2:].max(axis=1) < settings.stands
        # slow walks: a gait with slow recordings needs no time-stretching
        speed = table.frames[0, :, -3]
        self.stretched = np.array([is_faster(speed[shows], settings) for shows in table.shows.T], dtype=np.bool_)
        self.goals = self._goals()

    def _goals(self) -> list[Goals]:
        """The rows of each gait that may be jumped to."""
        table = self.table
        settings = self.settings
        speed = table.frames[0, :, -3]
        # rows just before take-off are no entry points: the arm swing would be cut
        flies_soon = np.convolve(self.flies, np.ones(settings.prepares + 1))[settings.prepares :] > 0
        leaps = (speed == 0) & flies_soon
        enterable = (table.left >= self.least_left) & ~(self.flies | leaps)
        goals = list[Goals]()
        for shows in table.shows.T:
            rows = np.flatnonzero(shows & enterable)[:: settings.row_step]
            columns = self.costs[:, rows].reshape(-1, FEATURES + 1)
            goals.append(Goals.of(rows, columns, self.TILE))
        return goals

    def stillest(self, gait: int) -> int:
        """The row of a gait with the least speed, among those on the ground that others follow."""
        rows = np.flatnonzero(self.table.shows[:, gait] & (self.table.left >= self.reserve) & ~self.flies)
        return int(rows[self.table.frames[0, rows, -3].argmin()])

    def search(self, playback: Playback, target: Array, gait: Rows) -> None:
        """Let the figures whose search is due jump to the rows that fit best, unless their present rows do.

        target: (B, 3) velocity along x and z, and facing. gait: (B,).
        """
        due = self._due(playback)
        if not len(due):
            return
        # the row that each plays, and what would be best
        gait = gait[due]
        slow_walk = self.is_slow_walk(target[due], gait)
        row, mirror, _, query = self._wanted(playback, target, slow_walk, due)
        best, best_mirror, best_cost = self.best(query, gait)
        # the present row is kept if the best one is hardly better, or so near that playback would loop on the spot
        cheap = self.cost_at(query, row, mirror) <= best_cost + np.where(slow_walk, 0, self.settings.continuing)
        fits = self.table.shows[row, gait] & (self._is_near(best, row) | cheap)
        # never leave a row in mid-air; always leave one whose recording is about to end
        stays = (self.flies[row] | fits) & (self.table.left[row] >= self.reserve)
        self.jump(playback, due[~stays], best[~stays], best_mirror[~stays])

    def _due(self, playback: Playback) -> Rows:
        """The figures (n,) whose search is due in this tick, which is counted."""
        due = np.flatnonzero(playback.ticks_to_search <= 0)
        playback.ticks_to_search -= 1
        playback.ticks_to_search[due] = self.settings.search_every - 1
        return due

    def _is_near(self, best: Rows, row: Rows) -> Flags:
        """Whether rows (n,) are too near to the present ones (n,) to be jumped to, mirrored or not."""
        return np.asarray((best >= row - self.settings.jump_back) & (best <= row + self.settings.jump_ahead))

    def _wanted(
        self, playback: Playback, target: Array, slow_walk: Flags, figures: Rows | slice
    ) -> tuple[Rows, Rows, Array, Query]:
        """The rows and mirror images (n,) that figures (n,) play, and their desired trajectories and query."""
        row = playback.row[figures] + (playback.part[figures] > 0.5)
        mirror = playback.mirror[figures]
        trajectory = self.desired_trajectory(playback, target, slow_walk, figures)
        return row, mirror, trajectory, self.query(self.desired_features(trajectory, row, mirror))

    def matched(self, playback: Playback, target: Array, gait: Rows) -> Matched:
        """The rows that figures play in gaits (B,) with targets (B, 3): velocity along x and z, and facing."""
        # the cost of the row that is played, with the constant that a search leaves out
        row, mirror, trajectory, query = self._wanted(playback, target, self.is_slow_walk(target, gait), ALL)
        squares = query.features[:, :-1].astype(np.float64) ** 2
        cost = self.cost_at(query, row, mirror) + squares.sum(axis=1) / 2
        # the path in the world
        left, forward = trajectory[:, : 2 * HORIZONS].reshape(-1, HORIZONS, 2).swapaxes(0, 2)
        sin = np.sin(playback.root[:, 2])
        cos = np.cos(playback.root[:, 2])
        steps = np.stack([cos * left + sin * forward, cos * forward - sin * left], axis=-1)
        return Matched(row, mirror > 0, cost, playback.root[:, None, :2] + steps.swapaxes(0, 1))

    def is_slow_walk(self, target: Array, gait: Rows) -> Flags:
        """Which figures with targets (n, 3) in gaits (n,) are to go more slowly than recordings do."""
        pace = np.hypot(target[:, 0], target[:, 1])
        slow: Flags = self.stretched[gait] & (pace >= LEAST_PACE / 2) & (pace < self.settings.creep)
        return slow

    def comes_to_rest(self, playback: Playback, target: Array, gait: Rows) -> Flags:
        """Which figures (B,) with targets (B, 3) in gaits (B,) are to stand, and go no faster than a slow walk."""
        stops = (target[:, :2] == 0).all(axis=1) & (playback.pace < self.settings.creep)
        rests: Flags = self.stretched[gait] & stops
        return rests

    def desired_trajectory(
        self, playback: Playback, target: Array, slow_walk: Flags, figures: Rows | slice = ALL
    ) -> Array:
        """Where the springs of figures (n,) lead: features (n, TRAJECTORY), not yet scaled.

        target: (B, 3). slow_walk: (n,).
        """
        settings = self.settings
        velocity_damping = damping_of(settings.velocity)
        facing = playback.root[figures, 2]
        target, error, error_rate = self._spring_error(playback, target, slow_walk, figures)

        # places and facings at each horizon, as seen from the figure
        places = list[Array]()
        facings = list[Array]()
        times = horizons(settings)
        for time in times:
            catching_up = damped_path(error[:, :2], error_rate[:, :2], velocity_damping, time)
            places.append(seen(target[:, :2] * time + catching_up, facing))
            facing_left, _ = damped(error[:, 2], error_rate[:, 2], damping_of(settings.facing), time)
            turn = target[:, 2] + facing_left - facing
            facings += [np.sin(turn), np.cos(turn)]

        # the speed at the second horizon
        velocity_left, _ = damped(error[:, :2], error_rate[:, :2], velocity_damping, times[1])
        speed = np.hypot(*(target[:, :2] + velocity_left).T)
        return np.column_stack([*places, *facings, speed_feature(speed, settings)])

    def _spring_error(
        self, playback: Playback, target: Array, slow_walk: Flags, figures: Rows | slice
    ) -> tuple[Array, Array, Array]:
        """Targets, how far the springs are from them, and how fast that changes, all (n, 3); those of slow walks at the
        pace of recordings."""
        spring = playback.spring[figures]
        spring_factor = pace_factors(spring, slow_walk, self.settings.creep)
        target = target[figures]
        target = target * pace_factors(target, slow_walk, self.settings.creep)
        error = spring * spring_factor - target
        error[:, 2] = wrapped(error[:, 2])
        return target, error, playback.spring_rate[figures] * spring_factor

    def desired_features(self, trajectory: Array, row: Rows, mirror: Rows) -> Floats:
        """Features (n, F) of trajectories (n, TRAJECTORY) that are not yet scaled, from the poses of rows (n,)."""
        features = self.table.features[mirror, row]
        features[:, :TRAJECTORY] = (trajectory - self.table.mean[:TRAJECTORY]) * self.table.scale[:TRAJECTORY]
        return features

    def query(self, features: Floats) -> Query:
        """The query of desired features (n, F)."""
        features = self._rounded(features.clip(-self.LARGEST, self.LARGEST))
        # where the desired trajectory ends: in metres, and as a direction times the cost of a metre
        scale = self.table.scale[LAST]
        mean = self.table.mean[LAST]
        end = features[:, LAST] / scale + mean
        distance = np.hypot(end[:, 0], end[:, 1])
        way = end * (self.settings.lag / np.maximum(distance, 1e-6))[:, None]
        # the lag: half of that distance, less what a row covers of it
        least = distance * self.settings.lag / 2 - (way * mean).sum(axis=1)
        lags = self._rounded(np.column_stack([-way / scale, least]))
        return Query(np.concatenate([-features, np.ones_like(features[:, :1])], axis=1), lags)

    def _rounded(self, values: NDArray[Any]) -> Floats:
        rounded: Floats = (np.rint(values * self.STEPS) / self.STEPS).astype(np.float32)
        return rounded

    def best(self, query: Query, gait: Rows) -> tuple[Rows, Rows, Floats]:
        """The best row (n,) for each query and gait (n,), 1 where it is mirrored (n,), and its cost (n,)."""
        row = np.empty(len(gait), np.int64)
        mirror = np.empty(len(gait), np.int64)
        cost = np.empty(len(gait), np.float32)
        # gait by gait, in blocks that stay in the cache
        for kind in set(gait.tolist()):
            goals = self.goals[kind]
            figures = np.flatnonzero(gait == kind)
            for start in range(0, len(figures), self.BLOCK):
                block = figures[start : start + self.BLOCK]
                costs = self._costs(query, goals, block)
                column = costs.argmin(axis=1)
                # columns hold the rows, then their mirror images
                mirror[block], goal = np.divmod(column, len(goals.rows))
                row[block] = goals.rows[goal]
                cost[block] = costs[np.arange(len(block)), column]
        return row, mirror, cost

    def _costs(self, query: Query, goals: Goals, figures: NDArray[np.intp]) -> Floats:
        """The costs of all goals, and of what fills up the last tile, for figures (n,): (n, T W)."""
        shape = len(figures), len(goals.costs), self.TILE
        costs = np.empty(shape, np.float32)
        lags = np.empty(shape, np.float32)
        np.matmul(query.features[figures], goals.costs, out=costs.swapaxes(0, 1))
        np.matmul(query.lags[figures], goals.lags, out=lags.swapaxes(0, 1))
        np.maximum(lags, 0, out=lags)
        np.add(costs, lags, out=costs)
        return costs.reshape(len(figures), -1)

    def cost_at(self, query: Query, row: Rows, mirror: Rows) -> Floats:
        """The cost (n,) of rows (n,) and mirror images (n,), as :meth:`best` has it."""
        columns = self.costs[mirror, row]
        lag = (query.lags[:, :2] * columns[:, LAST]).sum(axis=1) + query.lags[:, 2]
        cost: Floats = (query.features * columns).sum(axis=1) + np.maximum(lag, 0)
        return cost

    def jump(self, playback: Playback, figures: Rows, row: Rows, mirror: Rows) -> None:
        """Let figures (n,) continue from rows (n,) and mirror images (n,): the jump of their poses goes into the
        inertialization offset."""
        if not len(figures):
            return
        codes_before, rate_before = self._codes(playback, figures)
        playback.row[figures] = row
        playback.part[figures] = 0
        playback.mirror[figures] = mirror
        codes_after, rate_after = self._codes(playback, figures)
        playback.offset[figures], playback.offset_rate[figures] = self.inertializer.transition(
            playback.offset[figures],
            playback.offset_rate[figures],
            codes_before - codes_after,
            rate_before - rate_after,
        )

    def pose(self, playback: Playback, codes: Array) -> None:
        """Let all figures have the codes (B, K) of another pose, from which they return to what they play."""
        played, _ = self._codes(playback)
        playback.offset = codes - played
        playback.offset_rate = np.zeros_like(played)
        playback.warp = np.zeros(len(played))
        playback.warp_rate = np.zeros(len(played))

    def _codes(self, playback: Playback, figures: Rows | slice = ALL) -> tuple[Array, Array]:
        """The codes (n, K) that figures (n,) play, and how fast they change, a second."""
        played, change = self.table.at(playback, figures)
        return played[:, : self.table.codes], change[:, : self.table.codes] * self.fps
