"""Motions drawn code by code: an action from what a sentence asks for, then steps of codes from what follows.

A step of codes is a move of the root and some codes of the body; each is drawn knowing those before it, as words are:
by temperature, and from the likeliest that make up ``top_p`` together (nucleus sampling: Holtzman et al. 2020). How far
an action is followed can be raised by classifier-free guidance (Ho and Salimans 2022).

Steps of training motions are remembered, to continue as people did after similar steps, as a nearest-neighbour language
model does with words (Khandelwal et al. 2020): the distribution of the next step is that of a net, mixed with the next
steps of remembered places whose past resembles the present.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Ids, Noise, Scores, advance, zero_state
from motet.errors import BundleError
from motet.settings import Range, Settings

PAST = (1.0, 0.5, 0.25)
"""Weights of the last step and those before it."""

LEAP = 0.3
"""The share of a motion's movement that may be left out from one step to the next: its act may not."""

REST = 0.125
"""What a step without movement counts beside the squared differences of codes' numbers."""

POSE = 1.0
"""What the codes of a step count beside the squared differences of their numbers, where an act is looked for."""

ACT = 0.8
"""The share of a motion's act that shows it."""

QUICKEST = 1.2
"""How much faster or slower an action is played at most to have the length asked for."""

WINDOW = 64
"""Steps that a writer looks back at most, those of the windows that writers are trained on: a stream may last for ever.
"""


