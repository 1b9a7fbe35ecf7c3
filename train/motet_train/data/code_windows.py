"""Motions as codes to train a writer of codes on: windows of them, and what is remembered."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

Codes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CodedMotion:
    """A recording in codes (N, P) int64, the end included where it ends. action: what it shows.

    starts: whether it begins with the first step. first: whether it is the recording's first phase.
    """

    codes: Codes
    action: int
    starts: bool
    first: bool


def memory_of(motions: list[CodedMotion]) -> Tensor:
    """The steps (M, P + 2) int16 of all motions, one after the other, each with its action and its age; of a recording
    in several phases the first phase."""
    rows = []
    for motion in motions:
        if motion.first:
            ages = np.arange(len(motion.codes))[:, None] + (not motion.starts)  # what is cut off does not start
            rows.append(np.concatenate([motion.codes, np.full_like(ages, motion.action), ages], axis=1))
    return torch.from_numpy(np.concatenate(rows).astype(np.int16))


@dataclass(frozen=True, eq=False)
class CodeBatch:
    """B windows of N steps. codes, before: (B, N, P). action, age: (B, N). weights: (B, N), 0 after the end."""

    codes: Tensor
    before: Tensor
    action: Tensor
    age: Tensor
    weights: Tensor

    def __len__(self) -> int:
        """B."""
        return len(self.codes)

    def __getitem__(self, rows: slice) -> "CodeBatch":
        """Some of the windows."""
        return CodeBatch(*(part[rows] for part in self._parts()))

    def to(self, device: torch.device | str) -> "CodeBatch":
        """The same on a device."""
        return CodeBatch(*(part.to(device) for part in self._parts()))

    def _parts(self) -> tuple[Tensor, ...]:
        return self.codes, self.before, self.action, self.age, self.weights


class CodeWindows:
    """Draws windows of coded motions; one's chance goes by the root of how long its action is shown in all."""

    def __init__(self, motions: list[CodedMotion], steps: int, end: int, first: float) -> None:
        """first: how many times the first step of a motion counts, which chooses how the action is done."""
        self.motions, self.steps, self.nothing, self.first = motions, steps, end + 1, first
        lengths = np.array([len(motion.codes) for motion in motions], dtype=np.float64)
        actions = np.array([motion.action for motion in motions])
        shown = np.bincount(actions, weights=lengths)
        chances = lengths / np.sqrt(shown[actions])
        self.chances = chances / chances.sum()

    def draw(self, batch: int, unsaid: float, nobody: int, rng: np.random.Generator) -> CodeBatch:
        """A batch; a share ``unsaid`` of it has the action ``nobody``."""
        parts = self.motions[0].codes.shape[1]
        codes, before = (np.zeros((batch, self.steps, parts), dtype=np.int64) for _ in range(2))
        action, age = (np.zeros((batch, self.steps), dtype=np.int64) for _ in range(2))
        weights = np.zeros((batch, self.steps), dtype=np.float32)
        for row, which in enumerate(rng.choice(len(self.chances), batch, p=self.chances)):
            motion = self.motions[which]
            # as often from the start as from any other place where a window begins
            start = int(rng.integers(-self.steps // 2, max(1, len(motion.codes) - self.steps // 2)))
            start = max(0, start)
            part = motion.codes[start : start + self.steps]
            codes[row, : len(part)] = part
            before[row, 1 : len(part)] = part[:-1]
            before[row, 0] = motion.codes[start - 1] if start else 0
            weights[row, : len(part)] = 1.0
            if start == 0:
                before[row, 0, 0] = self.nothing
                weights[row, 0] = self.first if motion.starts else 0.0
            age[row] = start + np.arange(self.steps)
            action[row] = nobody if rng.random() < unsaid else motion.action
        return CodeBatch(*map(torch.from_numpy, (codes, before, action, age, weights)))
