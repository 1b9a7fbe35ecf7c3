"""Windows of motions in ``root_sixd`` to train a codec on, with the way that their root goes."""

from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.decode.codec import nearest_moves, seen_from
from motet.motion.rotations import Array
from motet.representation.base import FrameMirror
from motet.representation.root_block import way
from motet_train.data.errors import DataError
from motet_train.data.store import Store


@dataclass(frozen=True, eq=False)
class Window:
    """B windows. frames: (B, T, D) in the contract's units, the first three channels as a codec's decoder gives them.

    given: (B, T, D) as the encoder takes them. moves: (B, N) int64 entries of the book. way: (B, T, 3) the poses that
    the moves lead to, each for all frames of its step.
    """

    frames: Tensor
    given: Tensor
    moves: Tensor
    way: Tensor

    def __len__(self) -> int:
        """B."""
        return len(self.frames)

    def __getitem__(self, rows: slice) -> "Window":
        """Some of the windows."""
        return Window(self.frames[rows], self.given[rows], self.moves[rows], self.way[rows])

    def to(self, device: torch.device | str) -> "Window":
        """The same windows on a device."""
        return Window(*(part.to(device) for part in (self.frames, self.given, self.moves, self.way)))


def poses_of(frames: Array, fps: float) -> Array:
    """The poses (T, 3) of frames (T, D) of ``root_sixd``: x, z and facing, the first at the origin."""
    steps = frames[:, :3] / fps
    steps[:1] = 0
    facing, x, z = way(steps)
    return np.stack([x, z, facing], axis=-1)


def with_way(frames: Array, poses: Array, book: Array, hop: int) -> tuple[Array, NDArray[np.int64], Array]:
    """Frames (..., T, D) as the decoder gives them, entries of the book (..., N), and the way (..., T, 3).

    poses: (..., T + 1, 3), those of the frames and the one after them; T is a multiple of ``hop``.
    """
    moves, led = nearest_moves(poses[..., ::hop, :], book)
    along = np.repeat(led[..., :-1, :], hop, axis=-2)
    return np.concatenate([seen_from(along, poses[..., :-1, :]), frames[..., 3:]], axis=-1), moves, along


class SixdWindows:
    """Draws windows of ``frames`` frames of some records, half of them mirrored, those of rare actions oftener.

    A window's chance goes by the root of how long its action is shown in all.
    """

    def __init__(self, store: Store, records: tuple[int, ...], frames: int, hop: int, mirror: FrameMirror) -> None:
        self.frames, self.hop, self.mirror = frames, hop, mirror
        self.spans = [
            (span, action_of(store, record))
            for record in records
            for span in store.records[record].spans
            if span[1] - span[0] > frames
        ]
        if not self.spans:
            raise DataError(f"all motions are shorter than {frames + 1} frames")
        self.store, self.fps = store, store.fps
        lengths = np.array([stop - start - frames for (start, stop), _ in self.spans], dtype=np.float64)
        shown: dict[str, float] = {}
        for length, (_, action) in zip(lengths, self.spans, strict=True):
            shown[action] = shown.get(action, 0.0) + length
        chances = lengths / np.sqrt([shown[action] for _, action in self.spans])
        self.chances = chances / chances.sum()

    def sequences(self) -> list[Array]:
        """The poses of every span, to fit the book of root moves."""
        return [poses_of(np.array(self.store.frames[slice(*span)], np.float64), self.fps) for span, _ in self.spans]

    def draw(self, batch: int, book: Array, rng: np.random.Generator) -> Window:
        """A batch of windows, their moves by a book (K, 3)."""
        which = rng.choice(len(self.chances), batch, p=self.chances)
        found = np.stack([self._cut(self.spans[i][0], rng) for i in which])
        mirrored = rng.random(batch) < 0.5
        found[mirrored] = self.mirror(found[mirrored])
        return window_of(found, self.fps, book, self.hop)

    def _cut(self, span: tuple[int, int], rng: np.random.Generator) -> Array:
        start = int(rng.integers(span[0], span[1] - self.frames))
        return np.array(self.store.frames[start : start + self.frames + 1], np.float64)


def window_of(frames: Array, fps: float, book: Array, hop: int) -> Window:
    """Windows of frames (B, T + 1, D), of which the last says only where the root goes."""
    poses = np.stack([poses_of(row, fps) for row in frames])
    seen, moves, along = with_way(frames[:, :-1], poses, book, hop)
    tensors = (seen, frames[:, :-1], moves, along)
    return Window(*(torch.from_numpy(part if part.dtype == np.int64 else part.astype(np.float32)) for part in tensors))


def action_of(store: Store, record: int) -> str:
    """What a record shows: as its corpus calls it, or else the record's own name."""
    entry = store.records[record]
    return entry.action or entry.take or entry.name