@dataclass(frozen=True, eq=False)
class Memory:
    """M remembered steps. codes: (M, P) int64. ages: (M,) int64 steps since its motion began. parts: (M,) which share
    of its motion's movement was over before it, 0 to 1. acts: (M,) likewise of what is particular to its action: poses
    and movements count more the fewer other actions have their codes. lasts: (M,) int64 the last step of its motion.

    rows: of each action the remembered steps (R,), and keys: their (R, K L) float32 numbers of the K steps before each.
    """

    codes: Ids
    ages: Ids
    parts: Scores
    acts: Scores
    lasts: Ids
    rows: dict[int, Ids]
    keys: dict[int, Floats]

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
        return Memory(codes, ages, parts, acts, lasts, rows, own)

    def next(
        self, action: int, recent: Sequence[Floats], age: int, ends: bool, uniform: float, done: float = 0.0
    ) -> int:
        """The place (a row) at which an action continues, by exp(-2 d) of the distance d of the squared numbers.

        recent: numbers (L,) of the last steps, the latest first, no more than K. None yet: any start of a motion.
        ends: whether it is to end where remembered motions do; else it may come back to what was done before.
        done: the share of the movement that is over, of which no more than LEAP is left out.
        """
        rows = self.rows[action]
        ages = self.ages[rows]
        if not recent:
            starts = rows[ages == ages.min()]
            return int(starts[int(uniform * len(starts))])
        # after a first step, to begin again would look like going on; and nothing is begun where it is nearly over
        fitting = ages > 0 if age else self.parts[rows] < 0.3
        return self._near(action, recent, age, ends, uniform, fitting & (self.parts[rows] <= done + LEAP))

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
            good = np.flatnonzero(shown >= 0.95 * shown.max())
            found.append(starts[good[len(good) // 2]])
        if not recent:
            return int(found[int(uniform * len(found))])
        return self._near(action, recent, 0, False, uniform, np.isin(rows, found))

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
        self, action: int, recent: Sequence[Floats], age: int, ends: bool, uniform: float, fitting: NDArray[np.bool_]
    ) -> int:
        """A place of an action whose past resembles the present: of the ``fitting`` (R,), if there are any."""
        rows = self.rows[action]
        ages = self.ages[rows]
        seen = np.stack([recent[min(back, len(recent) - 1)] for back in range(len(PAST))])
        off = ((self.keys[action] - (np.sqrt(PAST)[:, None] * seen).ravel()) ** 2).sum(axis=1)
        later = (ages - age) ** 2 / 64  # earlier or later in its motion
        off += later if ends else np.minimum(later, 2.0)
        off[~fitting & fitting.any()] = np.inf
        shares = np.cumsum(np.exp((off.min() - off) / 0.5))
        return int(rows[np.searchsorted(shares, uniform * shares[-1], side="right")])


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


@dataclass(frozen=True)
class CodesSettings(Settings):
    """hypotheses: motions that are given. first_temperature: of the first step, which decides how an action is done.
    memory: the share of steps that are taken from what is remembered. certainty: of the action. seconds: 0 lets the
    model end a motion, after max_seconds at most."""

    hypotheses: Annotated[int, Range(1, 100)] = 1
    temperature: Annotated[float, Range(0.01, 100)] = 1.0
    first_temperature: Annotated[float, Range(0.01, 100)] = 1.0
    top_p: Annotated[float, Range(0.01, 1)] = 1.0
    guidance: Annotated[float, Range(0, 10)] = 1.0
    memory: Annotated[float, Range(0, 1)] = 0.0
    certainty: Annotated[float, Range(0.01, 100)] = 1.0
    seconds: Annotated[float, Range(0, 600, "s")] = 0.0
    max_seconds: Annotated[float, Range(0, 600, "s")] = 30.0


@dataclass(frozen=True, eq=False)
class Source:
    """What writers draw from: the graphs "step" and "part", and a memory.

    end: the move that ends a motion; the one after it stands for what comes before the first step.
    null_action: the action that says nothing, for guidance.
    """

    step: Graph
    part: Graph
    end: int
    null_action: int
    memory: Memory

    @property
    def parts(self) -> int:
        """P, the codes of a step."""
        return self.part.spec.input("codes").size(1)

    def uniform(self, noise: Sequence[Noise]) -> Scores:
        """A block (B, P + 2) of uniform numbers from the noise of each row."""
        return np.stack([one.random((self.parts + 2,), np.float32) for one in noise]).astype(np.float64)


class Writer:
    """Draws codes for B rows, each of its own action and noise; holds all state of one request.

    age: (B,) int64 steps since the action began. done: (B,) the share of its movement that is over.
    """

    def __init__(self, source: Source, noise: Sequence[Noise], drawing: CodesSettings) -> None:
        self.source, self.noise, self.drawing = source, list(noise), drawing
        rows = 2 * len(self.noise)  # told the action, and not told
        self.begin()
        self.state = zero_state(source.step, rows)
        self.last = np.zeros((rows, source.parts), dtype=np.int64)
        self.last[:, 0] = source.end + 1
        self.recent: list[Floats] = []  # numbers (B, L) of the last steps, the latest first
        self._before = self.last, self.state, self.recent, self.age, self.done

    def begin(self) -> None:
        """Begin an action in every row."""
        self.age, self.done = np.zeros(len(self.noise), dtype=np.int64), np.zeros(len(self.noise))

    def see(self, codes: Ids) -> None:
        """Take steps (N, P) as what every row did before, whatever action it was."""
        for step in codes:
            self._known(np.full(len(self.noise), self.source.null_action))
            self.last = np.tile(step, (len(self.last), 1))

    def draw(self, actions: Ids, ends: bool = True, steps: int = 0) -> Ids:
        """The next step (B, P) of rows with the given actions (B,).

        ends: whether a motion may end; else an action that would end begins again. steps: of this and those to come,
        where they are to show the most of an action that begins. Each row takes one block of uniform numbers (P + 2,)
        from its noise.
        """
        known, uniform, memory = self._known(actions), self.source.uniform(self.noise), self.source.memory
        codes = np.full((len(actions), self.source.parts), -1, dtype=np.int64)
        share = self.drawing.memory
        self.age, self.done = self.age.copy(), self.done.copy()
        for row in np.flatnonzero((uniform[:, 0] < share) | (steps > 0 and share > 0)):
            if (action := int(actions[row])) in memory.rows:
                recent, number = [numbers[row] for numbers in self.recent], float(uniform[row, 1])
                if steps:
                    place = memory.busiest(action, recent, steps, number)
                    self.age[row] = memory.ages[place]
                else:
                    age, done = int(self.age[row]), float(self.done[row])
                    place = memory.next(action, recent, age, ends, number, done)
                codes[row] = memory.codes[place]
                self.done[row] = memory.parts[min(place + 1, memory.lasts[place])]
        again = self._parts(known, uniform[:, 2:], codes, ends)
        self.last = np.tile(codes, (2, 1))
        self.age, self.done = np.where(again, 0, self.age + 1), np.where(again, 0.0, self.done)
        return codes

    def take_back(self) -> None:
        """Undo the last draw, such as that of an end, and continue from before it."""
        self.last, self.state, self.recent, self.age, self.done = self._before

    def _known(self, actions: Ids) -> Floats:
        self._before = self.last, self.state, self.recent, self.age, self.done
        told = np.concatenate([actions, np.full(len(actions), self.source.null_action)]).astype(np.int64)
        inputs = {"codes": self.last, "action": told, "age": np.tile(self.age, 2)}
        outputs, self.state = advance(self.source.step, self.state, inputs)
        for name, array in self.state.items():  # attention falls with the distance in time
            sizes = self.source.step.spec.start_shape(name)
            if 0 in sizes and array.shape[axis := 1 + sizes.index(0)] > WINDOW:
                self.state[name] = np.ascontiguousarray(np.take(array, range(-WINDOW, 0), axis))
        if self.last[0, 0] != self.source.end + 1:
            self.recent = [outputs["numbers"][: len(actions)], *self.recent][: len(PAST)]
        known: Floats = outputs["known"]
        return known

    def _parts(self, known: Floats, uniform: Scores, codes: Ids, ends: bool) -> NDArray[np.bool_]:
        """Draw the parts of steps (B, P) one after the other where they are not given; which rows (B,) begin again."""
        drawing, end = self.drawing, self.source.end
        again: NDArray[np.bool_] = (codes[:, 0] == end) & (not ends)
        rows = np.flatnonzero((codes[:, 0] < 0) | again)
        told = known[np.concatenate([rows, rows + len(codes)])]
        temperature = np.where(self.age == 0, drawing.first_temperature, drawing.temperature)[rows]
        codes[rows] = 0
        for part in range(self.source.parts) if len(rows) else ():
            asked = {"known": told, "codes": np.tile(codes[rows], (2, 1))}
            with_action, without = np.split(self.source.part(asked)["log_probabilities"][:, part].astype(np.float64), 2)
            chances = without + drawing.guidance * (with_action - without)
            drawn = nucleus(chances, uniform[rows, part], temperature, drawing.top_p)
            if part == 0 and not ends:
                again[rows] |= drawn == end
                chances[:, end] = -np.inf
                other = uniform[rows, part] * 1024 % 1  # the same number would give a neighbour of the end
                drawn = nucleus(chances, np.where(again[rows], other, uniform[rows, part]), temperature, drawing.top_p)
            codes[rows, part] = drawn
        return again

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Go on with some of the rows only."""
        both = np.concatenate([rows, rows + len(self.noise)])
        self.noise, self.age, self.done = [self.noise[row] for row in rows], self.age[rows], self.done[rows]
        self.recent = [numbers[rows] for numbers in self.recent]
        self.last, self.state = self.last[both], {name: array[both] for name, array in self.state.items()}


def nucleus(log_weights: Scores, uniform: Scores, temperature: Scores | float, top_p: float) -> Ids:
    """One of V things for each row of (B, V), by uniform numbers (B,): of those likeliest that make up ``top_p``."""
    divisor = np.broadcast_to(temperature, len(log_weights))[:, None]
    weights = np.exp((log_weights - log_weights.max(axis=1, keepdims=True)) / divisor)
    order = np.argsort(-weights, axis=1, kind="stable")
    shares = np.cumsum(np.take_along_axis(weights, order, axis=1), axis=1)
    kept = shares - np.take_along_axis(weights, order, axis=1) < top_p * shares[:, -1:]  # the last goes beyond it
    inside = np.zeros_like(weights)
    np.put_along_axis(inside, order, kept, axis=1)
    # in the order of the things themselves: that of their weights would change with a rounding
    places = np.cumsum(weights * inside, axis=1)
    found: Ids = (places > uniform[:, None] * places[:, -1:]).argmax(axis=1)
    return found


def drawn_actions(source: Source, contexts: Floats, noise: Sequence[Noise], certainty: float) -> Ids:
    """For each row an action (B,) from log-probabilities (B, A), raised to the power ``certainty``."""
    uniform = source.uniform(noise)[:, 0]
    return nucleus(certainty * contexts.astype(np.float64), uniform, 1.0, 1.0)


def draw_codes(writer: Writer, actions: Ids, longest: int, exactly: bool = False) -> list[Ids]:
    """Steps (N, P) that each row of a writer draws for its action (B,): up to its end, or to ``longest`` steps.

    exactly: to ``longest`` steps; an action that ends before is done again, and of a longer one the most is shown.
    """
    steps: list[list[Ids]] = [[] for _ in actions]
    for rows, codes in drawn_steps(writer, actions, longest, exactly):
        for row, step in zip(rows.tolist(), codes, strict=True):
            steps[row].append(step)
    return [np.array(row, dtype=np.int64).reshape(-1, writer.source.parts) for row in steps]


def drawn_steps(writer: Writer, actions: Ids, longest: int, exactly: bool = False) -> Iterator[tuple[Ids, Ids]]:
    """Step by step what :func:`draw_codes` gives: the rows (R,) that have not ended, and their codes (R, P).

    A writer whose rows have all ended can draw other actions from there.
    """
    rows = np.arange(len(actions))
    writer.begin()
    for length in range(longest):
        first = length == 0
        codes = writer.draw(actions[rows], ends=not exactly and not first, steps=longest if exactly and first else 0)
        going = codes[:, 0] != writer.source.end
        if not going.any():
            writer.take_back()
            return
        if not going.all():
            writer.keep(np.flatnonzero(going))
        rows = rows[going]
        yield rows, codes[going]
