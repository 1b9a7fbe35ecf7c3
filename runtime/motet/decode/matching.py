"""The loop of a figure that is steered: recorded frames played one after the other, and matched with what is asked.

Motion matching (Clavet 2016; Buettner and Clavet 2015). A table holds rows, one for each recorded frame. A few times a
second the row is searched that fits best: its feet and hips are as they are now, and where it goes in the next second
is where the figure is asked to go. A jump to another row leaves no jump to be seen: what it would change is added to
the pose, and fades (inertialisation: Bollo 2018). What is asked, a velocity and a facing, is approached by critically
damped springs. Every row stands for its mirror image, too.

Letters in shapes: B characters, N rows, K codes of a pose, F features, G gaits. The ground's axes are x and z; an angle
of 0 faces z, and positive ones are to the left (towards x). Units are metres, seconds and radians.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Floats, Graph, rows_of
from motet.decode.loop import Loop
from motet.errors import BundleError
from motet.motion.quaternions import wrapped

AHEAD = (1 / 3, 2 / 3, 1.0)
"""Seconds after which is compared where rows go."""

ASKED = 4 * len(AHEAD) + 1
"""The features that say where a row goes: places (left, forward) after each of AHEAD, facings (sin, cos), and the haste
after the second of AHEAD. The others say how it is now, all seen from the facing: places and velocities of the balls of
both feet, three numbers each, the hips' velocity, and the places of both hands."""

FEATURES = ASKED + 21

FARTHEST = slice(2 * len(AHEAD) - 2, 2 * len(AHEAD))
"""The features of the place after the last of AHEAD."""

LASTING = 20
"""Rows that follow a row at least that is jumped to, so that what is found lasts."""

STANDS = 0.1
"""How much a foot stands at least in rows that are jumped to and from: what flies goes on to do so."""

LAG = np.float32(50)
"""How much each metre counts by which a row leads less than half as far on the way that is asked, in the last of AHEAD:
others start, or turn aside, if not as smoothly."""

BEHIND, BEFORE = 20, 5
"""Rows: a jump back by no more, or ahead, is none: the figure goes on, and is not caught in a moment for ever."""

EVERY = 2
"""Of so many rows one may be jumped to: the others are 1 / 30 s away from it."""

LANES = 8
"""The step computes a multiple of so many characters: sines are computed several at once, and those left over round
otherwise."""

Rows = NDArray[np.int64]


def mirrored_features() -> tuple[NDArray[np.intp], Floats]:
    """Of which columns (F,), with which signs (F,), the features of a mirror image are made."""
    pair, three = [-1.0, 1.0], [-1.0, 1.0, 1.0]
    now = np.arange(7).reshape(7, 1) * 3 + np.arange(3)  # feet, their velocities, the hips', hands
    columns = [*range(ASKED), *(ASKED + now[[1, 0, 3, 2, 4, 6, 5]].ravel()).tolist()]
    signs = pair * (2 * len(AHEAD)) + [1.0] + three * 7
    return np.array(columns), np.array(signs, dtype=np.float32)


HASTE = 0.7
"""m/s: the speed that is half way from standing to any speed, on the scale of :func:`haste`."""


def haste(speed: NDArray[Any]) -> NDArray[Any]:
    """Speeds (...) in m/s on a scale on which a slow walk is as far from standing as a run from a walk."""
    found: NDArray[Any] = speed / (speed + HASTE)
    return found


@dataclass(frozen=True, eq=False)
class Table:
    """What is recorded. frames: (N, K + 6) float32 codes of the pose, velocity over the ground (forward, left, turn),
    speed, and how much each foot stands. features: (N, F) float32, scaled. gaits: (N, G), 1 where a row shows a gait.
    left: (N,) rows that follow in the same recording. mean, scale: (F,) of the features."""

    frames: Floats
    features: Floats
    gaits: Floats
    left: Rows
    mean: Floats
    scale: Floats

    @staticmethod
    def of(graph: Graph, count: int, mean: Floats, scale: Floats) -> "Table":
        """What a graph "rows" holds: row (N,) -> frames, features, gaits, left; BundleError as :func:`rows_of`."""
        found = rows_of(graph, count, {"gaits": (0, 1), "left": (0, count - 1 - np.arange(count))})
        return Table(found["frames"], found["features"], found["gaits"], found["left"], mean, scale)


