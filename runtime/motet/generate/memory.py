"""Steps of recorded motions that are remembered: where a motion that is drawn code by code goes on as people did.

Letters in shapes: M steps in all, R of an action, P codes of a step, L numbers of a step, K steps before it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.loop import Ids, Scores
from motet.errors import BundleError

PAST = (1.0, 0.5, 0.25)
"""Weights of the last step and those before it."""

NEAR = 0.5
"""Places are drawn by exp(-distance / NEAR)."""

LATER, LATEST = 1 / 64, 2.0
"""Added to a distance for each squared step of difference in age, and the most that is added."""

EARLY = 0.3
"""The share of a motion's movement in which an action is taken up that follows another."""

GOOD = 0.95
"""The share of the most that a number of steps can show from which on a start is as good."""

LEAP = 0.3
"""The share of a motion's movement that may be left out from one step to the next: its act may not."""

REST = 0.125
"""What a step without movement counts beside the squared differences of codes' numbers."""

POSE = 1.0
"""What the codes of a step count beside the squared differences of their numbers, where an act is looked for."""

ACT, ALL = 0.8, 0.95
"""The shares of a motion's act that show it where time is short, and where it is not."""

QUICKEST = 1.2
"""How much faster or slower an action is played at most to have the length asked for."""

WHOLE = 45
"""Steps, 6 s at 30 frames a second, of the shortest act: a recording that is not longer counts as one.
"""

ALIKE = 8.03
"""The squared distance of two places up to which the one shows what the other shows; no codes are just that far apart,
so that no rounding decides."""

UNLIKE = 30
"""Steps that an act may be longer to begin, or end, as its recording does."""

FAR = 1 << 20
"""The age of what is not shown."""


