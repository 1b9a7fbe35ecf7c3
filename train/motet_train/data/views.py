"""Whole motions with their sentences: several views of each motion, of which a net's numbers are computed once."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.bundle.graph import Floats
from motet.models.language import padded
from motet_train.data.alike import alike
from motet_train.data.batches import Examples, Ids

See = Callable[[Tensor, Tensor], Tensor]
"""From frames (B, T, D) of lengths (B,) to the numbers (B, S) by which a net knows a motion."""


@dataclass(frozen=True, eq=False)
class Pairs:
    """B motions with two sentences each, which may be the same.

    seen: (B, S) float32. words, others: (B, W) int64, ids, PAD = 0 after the end. groups: (B,) int64, equal for rows of
    which the same is said.
    """

    seen: Tensor
    words: Tensor
    others: Tensor
    groups: Tensor

    def __len__(self) -> int:
        """B."""
        return len(self.seen)

    def __getitem__(self, rows: slice) -> "Pairs":
        """Some of the rows, padded as all of them are."""
        return Pairs(self.seen[rows], self.words[rows], self.others[rows], self.groups[rows])

    def to(self, device: torch.device | str) -> "Pairs":
        """The same rows on a device."""
        return Pairs(*(part.to(device) for part in (self.seen, self.words, self.others, self.groups)))


@dataclass(frozen=True, eq=False)
class Views:
    """N motions, as they are and perhaps mirrored: M = 1 or 2 kinds.

    seen: (M, N, K, S), of each motion K views. sentences: of each kind and motion. groups: (M, N).
    """

    seen: Tensor
    sentences: tuple[tuple[tuple[Ids, ...], ...], ...]
    groups: NDArray[np.int64]

    def epoch(self, rng: np.random.Generator, batch: int) -> Iterator[Pairs]:
        """Visit every motion once, mirrored or not, in a view and with two sentences that are drawn afresh."""
        kinds, motions, views, _ = self.seen.shape
        order = rng.permutation(motions)
        for start in range(0, motions, batch):
            rows = order[start : start + batch]
            kind, view = rng.integers(kinds, size=len(rows)), rng.integers(views, size=len(rows))
            said = [self.sentences[m][i] for m, i in zip(kind, rows, strict=True)]
            words, others = (padded([s[rng.integers(len(s))] for s in said], "int64")[0] for _ in range(2))
            groups = torch.from_numpy(self.groups[kind, rows])
            yield Pairs(self.seen[kind, rows, view], torch.from_numpy(words), torch.from_numpy(others), groups)


def views(examples: Examples, see: See, count: int, windows: tuple[int, int], seed: int) -> Views:
    """``count`` views of each motion of the examples: of any offset, and of no more frames than is drawn.

    windows: between which numbers that is drawn, as often short as long on a logarithmic scale.
    """
    rng, found = np.random.default_rng(seed), []
    for record in examples.records:
        parts = [_part(rng, examples, record, windows) for _ in range(count)]
        mirrored = [] if examples.mirror is None else [examples.mirror(part) for part in parts]
        frames, lengths = padded([*parts, *mirrored], "float32")
        found.append(see(torch.from_numpy(frames), torch.from_numpy(lengths)))
    sentences = (examples.sentences,) if examples.mirror is None else (examples.sentences, examples.mirrored)
    seen = torch.stack(found).reshape(len(found), len(sentences), count, -1).transpose(0, 1)
    groups = alike([[ids.tobytes() for ids in said] for kind in sentences for said in kind])
    return Views(seen, sentences, np.array(groups, dtype=np.int64).reshape(len(sentences), -1))


def _part(rng: np.random.Generator, examples: Examples, record: int, windows: tuple[int, int]) -> Floats:
    offset = int(rng.integers(len(examples.store.records[record].spans)))
    frames = examples.store.sequence(record, offset)
    longest = round(float(np.exp(rng.uniform(*np.log(windows)))))
    start = int(rng.integers(max(0, len(frames) - longest) + 1))
    return frames[start : start + longest]
