"""Motions drawn code by code: an action from the context of a sentence, then one step of codes after the other.

A step of codes is a move of the root and some codes of the body; each is drawn knowing those before it, like words: by
temperature, and from the likeliest that make up ``top_p`` together (nucleus sampling: Holtzman et al. 2020).
Classifier-free guidance makes motions follow an action more closely (Ho and Salimans 2022).

Steps of training motions are remembered, to continue as people did after similar steps, as a nearest-neighbour language
model does with words (Khandelwal et al. 2020): the distribution of the next step is that of a net, mixed with the next
steps of remembered places whose past resembles the present.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Flags, Ids, Loop, Noise, Scores, State, advance, taken, zero_state
from motet.generate.memory import Memory
from motet.settings import Range, Settings

WINDOW = 64
"""Steps that a writer looks back at most, as in the windows of its training; so a stream may last for ever."""


@dataclass(frozen=True)
class CodesSettings(Settings):
    """How codes are drawn."""

    hypotheses: Annotated[int, Range(1, 100)] = 1
    """Number of motions."""

    temperature: Annotated[float, Range(0.01, 100)] = 1.0

    first_temperature: Annotated[float, Range(0.01, 100)] = 1.0
    """Of the first step, which decides on the manner of an action."""

    top_p: Annotated[float, Range(0.01, 1)] = 1.0

    guidance: Annotated[float, Range(0, 10)] = 1.0

    memory: Annotated[float, Range(0, 1)] = 0.0
    """Share of the steps that are remembered ones."""

    certainty: Annotated[float, Range(0.01, 100)] = 1.0
    """Exponent of the probabilities of actions."""

    seconds: Annotated[float, Range(0, 600, "s")] = 0.0
    """Length of a motion; 0 where it ends by itself."""

    max_seconds: Annotated[float, Range(0, 600, "s")] = 30.0
    """Length after which a motion is cut that has not ended by itself."""


@dataclass(frozen=True, eq=False)
class Source:
    """The sources that writers draw from."""

    step: Graph
    part: Graph

    end: int
    """The move that ends a motion; the one after it stands for the time before the first step."""

    null_action: int
    """The action that stands for no action, for guidance."""

    remember: Callable[[], Memory]
    """Makes the memory."""

    written: Ids
    """The action that the graph step knows each one as; other than itself for those of commands."""

    @cached_property
    def memory(self) -> Memory:
        """The memory, made when it is first used; BundleError where a table of it was altered or does not fit."""
        return self.remember()

    @cached_property
    def parts(self) -> int:
        """P, the codes of a step."""
        return self.part.spec.input("codes").size(1)

    def uniform(self, noise: Sequence[Noise]) -> Scores:
        """A block (B, P + 2) of uniform numbers from the noise of each row."""
        return np.stack([row.random((self.parts + 2,), np.float32) for row in noise]).astype(np.float64)


class Writer:
    """Draws codes for B rows, each with its action and noise; holds all state of one request.

    The graph "step" reads the steps of a row when a net is to draw the next one, all that it has not read at once: most
    steps are remembered ones, for which no net is needed.
    """

    age: Ids
    """(B,) int64 steps since the action began."""

    done: Scores
    """(B,) the share of the action's movement that is over."""

    def __init__(self, source: Source, noise: Sequence[Noise], drawing: CodesSettings) -> None:
        self.source = source
        self.noise = list(noise)
        self.drawing = drawing
        self.begin()
        # What the net knows of each row, twice: with the actions and without; and the steps that it has yet to read.
        self.states = [zero_state(source.step, 2)] * len(self.noise)
        self.steps: list[State] = []
        self.unread = np.zeros(len(self.noise), dtype=np.int64)
        self.last = np.zeros((len(self.noise), source.parts), dtype=np.int64)
        self.last[:, 0] = source.end + 1
        self.recent: list[Floats] = []  # numbers (B, L) of the last steps, the latest first
        self._remember()

    def _remember(self) -> None:
        self._before = (self.last, self.states, self.steps, self.unread, self.recent, self.age, self.done)

    def begin(self) -> None:
        """Begin an action in every row."""
        self.age = np.zeros(len(self.noise), dtype=np.int64)
        self.done = np.zeros(len(self.noise))

    def see(self, codes: Ids) -> None:
        """Take steps (N, P) as the past of every row, whatever the action was."""
        for step in codes:
            self._advance(np.full(len(self.noise), self.source.null_action))
            self.last = np.tile(step, (len(self.last), 1))

    def draw(self, actions: Ids, ends: bool = True, steps: int = 0, whole: bool = True) -> Ids:
        """The next step (B, P) of rows with the given actions (B,).

        ends: whether a motion may end, but no more than the memory's ``skip`` sooner than any remembered one; else an
        action that would end begins again. steps: of this and those to come, where they are to show the most of an
        action that begins.
        whole: whether all of an action is shown; else, of long recordings, an act (:meth:`Memory.next`). Each row takes
        one block of uniform numbers (P + 2,) from its noise.
        """
        self._advance(actions)
        uniform = self.source.uniform(self.noise)
        self.age = self.age.copy()
        self.done = self.done.copy()

        # Steps of some rows are remembered ones, and all of commands that end by themselves, and all that begin an
        # action to show the most of it; -1 marks parts that are still to be drawn.
        memory = self.source.memory
        is_command = self.source.written[actions] != actions
        codes = np.full((len(actions), self.source.parts), -1, dtype=np.int64)
        share = self.drawing.memory
        continues = (uniform[:, 0] < share) | (((is_command & ends) | (steps > 0)) & (share > 0))
        for row in np.flatnonzero(continues).tolist():
            action = int(actions[row])
            if action in memory.rows:
                codes[row] = self._remembered(row, action, float(uniform[row, 1]), ends, steps, whole)

        # The others are drawn, and end no sooner than remembered motions.
        shortest = np.array([memory.shortest.get(action, 0) for action in actions.tolist()])
        is_early = self.age < (1 - memory.settings.skip) * shortest
        again = self._parts(uniform[:, 2:], codes, ends, is_early)

        # Actions that begin again have age 0 at the next step.
        self.last = codes
        self.age = np.where(again, 0, self.age + 1)
        self.done = np.where(again, 0.0, self.done)
        return codes

    def _remembered(self, row: int, action: int, uniform: float, ends: bool, steps: int, whole: bool) -> Ids:
        """The codes (P,) of a remembered step at which a row continues; see :meth:`draw`."""
        memory = self.source.memory
        recent = [numbers[row] for numbers in self.recent]
        if steps:
            place = memory.busiest(action, recent, steps, uniform)
            self.age[row] = memory.ages[place]
        else:
            place = memory.next(action, recent, int(self.age[row]), ends, uniform, float(self.done[row]), whole)
        is_over, self.done[row] = memory.over(action, place, whole)
        codes: Ids = memory.codes[place].copy()
        if is_over and ends:
            codes[0] = self.source.end
        return codes

    def take_back(self) -> None:
        """Undo the last draw, such as that of an end, and continue from before it."""
        self.last, self.states, self.steps, self.unread, self.recent, self.age, self.done = self._before

    def _advance(self, actions: Ids) -> None:
        """Put the last step behind each row, whose next one shows an action (B,)."""
        self._remember()
        if self.last[0, 0] != self.source.end + 1:
            memory = self.source.memory
            self.recent = [memory.numbers(self.last), *self.recent][: memory.settings.past_steps]
        step = {"codes": self.last, "action": self.source.written[actions].astype(np.int64), "age": self.age}
        self.steps = [*self.steps, step][-WINDOW:]
        self.unread = np.minimum(self.unread + 1, WINDOW)

    def _known(self, rows: Ids) -> Floats:
        """What the graph "part" has to know (R, 2, H) of the next step of rows, with and without their actions.

        Rows that have as many unread steps are read together.
        """
        counts = self.unread[rows]
        known = np.zeros((len(rows), 2, self.source.part.spec.input("known").size(1)), dtype=np.float32)
        for count in np.unique(counts):
            known[counts == count] = self._read(rows[counts == count], int(count))
        return known

    def _read(self, rows: Ids, count: int) -> Floats:
        """Read the last steps of rows, ``count`` each: what is known (R, 2, H) of the next ones."""
        # each row, and after it the same without its actions
        inputs: State = {}
        for name in self.steps[-1]:
            of_rows = [step[name][rows] for step in self.steps[-count:]]
            inputs[name] = np.repeat(np.stack(of_rows, axis=1), 2, axis=0)
        inputs["action"][1::2] = self.source.null_action
        outputs, state = advance(self.source.step, self._window(rows, WINDOW - count), inputs)

        # these rows know them now
        self.states = self.states.copy()
        for place, row in enumerate(rows):
            self.states[row] = {name: array[2 * place : 2 * place + 2] for name, array in state.items()}
        self.unread = self.unread.copy()
        self.unread[rows] = 0
        known: Floats = outputs["known"].reshape(len(rows), 2, -1)
        return known

    def _window(self, rows: Ids, most: int) -> State:
        """The states of rows; of those that grow, that of the last steps, at most ``most``."""
        window: State = {}
        for name in self.source.step.spec.feedback:
            state = np.concatenate([self.states[row][name] for row in rows])
            sizes = self.source.step.spec.start_shape(name)
            if 0 in sizes:
                axis = 1 + sizes.index(0)
                length = state.shape[axis]
                if length > most:
                    state = np.take(state, range(length - most, length), axis)
            window[name] = state
        return window

    def _parts(self, uniform: Scores, codes: Ids, ends: bool, is_early: Flags) -> Flags:
        """Draw the parts of steps (B, P) one after the other, except in rows that are remembered already.

        is_early: rows (B,) that may not end yet. Returns the rows (B,) that begin their action again."""
        again: Flags = (codes[:, 0] == self.source.end) & (not ends)
        rows = np.flatnonzero((codes[:, 0] < 0) | again)
        if not len(rows):
            return again
        known = np.concatenate(self._known(rows).swapaxes(0, 1))
        temperature = np.where(self.age == 0, self.drawing.first_temperature, self.drawing.temperature)[rows]
        drawn = np.zeros((len(rows), self.source.parts), dtype=np.int64)
        # The move first, as it may be an end; then the codes of the body.
        never_ends = is_early[rows] | (not ends)
        chances = self._chances(known, drawn, 0)
        drawn[:, 0], ended = self._move(chances, uniform[rows, 0], temperature, never_ends, again[rows])
        again[rows] |= ended & (not ends)
        for part in range(1, self.source.parts):
            chances = self._chances(known, drawn, part)
            drawn[:, part] = nucleus(chances, uniform[rows, part], temperature, self.drawing.top_p)
        codes[rows] = drawn
        return again

    def _move(
        self, chances: Scores, uniform: Scores, temperature: Scores, never_ends: Flags, again: Flags
    ) -> tuple[Ids, Flags]:
        """The move of rows (R,) from its log-probabilities (R, K), and whether it was an end, drawn again in rows that
        never end. again: rows that have come to an end before."""
        end = self.source.end
        top_p = self.drawing.top_p
        ended: Flags = nucleus(chances, uniform, temperature, top_p) == end
        # An end that may not be is drawn again from the other moves; the same number would give a neighbour.
        chances[never_ends, end] = -np.inf
        number = np.where(again | ended & never_ends, uniform * 1024 % 1, uniform)
        return nucleus(chances, number, temperature, top_p), ended

    def _chances(self, known: Floats, codes: Ids, part: int) -> Scores:
        """Guided log-probabilities (R, K) of a part of rows, from the parts (R, P) drawn before it."""
        outputs = self.source.part({"known": known, "codes": np.concatenate([codes, codes])})
        log_probabilities = outputs["log_probabilities"][:, part].astype(np.float64)
        with_action, without = np.split(log_probabilities, 2)
        chances: Scores = without + self.drawing.guidance * (with_action - without)
        return chances

    def keep(self, rows: NDArray[np.intp]) -> None:
        """Go on with some of the rows only."""
        self.noise = [self.noise[row] for row in rows]
        self.age = self.age[rows]
        self.done = self.done[rows]
        self.recent = [numbers[rows] for numbers in self.recent]
        self.last = self.last[rows]
        self.states = [self.states[row] for row in rows.tolist()]
        self.steps = [taken(step, rows) for step in self.steps]
        self.unread = self.unread[rows]


