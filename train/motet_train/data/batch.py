"""A padded batch of motions with their sentences: what both directions between motion and language train on."""

from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor


@dataclass(frozen=True, eq=False)
class Batch:
    """B motions of up to T frames, each with one sentence of up to W words, padded on the right.

    frames: (B, T, D) float32 in the contract's units; finite, of any value, after the motion's end.
    lengths: (B,) int64, frames of each motion, at least 1.
    words: (B, W) int64, ids without SOS and EOS; PAD = 0 after the sentence's end.
    ended: (B,) bool, whether the motion ends after its last frame rather than being part of a longer one; None: all do.
    groups: (B,) int64, equal for rows that are said to show the same; None where nobody asks.
    others: (B, W) int64, a second sentence of each motion, as words; None where nobody asks.
    """

    frames: Tensor
    lengths: Tensor
    words: Tensor
    ended: Tensor | None = None
    groups: Tensor | None = None
    others: Tensor | None = None

    def __len__(self) -> int:
        """B."""
        return len(self.lengths)

    def __getitem__(self, rows: slice) -> "Batch":
        """Some of the rows, padded as all of them are."""
        return self._each(lambda tensor: tensor[rows])

    def to(self, device: torch.device | str) -> "Batch":
        """The same batch on a device."""
        return self._each(lambda tensor: tensor.to(device))

    def _each(self, change: Callable[[Tensor], Tensor]) -> "Batch":
        rest = (None if part is None else change(part) for part in (self.ended, self.groups, self.others))
        return Batch(change(self.frames), change(self.lengths), change(self.words), *rest)


def before(lengths: Tensor, steps: int) -> Tensor:
    """Which of the first ``steps`` steps lie before the end of each row: lengths (B,) to bool (B, steps)."""
    return torch.arange(steps, device=lengths.device) < lengths[:, None]