@dataclass(eq=False)
class Playing:
    """All that changes from tick to tick, for B characters.

    row: (B,) float32 place in the table. side: (B,) float32, -1 for the mirror image. due: (B,) ticks until the next
    search. states: what the step feeds back, float32: "root" (B, 4) x, z, facing, and how fast it is played; "course"
    (B, 6) velocity, acceleration, facing and its speed, of the springs; "bend" (B, 2 K) what jumps have left, and its
    speed.
    """

    row: Floats
    side: Floats
    due: Rows
    states: dict[str, Floats]

    def copy(self) -> "Playing":
        """One that goes on by itself."""
        return Playing(
            self.row.copy(), self.side.copy(), self.due.copy(), {k: v.copy() for k, v in self.states.items()}
        )


class Matcher:
    """Searches the table, and jumps.

    signs: (K,) of the codes of a mirror image. every: ticks from one search to the next; rows that are played at
    ``fastest`` times their speed must go on for so long. springs: half-lives of velocity and facing, seconds.
    """

    def __init__(
        self, table: Table, signs: Floats, fps: float, every: int, fastest: float, springs: tuple[float, float]
    ) -> None:
        self.table, self.code_signs, self.fps, self.every, self.springs = table, signs, fps, every, springs
        self.columns, self.signs = mirrored_features()
        self.reserve = int(np.ceil((every + 1) * fastest)) + 2
        self.half: Floats = (table.features**2).sum(axis=1) / 2
        self.flies = table.frames[:, -2:].max(axis=1) < STANDS
        self.goals = [self._goals(gait) for gait in range(table.gaits.shape[1])]

    def _goals(self, gait: int) -> tuple[Rows, Floats, Floats, Floats]:
        """Rows (M,) of a gait that may be jumped to, half their squared features, their features (F, M), and where they
        lead (M, 2)."""
        fitting = (self.table.gaits[:, gait] > 0) & (self.table.left >= max(self.reserve, LASTING)) & ~self.flies
        rows = np.flatnonzero(fitting)[::EVERY]
        features = self.table.features[rows]
        return rows, self.half[rows], np.ascontiguousarray(features.T), self._places(features)

    def search(self, playing: Playing, control: Floats, gait: Rows) -> None:
        """Let the characters whose search is due jump to the rows that fit best, where others than their own do."""
        who = np.flatnonzero(playing.due <= 0)
        playing.due -= 1
        if not len(who):
            return
        playing.due[who] = self.every - 1
        row, side, kind = np.rint(playing.row[who]).astype(np.int64), playing.side[who], gait[who]
        asked = self.features_at(row, side)
        ways = self.ways(playing.states["root"][who], playing.states["course"][who], control[who])
        asked[:, :ASKED] = (ways - self.table.mean[:ASKED]) * self.table.scale[:ASKED]
        best, other, cost = self.best(asked, kind)
        goes_on = (self.table.gaits[row, kind] > 0) & (self.table.left[row] >= self.reserve)
        near = (best >= row - BEHIND) & (best <= row + BEFORE)  # on either side
        same = goes_on & (near | self.flies[row] | (self.cost_at(asked, row, side) <= cost))
        self.jump(playing, who[~same], best[~same], other[~same])

    def jump(self, playing: Playing, who: Rows, row: Rows, side: Floats) -> None:
        """Let characters (n,) go on from rows (n,) and sides (n,); what their poses lose goes into the offset."""
        before, speed = self._codes_at(playing.row[who], playing.side[who])
        playing.row[who], playing.side[who] = row, side
        after, speed_after = self._codes_at(playing.row[who], playing.side[who])
        playing.states["bend"][who] += np.concatenate([before - after, speed - speed_after], axis=1)

    def bend(self, playing: Playing, codes: Floats) -> None:
        """Let all characters have the codes (B, K) of another pose; they come back to what they play."""
        now, _ = self._codes_at(playing.row, playing.side)
        playing.states["bend"] = np.concatenate([codes - now, np.zeros_like(now)], axis=1)

    def _codes_at(self, row: Floats, side: Floats) -> tuple[Floats, Floats]:
        """Codes (n, K) at places in the table, and how fast they change."""
        here, part = row.astype(np.int64), row % 1
        first, second = (self.table.frames[at, : len(self.code_signs)] for at in (here, here + 1))
        signs = np.where(side[:, None] > 0, np.float32(1), self.code_signs)
        change = second - first
        return (first + part[:, None] * change) * signs, change * signs * np.float32(self.fps)

    def features_at(self, rows: Rows, side: Floats) -> Floats:
        """Features (B, F) of rows (B,), mirrored where the side (B,) is -1."""
        found = self.table.features[rows]
        return np.where(side[:, None] > 0, found, found[:, self.columns] * self.signs)

    def best(self, asked: Floats, gait: Rows) -> tuple[Rows, Floats, Floats]:
        """The row (B,), its side (B,) and its cost (B,) for features (B, F) and a gait (B,)."""
        row, side, cost = np.empty(len(gait), np.int64), np.empty(len(gait), np.float32), np.empty_like(asked[:, 0])
        # each by itself: how a product rounds depends on how many rows it has
        for one, kind in enumerate(gait.tolist()):
            rows, half, across, places = self.goals[kind]
            both = np.stack([asked[one], asked[one, self.columns] * self.signs])
            way, far = self._way(both)
            costs = half + LAG * np.maximum(far[:, None] / 2 - way @ places.T, 0) - both @ across
            other, at = divmod(int(costs.argmin()), len(rows))
            row[one], side[one], cost[one] = rows[at], (1, -1)[other], costs[other, at]
        return row, side, cost

    def cost_at(self, asked: Floats, rows: Rows, side: Floats) -> Floats:
        """The cost (B,) of given rows, as :meth:`best` gives it but for gaits and ends."""
        own = self.features_at(rows, side)
        way, far = self._way(asked)
        lag = LAG * np.maximum(far / 2 - (way * self._places(own)).sum(axis=1), 0)
        found: Floats = self.half[rows] + lag - (asked * own).sum(axis=1)
        return found

    def _places(self, features: Floats) -> Floats:
        """Where features (B, F) lead after the last of AHEAD (B, 2): left and forward, metres."""
        found: Floats = features[:, FARTHEST] / self.table.scale[FARTHEST] + self.table.mean[FARTHEST]
        return found

    def _way(self, asked: Floats) -> tuple[Floats, Floats]:
        """The direction (B, 2) and how far (B,) what is asked leads after the last of AHEAD."""
        places = self._places(asked)
        far = np.linalg.norm(places, axis=1)
        return places / np.maximum(far, 1e-6)[:, None], far

    def ways(self, root: Floats, course: Floats, control: Floats) -> Floats:
        """Where the springs lead in AHEAD: features (B, ASKED) not yet scaled. The arrays are those of the step."""
        slow, calm = (2 * np.log(2) / half for half in self.springs)
        cos, sin = np.cos(root[:, 2]), np.sin(root[:, 2])
        wanted = control[:, :2]
        off = course[:, :2] - wanted
        rest = course[:, 2:4] + off * slow
        turned = wrapped(course[:, 4] - control[:, 2])
        rate = course[:, 5] + turned * calm
        places, facings = [], []
        velocity = wanted + np.exp(-slow * AHEAD[1]) * (off + rest * AHEAD[1])
        for time in AHEAD:
            left = np.exp(-slow * time)
            path = (rest / slow + off) / slow - left * ((off + rest * time) / slow + rest / slow**2) + wanted * time
            places += [cos * path[:, 0] - sin * path[:, 1], sin * path[:, 0] + cos * path[:, 1]]
            angle = control[:, 2] + np.exp(-calm * time) * (turned + rate * time) - root[:, 2]
            facings += [np.sin(angle), np.cos(angle)]
        return np.stack([*places, *facings, haste(np.hypot(*velocity.T))], axis=1)


