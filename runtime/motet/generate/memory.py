"""Steps of recorded motions that are remembered: a motion drawn code by code continues as people did.

Letters in shapes: M steps in all, R of an action, P codes of a step (B of the body), L numbers of a step, K steps
before it, T steps of a recording.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.loop import Flags, Ids, Scores
from motet.errors import BundleError
from motet.settings import Range, Settings

FORGOTTEN_AGE = 1 << 20
"""The age of steps that an act leaves out."""

Share = Annotated[float, Range(0, 1)]
SquaredDistance = Annotated[float, Range(1e-6, 1e6)]


@dataclass(frozen=True)
class MemorySettings(Settings):
    """How remembered steps are compared and continued, and which part of a long recording is shown.

    Distances are squared, between the numbers of codes, which a codec keeps between -1 and 1.
    """

    FEATURE: ClassVar[str] = "memory"

    past_steps: Annotated[int, Range(1, 16, "steps")] = 3
    """Steps before a place that are compared with the last steps drawn."""

    past_fading: Share = 0.5
    """Weight of each of these steps, relative to the one after it."""

    distance_scale: SquaredDistance = 0.5
    """A place is drawn with probability proportional to exp(-distance / distance_scale)."""

    age_cost: Annotated[float, Range(0, 1e6)] = 1 / 64
    """Added to the distance for each squared step of difference in age."""

    age_cost_limit: Annotated[float, Range(0, 1e6)] = 2.0
    """The most that a difference in age adds, unless the motion may end."""

    entry: Share = 0.3
    """An action that follows another one is entered before this share of its movement."""

    skip: Share = 0.3
    """Largest share of a motion's movement that may be skipped between two steps."""

    rest_weight: Annotated[float, Range(1e-6, 1e6)] = 0.125
    """Movement counted for a step at rest, added to the squared change of its numbers."""

    pose_weight: Annotated[float, Range(1e-6, 1e6)] = 1.0
    """Added to the squared change of a step's numbers where its importance to an action is measured."""

    good_start: Share = 0.95
    """A start is good if it shows at least this share of the most that any start shows in the same number of steps."""

    quick_share: Share = 0.8
    """Share of an action's importance that has to be shown where its length is adapted."""

    act_share: Share = 0.95
    """Share of a recording's importance that its act has to show."""

    tempo: Annotated[float, Range(1, 10)] = 1.2
    """Largest factor by which an action is played faster or slower to last as long as requested."""

    act_steps: Annotated[int, Range(1, 10_000, "steps")] = 45
    """Fewest steps from the first to the last of an act, 6 s with the shipped codec: shorter recordings are one act."""

    alike_distance: SquaredDistance = 8.03
    """Places that are no farther apart show the same. It depends on the codec: training measures it for a codec
    (docs/reference/bundle.md), and the default is that of the shipped one."""

    edge_cost: Annotated[float, Range(0, 10_000, "steps")] = 30
    """Steps by which an act may be longer in order to begin, or end, as its recording does."""

    @property
    def past_weights(self) -> Scores:
        """Weights (K,) of the last step and of those before it."""
        return np.power(self.past_fading, np.arange(self.past_steps))


class Recording(NamedTuple):
    """A recording of an action. Windows of a long recording are remembered as pieces of it that overlap."""

    places: Ids
    """(T,) its steps in order, as places among the action's R steps."""

    lasts: list[int]
    """The last step of each piece, as a place among all M steps."""