def nucleus(log_weights: Scores, uniform: Scores, temperature: Scores | float, top_p: float) -> Ids:
    """One of V ids for each row of (B, V), by uniform numbers (B,): of the likeliest that make up ``top_p``."""
    divisor = np.broadcast_to(temperature, len(log_weights))[:, None]
    weights = np.exp((log_weights - log_weights.max(axis=1, keepdims=True)) / divisor)

    # The nucleus: the likeliest, up to the one that goes beyond top_p.
    order = np.argsort(-weights, axis=1, kind="stable")
    sorted_weights = np.take_along_axis(weights, order, axis=1)
    shares = np.cumsum(sorted_weights, axis=1)
    kept = shares - sorted_weights < top_p * shares[:, -1:]
    inside = np.zeros_like(weights)
    np.put_along_axis(inside, order, kept, axis=1)

    # Drawn in the order of their ids, since that of their weights would change with a rounding.
    places = np.cumsum(weights * inside, axis=1)
    drawn: Ids = (places > uniform[:, None] * places[:, -1:]).argmax(axis=1)
    return drawn


def drawn_actions(source: Source, contexts: Floats, noise: Sequence[Noise], certainty: float) -> Ids:
    """For each row an action (B,) from log-probabilities (B, A), raised to the power ``certainty``."""
    uniform = source.uniform(noise)[:, 0]
    return nucleus(certainty * contexts.astype(np.float64), uniform, 1.0, 1.0)


