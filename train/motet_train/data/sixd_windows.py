"""Windows of motions in ``root_sixd`` to train on: for a codec, for a net that fills gaps, and as codes.

A window's chance goes by the root of how long its action is shown in total, so that rare actions are drawn more often.
Letters in shapes: B windows, T frames, D channels, N steps of codes, P parts of a step (the root move first).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.generate.codec import nearest_moves, seen_from
from motet.motion.rotations import Array
from motet.representation import placed
from motet.representation.base import FrameMirror
from motet.representation.root_block import way
from motet_train.data.batches import Rows
from motet_train.data.errors import DataError
from motet_train.data.store import Store

Codes = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Window(Rows):
    """frames: (B, T, D) in the contract's units, the first three channels as a codec's decoder gives them.

    given: (B, T, D) as the encoder takes them. moves: (B, N) int64 entries of the book. way: (B, T, 3) the poses that
    the moves lead to, each for all frames of its step.
    """

    frames: Tensor
    given: Tensor
    moves: Tensor
    way: Tensor


class SixdWindows:
    """Draws windows of ``frames`` frames of some records, half of them mirrored."""

    def __init__(self, store: Store, records: tuple[int, ...], frames: int, hop: int, mirror: FrameMirror) -> None:
        self.store, self.frames, self.hop, self.mirror = store, frames, hop, mirror
        found = [(span, store.records[record].shows) for record in records for span in store.records[record].spans]
        found = [(span, action) for span, action in found if span[1] - span[0] > frames]
        if not found:
            raise DataError(f"all motions are shorter than {frames + 1} frames")
        self.spans = [span for span, _ in found]
        lengths = np.array([stop - start - frames for start, stop in self.spans], dtype=np.float64)
        chances = lengths / _shown([action for _, action in found], lengths)
        self.chances = chances / chances.sum()

    def sequences(self) -> list[Array]:
        """The poses of every span, to fit the book of root moves."""
        store = self.store
        return [poses_of(np.array(store.frames[slice(*span)], np.float64), store.fps) for span in self.spans]

    def middles(self, book: Array) -> Iterator[Window]:
        """One window from the middle of every span, not mirrored."""
        for start, stop in self.spans:
            first = (start + stop - self.frames) // 2
            frames = np.array(self.store.frames[first : first + self.frames + 1], np.float64)
            yield window_of(frames[None], self.store.fps, book, self.hop)

    def favour(self, times: Array) -> None:
        """Draw windows of each span so many times as often."""
        self.chances = self.chances * times / (self.chances * times).sum()

    def draw(self, batch: int, book: Array, rng: np.random.Generator) -> Window:
        """A batch of windows, their moves by a book (K, 3)."""
        spans = [self.spans[i] for i in rng.choice(len(self.chances), batch, p=self.chances)]
        starts = [int(rng.integers(start, stop - self.frames)) for start, stop in spans]
        found = _drawn(self.store, starts, self.frames + 1, self.mirror, rng)
        return window_of(found, self.store.fps, book, self.hop)


def _shown(actions: Sequence[str | int], lengths: Array) -> Array:
    """For each of some motions the root of how long its action is shown in total."""
    _, which = np.unique(np.array(actions), return_inverse=True)
    return np.sqrt(np.bincount(which, weights=lengths)[which])


def _drawn(store: Store, starts: Sequence[int], count: int, mirror: FrameMirror, rng: np.random.Generator) -> Array:
    """``count`` frames from each start (B, count, D), half of them mirrored."""
    found = np.stack([np.array(store.frames[start : start + count], np.float64) for start in starts])
    mirrored = rng.random(len(starts)) < 0.5
    found[mirrored] = mirror(found[mirrored])
    return found


def window_of(frames: Array, fps: float, book: Array, hop: int) -> Window:
    """Windows of frames (B, T + 1, D), of which the last says only where the root goes."""
    poses = np.stack([poses_of(row, fps) for row in frames])
    seen, moves, along = with_way(frames[:, :-1], poses, book, hop)
    tensors = (seen, frames[:, :-1], moves, along)
    return Window(*(torch.from_numpy(part if part.dtype == np.int64 else part.astype(np.float32)) for part in tensors))


def poses_of(frames: Array, fps: float) -> Array:
    """The poses (T, 3) of frames (T, D) of ``root_sixd``: x, z and facing, the first at the origin."""
    steps = frames[:, :3] / fps
    steps[:1] = 0
    facing, x, z = way(steps)
    return np.stack([x, z, facing], axis=-1)


def with_way(frames: Array, poses: Array, book: Array, hop: int) -> tuple[Array, Codes, Array]:
    """Frames (..., T, D) as the decoder gives them, entries of the book (..., N), and the way (..., T, 3).

    poses: (..., T + 1, 3), those of the frames and the one after them; T is a multiple of ``hop``.
    """
    moves, led = nearest_moves(poses[..., ::hop, :], book)
    along = np.repeat(led[..., :-1, :], hop, axis=-2)
    return np.concatenate([seen_from(along, poses[..., :-1, :]), frames[..., 3:]], axis=-1), moves, along


@dataclass(frozen=True, eq=False)
class GapWindow(Rows):
    """Placed frames of E channels, seen from the last one before the gap. past: (B, P, E). plain: (B, N, E), a plain
    way through the gap. after: (B, A, E). truth: (B, N, E), what was there."""

    past: Tensor
    plain: Tensor
    after: Tensor
    truth: Tensor


class GapWindows:
    """Draws windows with a gap of some records, half of them mirrored."""

    def __init__(self, store: Store, records: tuple[int, ...], longest: int, mirror: FrameMirror) -> None:
        """longest: frames of the longest window; DataError where no motion is as long."""
        self.store, self.mirror = store, mirror
        entries = [store.records[record] for record in records]
        spans = np.array([span for entry in entries for span in entry.spans]).reshape(-1, 2)
        self.starts, self.lengths = spans[:, 0], spans[:, 1] - spans[:, 0]
        if not len(spans) or self.lengths.max() < longest:
            raise DataError(f"all motions are shorter than {longest} frames")
        self.weights = 1 / _shown([entry.shows for entry in entries for _ in entry.spans], self.lengths)

    def draw(self, batch: int, sizes: tuple[int, int, int], rng: np.random.Generator) -> GapWindow:
        """A batch of windows with so many frames before, in and after the gap."""
        frames = sum(sizes)
        room = np.maximum(self.lengths - frames + 1, 0) * self.weights
        which = rng.choice(len(room), batch, p=room / room.sum())
        starts = self.starts[which] + rng.integers(self.lengths[which] - frames + 1)
        found = _drawn(self.store, starts.tolist(), frames, self.mirror, rng)
        return gap_window(placed.placed_by_way(found, self.store.fps), sizes[0], sizes[1])


def gap_window(frames: Array, before: int, count: int) -> GapWindow:
    """Windows of placed frames (B, T, E), ``before`` of which are before a gap of ``count`` frames."""
    seen = placed.seen_from(frames, placed.pose_of(frames[:, before - 1]))
    past, truth, after = np.split(seen, [before, before + count], axis=1)
    parts = (past, placed.bridge(past, after, count), after, truth)
    return GapWindow(*(torch.from_numpy(part.astype(np.float32)) for part in parts))


@dataclass(frozen=True, eq=False)
class CodedMotion:
    """A recording in codes (N, P), the end included where it ends. action: what it shows.

    starts: whether it begins with the first step. first: whether it is the recording's first phase.
    """

    codes: Codes
    action: int
    starts: bool
    first: bool


def memory_of(motions: list[CodedMotion]) -> Tensor:
    """The steps (M, P + 2) int16 of all motions in a row, each with its action and its age; of a recording in several
    phases only the first."""
    rows = []
    for motion in motions:
        if motion.first:
            ages = np.arange(len(motion.codes))[:, None] + (not motion.starts)  # what is cut off does not start
            rows.append(np.concatenate([motion.codes, np.full_like(ages, motion.action), ages], axis=1))
    return torch.from_numpy(np.concatenate(rows).astype(np.int16))


@dataclass(frozen=True, eq=False)
class CodeBatch(Rows):
    """B windows of N steps. codes, before: (B, N, P). action, age: (B, N). weights: (B, N), 0 after the end."""

    codes: Tensor
    before: Tensor
    action: Tensor
    age: Tensor
    weights: Tensor


class CodeWindows:
    """Draws windows of coded motions."""

    def __init__(self, motions: list[CodedMotion], steps: int, end: int, first: float) -> None:
        """first: how many times the first step of a motion counts, which chooses how the action is done."""
        self.motions, self.steps, self.nothing, self.first = motions, steps, end + 1, first
        lengths = np.array([len(motion.codes) for motion in motions], dtype=np.float64)
        chances = lengths / _shown([motion.action for motion in motions], lengths)
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
            start = max(0, int(rng.integers(-self.steps // 2, max(1, len(motion.codes) - self.steps // 2))))
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
