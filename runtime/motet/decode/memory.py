"""Steps of codes remembered from training motions, to continue as people did after similar steps.

What a nearest-neighbour language model does for words (Khandelwal et al. 2020): the distribution of the next step is
that of a net, mixed with the next steps of remembered places whose past resembles the present.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.decode.rollout import Ids
from motet.errors import BundleError

PAST = (1.0, 0.5, 0.25)
"""Weights of the last step and those before it."""

NEAR = 0.5
"""Places are chosen by exp(-distance / NEAR), the distance that of the squared numbers of their last steps."""

LATER, LATEST = 1 / 64, 2.0
"""What is added to a distance for each squared step that a place is earlier or later in its motion; and the most of it,
where a motion is to go on and on."""


EARLY = 0.3
"""The part of a motion in which an action is taken up that follows another."""


@dataclass(frozen=True, eq=False)
class Memory:
    """M remembered steps. codes: (M, P) int64. keys: (M, K L) float32 numbers of the K steps before each.

    ages: (M,) int64 steps since its motion began. parts: (M,) which part of its motion was over, 0 to 1. rows: of each
    action the remembered steps.
    """

    codes: Ids
    keys: NDArray[np.float32]
    ages: Ids
    parts: NDArray[np.float64]
    rows: dict[int, Ids]

    @staticmethod
    def of(steps: NDArray[np.int16], moves: Floats, body: Floats, actions: int) -> "Memory":
        """What the tables of a bundle hold: steps (M, P + 2), of each the codes, the action and the age.

        moves: (E, 3) numbers of each move, body: (V, L) of each code of the body; the move E, an end, has none.
        actions: how many there are. BundleError where a step has others.
        """
        found = steps.astype(np.int64)
        codes, done, ages, end = found[:, :-2], found[:, -2], found[:, -1], len(moves)
        for name, values, most in (
            ("move", codes[:, 0], end),
            ("code", codes[:, 1:], len(body) - 1),
            ("action", done, actions - 1),
            ("age", ages, np.arange(len(ages))),
        ):
            if values.min() < 0 or (most < values.T).any():
                raise BundleError(f"table memory: {name} is out of range")
        real = (codes[:, :1] < end).astype(np.float32)
        way = moves[np.minimum(codes[:, 0], end - 1)]
        numbers = np.concatenate([way, body[codes[:, 1:]].reshape(len(codes), -1)], axis=1) * real
        # before the first step a figure is taken to have stood in it
        before = [np.arange(len(ages)) - np.minimum(ages, back) for back in range(1, len(PAST) + 1)]
        keys = np.concatenate([np.sqrt(w) * numbers[at] for w, at in zip(PAST, before, strict=True)], axis=1)
        order = np.argsort(done, kind="stable")
        names, starts = np.unique(done[order], return_index=True)
        rows = dict(zip(names.tolist(), np.split(order, starts[1:]), strict=True))
        return Memory(codes, keys.astype(np.float32), ages, _parts(ages), rows)

    def next(self, action: int, recent: Sequence[NDArray[np.float32]], age: int, ends: bool, uniform: float) -> int:
        """The place (a row) at which an action continues.

        recent: numbers (L,) of the last steps, the latest first, no more than K. None yet: any start of a motion.
        ends: whether it is to end where remembered motions do; else it may come back to what was done before.
        """
        rows = self.rows[action]
        if not recent:
            starts = rows[self.ages[rows] == self.ages[rows].min()]
            return int(starts[int(uniform * len(starts))])
        # after a first step, to begin again would look like going on; and nothing is begun where it is nearly over
        fitting = rows[self.ages[rows] > 0] if age else rows[self.parts[rows] < EARLY]
        rows = fitting if len(fitting) else rows
        seen = np.stack([recent[min(back, len(recent) - 1)] for back in range(len(PAST))])
        asked = (np.sqrt(PAST)[:, None] * seen).ravel()
        later = LATER * (self.ages[rows] - age) ** 2
        off = ((self.keys[rows] - asked) ** 2).sum(axis=1) + (later if ends else np.minimum(later, LATEST))
        shares = np.cumsum(np.exp((off.min() - off).astype(np.float64) / NEAR))
        return int(rows[np.searchsorted(shares, uniform * shares[-1], side="right")])


def _parts(ages: Ids) -> NDArray[np.float64]:
    """Which part of its motion was over at each step (M,), where the ages (M,) of each motion count up."""
    starts = np.flatnonzero(np.diff(ages, prepend=ages[:1] + 1) != 1)
    lengths = np.diff(starts, append=len(ages))
    found: NDArray[np.float64] = (ages - np.repeat(ages[starts], lengths)) / np.repeat(lengths, lengths)
    return found
