"""Motions drawn code by code: an action from what a sentence asks for, then steps of codes from what follows.

A step of codes is a move of the root and some codes of the body; each is drawn knowing those before it, as words are:
by temperature, and from the likeliest that make up ``top_p`` together (nucleus sampling: Holtzman et al. 2020). How far
an action is followed can be raised by classifier-free guidance (Ho and Salimans 2022).

Steps of training motions are remembered, to continue as people did after similar steps, as a nearest-neighbour language
model does with words (Khandelwal et al. 2020): the distribution of the next step is that of a net, mixed with the next
steps of remembered places whose past resembles the present.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Ids, Loop, Noise, Scores, advance, zero_state
from motet.generate.memory import Memory
from motet.settings import Range, Settings

WINDOW = 64
"""Steps that a writer looks back at most, those of the windows that writers are trained on: a stream may last for ever.
"""


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

    def draw(self, actions: Ids, ends: bool = True, steps: int = 0, whole: bool = True) -> Ids:
        """The next step (B, P) of rows with the given actions (B,).

        ends: whether a motion may end, but no more than the memory's ``skip`` sooner than any remembered one; else an
        action that would end begins again. steps: of this and those to come, where they are to show the most of an
        action that begins.
        whole: whether all of an action is shown; else, of long recordings, an act (:meth:`Memory.next`). Each row takes
        one block of uniform numbers (P + 2,) from its noise.
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
                    place = memory.next(action, recent, age, ends, number, done, whole)
                over, self.done[row] = memory.over(action, place, whole)
                codes[row] = memory.codes[place]
                codes[row, 0] = self.source.end if over and ends else codes[row, 0]
        shortest = np.array([memory.shortest.get(int(action), 0) for action in actions])
        begun = self.age < (1 - memory.settings.skip) * shortest
        again = self._parts(known, uniform[:, 2:], codes, ends, begun)
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
            self.recent = [outputs["numbers"][: len(actions)], *self.recent][: self.source.memory.settings.past_steps]
        known: Floats = outputs["known"]
        return known

    def _parts(
        self, known: Floats, uniform: Scores, codes: Ids, ends: bool, begun: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Draw the parts of steps (B, P) one after the other where they are not given; which rows (B,) begin again.
        begun: rows (B,) that do not end yet."""
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
            if part == 0:
                early, ended = begun[rows] | (not ends), drawn == end
                again[rows] |= ended & (not ends)
                chances[early, end] = -np.inf
                other = uniform[rows, part] * 1024 % 1  # the same number would give a neighbour of the end
                number = np.where(again[rows] | ended & early, other, uniform[rows, part])
                drawn = nucleus(chances, number, temperature, drawing.top_p)
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


def drawn_steps(
    writer: Writer, actions: Ids, longest: int, exactly: bool = False, whole: bool = False
) -> Iterator[tuple[Ids, Ids]]:
    """Step by step what :func:`draw_codes` gives: the rows (R,) that have not ended, and their codes (R, P).

    whole: all of an action is shown, as where ``exactly`` so many steps are asked for, not one act of a long recording.
    A writer whose rows have all ended can draw other actions from there.
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
        {"codes": "*batch P", "action": "*batch", "age": "*batch"},
        {"known": "batch H", "numbers": "batch L"},
        CodesSettings,
    ),
}