def tick(step: Graph, matcher: Matcher, playing: Playing, control: Floats, gait: Rows) -> Arrays:
    """One tick: "rotations" (B, J, 4), "height" (B, 1) and "contacts" (B, 2); ``playing`` goes on.

    control: (B, 3) velocity over the ground along x and z, and facing. gait: (B,) which. BundleError where the step
    plays beyond the table.
    """
    matcher.search(playing, control, gait)
    playing.row += playing.states["root"][:, 3]
    here = playing.row.astype(np.int64)
    if here.min() < 0 or here.max() >= len(matcher.table.left) - 1:
        raise BundleError("graph step: it plays beyond the rows of the table")
    recorded = matcher.table.frames[np.stack([here, here + 1], axis=1)]
    at = np.stack([playing.row - here, playing.side], axis=1, dtype=np.float32, casting="same_kind")
    whole = np.resize(np.arange(len(here)), -(-len(here) // LANES) * LANES)
    feeds = {"recorded": recorded, "at": at, "control": control, **playing.states}
    outputs = {name: found[: len(here)] for name, found in step({k: v[whole] for k, v in feeds.items()}).items()}
    playing.states = {name: outputs[source] for name, source in step.spec.feedback.items()}
    return outputs


LOOP = Loop(
    tick,
    {"recorded": "batch 2 W", "at": "batch 2", "control": "batch 3"},
    {"rotations": "batch J 4", "height": "batch 1", "contacts": "batch 2"},
)
