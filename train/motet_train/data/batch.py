"""A padded batch of motions with their sentences: what both directions between motion and language train on."""

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
    """

    frames: Tensor
    lengths: Tensor
    words: Tensor
    ended: Tensor | None = None

    def __len__(self) -> int:
        """B."""
        return len(self.lengths)

    def __getitem__(self, rows: slice) -> "Batch":
        """Some of the rows, padded as all of them are."""
        ended = None if self.ended is None else self.ended[rows]
        return Batch(self.frames[rows], self.lengths[rows], self.words[rows], ended)

    def to(self, device: torch.device | str) -> "Batch":
        """The same batch on a device."""
        ended = None if self.ended is None else self.ended.to(device)
        return Batch(self.frames.to(device), self.lengths.to(device), self.words.to(device), ended)