@dataclass(frozen=True, eq=False)
class Memory:
    """M remembered steps. codes: (M, P) int64. ages: (M,) int64 steps since its motion began. parts: (M,) which share
    of its motion's movement was over before it, 0 to 1. particular: (M,) how much it is particular to its action: poses
    and movements count more the fewer other actions have their codes. acts: (M,) which share of that was over before.
    lasts: (M,) int64 the last step of its motion.

    rows: of each action the remembered steps (R,), and keys: their (R, K L) float32 numbers of the K steps before each.
    shortest: of each the steps of its shortest motion.
    """

    codes: Ids
    ages: Ids
    parts: Scores
    particular: Scores
    acts: Scores
    lasts: Ids
    rows: dict[int, Ids]
    keys: dict[int, Floats]
    shortest: dict[int, int]
    _shown: dict[int, tuple[Ids, Scores]] = field(default_factory=dict, init=False)

    @staticmethod
    def of(steps: NDArray[np.int16], moves: Floats, body: Floats, actions: int) -> "Memory":
        """What the tables of a bundle hold: steps (M, P + 2), of each the codes, the action and the age.

        moves: (E, 3) numbers of each move, body: (V, L) of each code of the body; the move E, an end, has none.
        actions: how many there are. BundleError where a step has others.
        """
        found = steps.astype(np.int64)
        codes, done, ages, end = found[:, :-2], found[:, -2], found[:, -1], len(moves)
        at = np.arange(len(ages))
        limits: dict[str, tuple[Ids, int | Ids]] = {"move": (codes[:, 0], end), "code": (codes[:, 1:], len(body) - 1)}
        for name, (values, most) in {**limits, "action": (done, actions - 1), "age": (ages, at)}.items():
            if values.min() < 0 or (most < values.T).any():
                raise BundleError(f"table memory: {name} is out of range")
        real = (codes[:, :1] < end).astype(np.float32)
        way = moves[np.minimum(codes[:, 0], end - 1)]
        numbers = np.concatenate([way, body[codes[:, 1:]].reshape(len(codes), -1)], axis=1) * real
        # before the first step a figure is taken to have stood in it
        past = [np.sqrt(weight) * numbers[at - np.minimum(ages, back)] for back, weight in enumerate(PAST, start=1)]
        order = np.argsort(done, kind="stable")
        names, begins = np.unique(done[order], return_index=True)
        keys = np.concatenate(past, axis=1).astype(np.float32)[order]
        rows, own = (dict(zip(names.tolist(), np.split(one, begins[1:]), strict=True)) for one in (order, keys))
        starts = np.flatnonzero(np.diff(ages, prepend=ages[:1] + 1) != 1)
        lasts = np.repeat(starts + (lengths := np.diff(starts, append=len(ages))) - 1, lengths)
        body = numbers[:, moves.shape[1] :].astype(np.float64)
        change = (np.diff(body, axis=0, prepend=body[:1]) ** 2).sum(axis=1) * real[:, 0]
        change[starts] = 0  # as if the figure had stood in it before
        particular = (POSE + change) * np.exp(_rarity(codes[:, 1:], done, codes[:, 0] < end)) * real[:, 0]
        parts, acts = (_over(one, starts, lasts) for one in (REST + change, particular))
        shortest = {name: int(ages[lasts[found]].min()) for name, found in rows.items()}
        return Memory(codes, ages, parts, particular, acts, lasts, rows, own, shortest)

    def next(
        self,
        action: int,
        recent: Sequence[Floats],
        age: int,
        ends: bool,
        uniform: float,
        done: float = 0.0,
        whole: bool = False,
    ) -> int:
        """The place (a row) at which an action continues, by exp(-2 d) of the distance d of the squared numbers.

        recent: numbers (L,) of the last steps, the latest first, no more than K. None yet: any start of a motion.
        ends: whether it is to end where remembered motions do; else it may come back to what was done before.
        done: the share of it that is over, of which no more than LEAP is left out. whole: whether all of an action is
        shown; else, of long recordings, an act.
        """
        rows, (ages, over) = self.rows[action], self._of(action, whole)
        if not recent:
            starts = rows[ages == ages.min()]
            return int(starts[int(uniform * len(starts))])
        # after a first step, to begin again would look like going on; and nothing is begun where it is nearly over
        fitting = ages > 0 if age else over < EARLY
        return self._near(action, recent, age, ends, uniform, ages, fitting & (over <= done + LEAP))

    def over(self, action: int, place: int, whole: bool) -> tuple[bool, float]:
        """Whether an act ends at a place, and which share of it is over after it; ``whole`` as for :meth:`next`."""
        at, (_, over) = int(np.searchsorted(self.rows[action], place)), self._of(action, whole)
        return bool(over[at] == 1), float(over[at + (place < self.lasts[place])])

    def _of(self, action: int, whole: bool) -> tuple[Ids, Scores]:
        """The ages (R,) of an action's steps, and the share (R,) of it that is over before each; unless all is shown,
        those of its acts: infinity for what these leave out, and 1 where they end."""
        rows = self.rows[action]
        if whole:
            return self.ages[rows], self.parts[rows]
        if action not in self._shown:
            ages, over, owners = self.ages[rows], self.parts[rows], self.lasts[rows]
            for take, pieces in self._takes(action):
                first, last = _act(self.keys[action][take], self.particular[rows[take]])
                if last + 1 - first < len(take):
                    own = np.isin(owners, pieces)
                    age = ages[own] - ages[take[first]]
                    share = age / (last - first)
                    shown = (share >= 0) & (share <= 1)
                    ages[own], over[own] = np.where(shown, age, FAR), np.where(shown, share, np.inf)
            self._shown[action] = ages, over
        return self._shown[action]

    def _takes(self, action: int) -> list[tuple[Ids, list[int]]]:
        """The recordings of an action: where their steps are among its own (R,), and the last steps of the pieces that
        they are remembered in, each of which begins within the one before."""
        rows, found = self.rows[action], list[tuple[Ids, list[int]]]()
        motions = [np.flatnonzero(self.lasts[rows] == last) for last in np.unique(self.lasts[rows])]
        for piece in sorted(motions, key=lambda one: int(self.ages[rows[one[0]]])):
            last, begin = int(self.lasts[rows[piece[0]]]), self.codes[rows[piece[: len(PAST)]]]
            for i, (take, pieces) in enumerate(found):
                at = int(self.ages[rows[piece[0]]] - self.ages[rows[take[0]]])
                if at > 0 and np.array_equal(self.codes[rows[take[at : at + len(PAST)]]], begin):
                    found[i] = np.concatenate([take, piece[len(take) - at :]]), [*pieces, last]
                    break
            else:
                found.append((piece, [last]))
        return found

    def busiest(self, action: int, recent: Sequence[Floats], steps: int, uniform: float) -> int:
        """The place at which an action is taken up to show the most of it in a number of steps.

        It is one of each remembered motion: the middle of those from which nearly as much of its act is shown as from
        any. A motion that is not longer is shown from its start. recent: as for :meth:`next`.
        """
        rows = self.rows[action]
        found = []
        for last in np.unique(self.lasts[rows]):
            motion = rows[self.lasts[rows] == last]
            starts = motion[: max(1, len(motion) - steps)]
            shown = self.acts[np.minimum(starts + steps, last)] - self.acts[starts]
            good = np.flatnonzero(shown >= GOOD * shown.max())
            found.append(starts[good[len(good) // 2]])
        if not recent:
            return int(found[int(uniform * len(found))])
        return self._near(action, recent, 0, False, uniform, self.ages[rows], np.isin(rows, found))

    def paced(self, action: int, steps: int) -> int:
        """The steps of an action to be played in the time of so many: of one that is a little longer its act, of one
        that is a little shorter all, by no more than QUICKEST; else as many as there are."""
        acts, wholes = [], []
        for last in np.unique(self.lasts[self.rows.get(action, np.empty(0, np.int64))]):
            over = np.append(self.acts[last - self.ages[last] : last + 1], 1.0)
            starts, stops = np.arange(len(over)), np.searchsorted(over, over + ACT)
            acts.append(int((stops - starts)[stops < len(over)].min()))
            wholes.append(int(np.searchsorted(over, 1.0)))
        act, whole = (int(np.median(found)) for found in (acts, wholes)) if acts else (steps, steps)
        if steps < act <= QUICKEST * steps:
            return act
        return whole if steps > whole >= steps / QUICKEST else steps

    def _near(
        self,
        action: int,
        recent: Sequence[Floats],
        age: int,
        ends: bool,
        uniform: float,
        ages: Ids,
        fitting: NDArray[np.bool_],
    ) -> int:
        """A place of an action whose past resembles the present: of the ``fitting`` (R,), if there are any."""
        rows = self.rows[action]
        seen = np.stack([recent[min(back, len(recent) - 1)] for back in range(len(PAST))])
        off = ((self.keys[action] - (np.sqrt(PAST)[:, None] * seen).ravel()) ** 2).sum(axis=1)
        later = LATER * (ages - age) ** 2
        off += later if ends else np.minimum(later, LATEST)
        off[~fitting & fitting.any()] = np.inf
        shares = np.cumsum(np.exp((off.min() - off) / NEAR))
        return int(rows[np.searchsorted(shares, uniform * shares[-1], side="right")])


def _act(keys: Floats, particular: Scores) -> tuple[int, int]:
    """The first and the last step of the act in a recording: of parts that show ALL of it, by steps like those that
    they leave out, one that is short and begins and ends as the recording does.

    keys: (T, K L) of its steps, particular: (T,) how much each is.
    """
    end = len(keys) - 1
    if end <= WHOLE:
        return 0, end
    exact = keys.astype(np.float64)
    squares = (exact**2).sum(axis=1)
    apart = squares[:, None] + squares - 2 * exact @ exact.T
    at = np.arange(end + 1)
    # from each step on, where each step is first shown, and how long it takes to show enough
    shown = np.minimum.accumulate(np.where(apart <= ALIKE, at[:, None], end + 1)[::-1])[::-1]
    order = np.argsort(shown, axis=1, kind="stable")
    enough = np.cumsum(particular[order], axis=1) >= ALL * particular.sum()
    until = np.take_along_axis(shown, order, axis=1)[at, enough.argmax(axis=1)]
    begin, stop = (np.minimum(apart[edge] / ALIKE, 1.0) for edge in (0, end))
    cost = at - at[:, None] + UNLIKE * (begin[:, None] + np.minimum(begin, stop))
    cost[(at <= until[:, None]) | (at - at[:, None] < WHOLE)] = np.inf
    if not np.isfinite(cost).any():
        return 0, end
    first, last = divmod(int(cost.argmin()), end + 1)
    return first, last


def _over(counts: Scores, starts: Ids, lasts: Ids) -> Scores:
    """The share of what the steps (M,) of each motion count that is over before each."""
    over = np.cumsum(counts)
    before = (over - counts)[starts].repeat(lasts[starts] - starts + 1)
    found: Scores = (over - counts - before) / np.maximum(over[lasts] - before, 1e-12)
    return found


def _rarity(codes: Ids, actions: Ids, real: NDArray[np.bool_]) -> Scores:
    """How rare the codes (M, B) of each step are among actions (M,), in standard deviations of the ``real`` ones: the
    sum of the logarithms of inverse document frequencies (Spaerck Jones 1972)."""
    found, count = np.zeros(len(codes)), len(np.unique(actions))
    for code in codes.T:
        has = np.zeros((code.max() + 1, actions.max() + 1), dtype=np.bool_)
        has[code[real], actions[real]] = True
        found += np.log(count / np.maximum(has.sum(axis=1), 1))[code]
    found -= found[real].mean()
    return found / max(float(found[real].std()), 1e-12)