def draw_codes(writer: Writer, actions: Ids, longest: int, exactly: bool = False) -> list[Ids]:
    """Steps (N, P) that each row of a writer draws for its action (B,): up to its end, or to ``longest`` steps.

    exactly: to ``longest`` steps; an action that ends before is repeated, and of a longer one the most is shown.
    """
    steps: list[list[Ids]] = [[] for _ in actions]
    for rows, codes in drawn_steps(writer, actions, longest, exactly):
        for row, step in zip(rows.tolist(), codes, strict=True):
            steps[row].append(step)
    return [np.array(row, dtype=np.int64).reshape(-1, writer.source.parts) for row in steps]


def drawn_steps(
    writer: Writer, actions: Ids, longest: int, exactly: bool = False, whole: bool = False
) -> Iterator[tuple[Ids, Ids]]:
    """The codes of :func:`draw_codes` step by step: the rows (R,) that have not ended, and their codes (R, P).

    whole: show all of an action, as with ``exactly``, and not one act of a long recording. A writer whose rows have all
    ended can draw other actions from there.
    """
    rows = np.arange(len(actions))
    writer.begin()
    for length in range(longest):
        first = length == 0
        steps = longest if exactly and first else 0
        codes = writer.draw(actions[rows], ends=not exactly and not first, steps=steps, whole=whole or exactly)
        going = codes[:, 0] != writer.source.end
        if not going.any():
            writer.take_back()
            return
        if not going.all():
            writer.keep(np.flatnonzero(going))
        rows = rows[going]
        yield rows, codes[going]


LOOPS: Mapping[str, Loop] = {
    "codes": Loop(
        draw_codes,
        {"codes": "*batch steps P", "action": "*batch steps", "age": "*batch steps"},
        {"known": "batch H"},
        CodesSettings,
    ),
}
