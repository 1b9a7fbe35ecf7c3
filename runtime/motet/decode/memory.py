"""Steps of codes remembered from training motions, to go on as people did where the last steps were alike.

What a nearest-neighbour language model does for words (Khandelwal et al. 2020): the distribution of the next step is
that of a net, mixed with the next steps of remembered places whose past resembles the present.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Graph, Ranges, rows_of
from motet.decode.rollout import Ids

PAST = (1.0, 0.5, 0.25)
"""How much the last step counts, and those before it."""

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
    def of(graph: Graph, count: int, actions: int, largest: Sequence[int]) -> "Memory":
        """What a graph "memory" holds: row (M,) -> codes (M, P), numbers (M, L), action and age (M,).

        actions: how many there are. largest: of each part the largest code (P,). BundleError as :func:`rows_of`.
        """
        ranges: Ranges = {"action": (0, actions - 1), "age": (0, np.arange(count)), "codes": (0, largest)}
        found = rows_of(graph, count, ranges)
        ages, done, numbers = found["age"], found["action"], found["numbers"]
        # before the first step a figure is taken to have stood in it
        before = [np.arange(count) - np.minimum(ages, back) for back in range(1, len(PAST) + 1)]
        keys = np.concatenate([np.sqrt(w) * numbers[at] for w, at in zip(PAST, before, strict=True)], axis=1)
        order = np.argsort(done, kind="stable")
        names, starts = np.unique(done[order], return_index=True)
        rows = dict(zip(names.tolist(), np.split(order, starts[1:]), strict=True))
        return Memory(found["codes"], keys.astype(np.float32), ages, _parts(ages), rows)

    def next(self, action: int, recent: Sequence[NDArray[np.float32]], age: int, ends: bool, uniform: float) -> int:
        """The place (a row) at which an action goes on.

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