@dataclass(frozen=True, eq=False)
class Memory:
    """M remembered steps, motion after motion."""

    codes: Ids
    """(M, P) int64."""

    ages: Ids
    """(M,) int64: steps since the motion began."""

    parts: Scores
    """(M,) the share of the motion's movement that was over before each step, 0 to 1."""

    particular: Scores
    """(M,) importance of each step to its action: poses and movements count more the fewer other actions have them."""

    acts: Scores
    """(M,) the share of the motion's importance that was over before each step."""

    lasts: Ids
    """(M,) int64: the last step of the motion of each step."""

    rows: dict[int, Ids]
    """The remembered steps (R,) of each action."""

    moves: Floats
    """(E, 3) numbers of each move."""

    body: Floats
    """(V, L) numbers of each code of the body."""

    settings: MemorySettings
    _courses: dict[int, tuple[Ids, Scores]] = field(default_factory=dict, init=False)
    _keys: dict[int, Floats] = field(default_factory=dict, init=False)

    @staticmethod
    def of(
        steps: NDArray[np.int16], moves: Floats, body: Floats, actions: int, settings: MemorySettings | None = None
    ) -> "Memory":
        """The memory of a bundle's tables.

        steps: (M, P + 2) the codes of each step, its action and its age. moves: (E, 3) numbers of each move; the move
        E, an end, has none. body: (V, L) numbers of each code of the body. actions: how many there are. settings: the
        defaults if omitted. BundleError where a step has a code, an action or an age that cannot be.
        """
        settings = settings or MemorySettings()
        table = steps.astype(np.int64)
        codes = table[:, :-2]
        action_of_step = table[:, -2]
        ages = table[:, -1]
        _check(codes, action_of_step, ages, (len(moves), len(body) - 1, actions - 1))

        # The steps of each action, and what preceded them.
        numbers = _numbers(codes, moves, body)
        rows = _rows_by_action(action_of_step)

        # How much each step matters: to its motion by its movement, to its action by what other actions do not have.
        starts, lasts = _motions(ages)
        is_move = codes[:, 0] < len(moves)
        change = _changes(numbers[:, moves.shape[1] :], is_move, starts)
        rarity = _rarity(codes[:, 1:], action_of_step, is_move)
        importance = (settings.pose_weight + change) * np.exp(rarity) * is_move

        # How much of each motion is over before its steps, by both.
        parts = _over(settings.rest_weight + change, starts, lasts)
        acts = _over(importance, starts, lasts)
        return Memory(codes, ages, parts, importance, acts, lasts, rows, moves, body, settings)

    def lend(self, action: int, other: int) -> None:
        """Let an action that has no steps have those of another one."""
        if action not in self.rows and other in self.rows:
            self.rows[action] = self.rows[other]

    def numbers(self, codes: Ids) -> Floats:
        """The numbers (N, L) float32 by which steps (N, P) are compared; they depend on a step alone."""
        return _numbers(codes, self.moves, self.body)

    def keys(self, action: int) -> Floats:
        """The numbers (R, K L) float32 of the K steps before each step of an action, by the roots of their weights.

        Before its first step a figure counts as having stood in it. They are computed when the action is first used:
        few are used of many.
        """
        if action not in self._keys:
            rows = self.rows[action]
            past = []
            for back, weight in enumerate(self.settings.past_weights, start=1):
                before = rows - np.minimum(self.ages[rows], back)
                past.append(np.sqrt(weight) * self.numbers(self.codes[before]))
            self._keys[action] = np.concatenate(past, axis=1).astype(np.float32)
        return self._keys[action]

    @cached_property
    def shortest(self) -> dict[int, int]:
        """The number of steps of each action's shortest motion."""
        return {action: int(self.ages[self.lasts[rows]].min()) for action, rows in self.rows.items()}

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
        """The place (a row) at which an action continues, drawn by the distance of its past from the present.

        recent: numbers (L,) of the last steps, the latest first, no more than K. None yet: any start of a motion.
        ends: whether it is to end where remembered motions do; else it may return to an earlier age.
        done: the share of it that is over; no more than ``skip`` of it is left out. whole: whether all of an action is
        shown; else only the act of a long recording.
        """
        ages, over = self._course(action, whole)
        if not recent:
            starts = self.rows[action][ages == ages.min()]
            return int(starts[int(uniform * len(starts))])
        # After a first step, beginning again would look like going on; and nothing is entered when it is nearly over.
        fitting = ages > 0 if age else over < self.settings.entry
        fitting = fitting & (over <= done + self.settings.skip)
        return self._near(action, recent, age, ends, uniform, ages, fitting)

    def over(self, action: int, place: int, whole: bool) -> tuple[bool, float]:
        """Whether an act ends at a place, and which share of it is over after it; ``whole`` as for :meth:`next`."""
        _, over = self._course(action, whole)
        index = int(np.searchsorted(self.rows[action], place))
        following = index + (place < self.lasts[place])
        return bool(over[index] == 1), float(over[following])

    def _course(self, action: int, whole: bool) -> tuple[Ids, Scores]:
        """The ages (R,) of an action's steps, and the share (R,) of the action that is over before each.

        Unless all is shown, those of its acts: infinity for steps that these leave out, and 1 where they end."""
        if whole:
            rows = self.rows[action]
            return self.ages[rows], self.parts[rows]
        if action not in self._courses:
            self._courses[action] = self._course_of_acts(action)
        return self._courses[action]

    def _course_of_acts(self, action: int) -> tuple[Ids, Scores]:
        rows = self.rows[action]
        ages = self.ages[rows]
        over = self.parts[rows]
        for places, lasts in self.recordings(action):
            first, last = act_of(self.keys(action)[places], self.particular[rows[places]], self.settings)
            if last + 1 - first == len(places):
                continue
            # All pieces of the recording are cut to its act, timed from the act's first step.
            of_recording = np.isin(self.lasts[rows], lasts)
            age = self.ages[rows[of_recording]] - self.ages[rows[places[first]]]
            share = age / (last - first)
            inside = (share >= 0) & (share <= 1)
            ages[of_recording] = np.where(inside, age, FORGOTTEN_AGE)
            over[of_recording] = np.where(inside, share, np.inf)
        return ages, over

    def recordings(self, action: int) -> list[Recording]:
        """The recordings of an action; a motion that begins within another one is a piece of the same recording."""
        rows = self.rows[action]
        lasts = self.lasts[rows]
        motions = [np.flatnonzero(lasts == last) for last in np.unique(lasts)]
        # pieces in the order in which they begin
        motions.sort(key=lambda motion: int(self.ages[rows[motion[0]]]))
        recordings: list[Recording] = []
        for motion in motions:
            last = int(lasts[motion[0]])
            # a piece goes on where an earlier one overlaps it
            for i, recording in enumerate(recordings):
                overlap = self._place_within(motion, recording.places, rows)
                if overlap is not None:
                    new = motion[len(recording.places) - overlap :]
                    recordings[i] = Recording(np.concatenate([recording.places, new]), [*recording.lasts, last])
                    break
            else:
                recordings.append(Recording(motion, [last]))
        return recordings

    def _place_within(self, motion: Ids, places: Ids, rows: Ids) -> int | None:
        """Where in a recording (T,) of an action's rows (R,) a motion begins, None if it does not begin within it."""
        steps = self.settings.past_steps
        place = int(self.ages[rows[motion[0]]] - self.ages[rows[places[0]]])
        if place <= 0:
            return None
        beginning = self.codes[rows[motion[:steps]]]
        same = np.array_equal(self.codes[rows[places[place : place + steps]]], beginning)
        return place if same else None

    def busiest(self, action: int, recent: Sequence[Floats], steps: int, uniform: float) -> int:
        """The place at which to enter an action in order to show the most of it in a number of steps.

        Each remembered motion has one: the middle of those from which nearly as much of its act is shown as from any.
        A motion that is not longer is shown from its start. recent: as for :meth:`next`.
        """
        rows = self.rows[action]
        entries = []
        # of each recording the middle one of the starts that show nearly the most
        for last in np.unique(self.lasts[rows]):
            motion = rows[self.lasts[rows] == last]
            starts = motion[: max(1, len(motion) - steps)]
            shown = self.acts[np.minimum(starts + steps, last)] - self.acts[starts]
            good = np.flatnonzero(shown >= self.settings.good_start * shown.max())
            entries.append(starts[good[len(good) // 2]])
        # the first step is drawn from these; later ones are near what has been shown
        if not recent:
            return int(entries[int(uniform * len(entries))])
        return self._near(action, recent, 0, False, uniform, self.ages[rows], np.isin(rows, entries))

    def paced(self, action: int, steps: int) -> int:
        """The number of steps of an action to be played in the time of ``steps``.

        Of an action that is a little longer its act, of one that is a little shorter all, by no more than the factor
        ``tempo``; else ``steps``."""
        if action not in self.rows:
            return steps
        act_lengths = []
        whole_lengths = []
        # of each recording how many steps the act takes at its quickest, and as a whole
        for last in np.unique(self.lasts[self.rows[action]]):
            over = np.append(self.acts[last - self.ages[last] : last + 1], 1.0)
            starts = np.arange(len(over))
            stops = np.searchsorted(over, over + self.settings.quick_share)
            act_lengths.append(int((stops - starts)[stops < len(over)].min()))
            whole_lengths.append(int(np.searchsorted(over, 1.0)))
        act = int(np.median(act_lengths))
        whole = int(np.median(whole_lengths))
        # played faster if that shows the act, slower if the whole is nearly as long
        if steps < act <= self.settings.tempo * steps:
            return act
        return whole if steps > whole >= steps / self.settings.tempo else steps

    def _near(
        self,
        action: int,
        recent: Sequence[Floats],
        age: int,
        ends: bool,
        uniform: float,
        ages: Ids,
        fitting: Flags,
    ) -> int:
        """A place of an action whose past resembles the present: one of the ``fitting`` (R,), if there are any."""
        settings = self.settings
        # The last steps, the first one repeated where there are fewer than K.
        past = np.stack([recent[min(back, len(recent) - 1)] for back in range(settings.past_steps)])
        present = (np.sqrt(settings.past_weights)[:, None] * past).ravel()
        distances = ((self.keys(action) - present) ** 2).sum(axis=1)
        # Differences in age cost a little, without a limit where the motion is to end as remembered ones do.
        age_costs = settings.age_cost * (ages - age) ** 2
        distances += age_costs if ends else np.minimum(age_costs, settings.age_cost_limit)
        distances[~fitting & fitting.any()] = np.inf
        weights = np.cumsum(np.exp((distances.min() - distances) / settings.distance_scale))
        return int(self.rows[action][np.searchsorted(weights, uniform * weights[-1], side="right")])


def act_of(keys: Floats, importance: Scores, settings: MemorySettings) -> tuple[int, int]:
    """The first and the last step of the act in a recording.

    Of the parts that show ``act_share`` of its importance, by steps like those that they leave out, it is one that is
    short and begins and ends as the recording does. keys: (T, K L) of its steps. importance: (T,) of each.
    """
    end = len(keys) - 1
    if end <= settings.act_steps:
        return 0, end
    distances = squared_distances(keys)
    steps = np.arange(end + 1)
    lengths = steps - steps[:, None]

    # (T, T): the cost of each first and last step: the length, and edges that are unlike those of the recording.
    unlike_begin = np.minimum(distances[0] / settings.alike_distance, 1.0)
    unlike_end = np.minimum(distances[end] / settings.alike_distance, 1.0)
    cost = lengths + settings.edge_cost * (unlike_begin[:, None] + np.minimum(unlike_begin, unlike_end))

    # The cheapest of those that show enough and are not too short; the whole recording if there is none.
    needed = _last_needed(distances, importance, settings)
    cost[(steps <= needed[:, None]) | (lengths < settings.act_steps)] = np.inf
    if not np.isfinite(cost).any():
        return 0, end
    first, last = divmod(int(cost.argmin()), end + 1)
    return first, last


def _last_needed(distances: Scores, importance: Scores, settings: MemorySettings) -> Ids:
    """From each first step of a recording on, the last step (T,) that is needed to show enough of its importance (T,).

    distances: (T, T) of each two steps."""
    count = len(distances)
    steps = np.arange(count)
    # (T, T): from each first step on, the step at which each step of the recording is shown first.
    alike = np.where(distances <= settings.alike_distance, steps[:, None], count)
    shown = np.minimum.accumulate(alike[::-1])[::-1]
    # Its steps in that order, up to the one that makes the importance enough.
    order = np.argsort(shown, axis=1, kind="stable")
    enough = np.cumsum(importance[order], axis=1) >= settings.act_share * importance.sum()
    needed: Ids = np.take_along_axis(shown, order, axis=1)[steps, enough.argmax(axis=1)]
    return needed


def squared_distances(keys: Floats) -> Scores:
    """The squared distance (T, T) float64 of each two of some steps' keys (T, K L)."""
    exact = keys.astype(np.float64)
    squares = (exact**2).sum(axis=1)
    distances: Scores = squares[:, None] + squares - 2 * exact @ exact.T
    return distances


def _check(codes: Ids, actions: Ids, ages: Ids, largest: tuple[int, int, int]) -> None:
    """BundleError where a step has a move, a code of the body, an action or an age that cannot be.

    largest: the largest move, code and action; an age is no larger than the number of steps before."""
    limits: dict[str, tuple[Ids, int | Ids]] = {
        "move": (codes[:, 0], largest[0]),
        "code": (codes[:, 1:], largest[1]),
        "action": (actions, largest[2]),
        "age": (ages, np.arange(len(ages))),
    }
    for name, (values, most) in limits.items():
        if values.min() < 0 or (most < values.T).any():
            raise BundleError(f"table memory: {name} is out of range")


def _rows_by_action(actions: Ids) -> dict[int, Ids]:
    """The steps (R,) of each action, from the action (M,) of each step."""
    order = np.argsort(actions, kind="stable")
    names, begins = np.unique(actions[order], return_index=True)
    return dict(zip(names.tolist(), np.split(order, begins[1:]), strict=True))


def _numbers(codes: Ids, moves: Floats, body: Floats) -> Floats:
    """The numbers (M, L) float32 that the codes (M, P) of each step stand for; 0 for an end."""
    end = len(moves)
    of_move = moves[np.minimum(codes[:, 0], end - 1)]
    of_body = body[codes[:, 1:]].reshape(len(codes), -1)
    is_move = (codes[:, :1] < end).astype(np.float32)
    numbers: Floats = np.concatenate([of_move, of_body], axis=1) * is_move
    return numbers


def _motions(ages: Ids) -> tuple[Ids, Ids]:
    """The first step of each motion, and the last step (M,) of the motion of each step."""
    starts = np.flatnonzero(np.diff(ages, prepend=ages[:1] + 1) != 1)
    lengths = np.diff(starts, append=len(ages))
    return starts, np.repeat(starts + lengths - 1, lengths)


def _changes(numbers: Floats, is_move: Flags, starts: Ids) -> Scores:
    """How much the body's numbers change before each step (M,), squared; 0 at the start of a motion and at its end."""
    exact = numbers.astype(np.float64)
    change: Scores = (np.diff(exact, axis=0, prepend=exact[:1]) ** 2).sum(axis=1) * is_move
    change[starts] = 0
    return change


def _over(counts: Scores, starts: Ids, lasts: Ids) -> Scores:
    """The share of the counts (M,) of each motion's steps that is over before each."""
    over = np.cumsum(counts)
    before = (over - counts)[starts].repeat(lasts[starts] - starts + 1)
    shares: Scores = (over - counts - before) / np.maximum(over[lasts] - before, 1e-12)
    return shares


def _rarity(codes: Ids, actions: Ids, is_move: Flags) -> Scores:
    """How rare the codes (M, B) of each step are among actions (M,), in standard deviations of the steps that move.

    The sum of the logarithms of inverse document frequencies (Spaerck Jones 1972)."""
    rarity = np.zeros(len(codes))
    count = len(np.unique(actions))
    for code in codes.T:
        has = np.zeros((code.max() + 1, actions.max() + 1), dtype=np.bool_)
        has[code[is_move], actions[is_move]] = True
        rarity += np.log(count / np.maximum(has.sum(axis=1), 1))[code]
    rarity -= rarity[is_move].mean()
    return rarity / max(float(rarity[is_move].std()), 1e-12)
