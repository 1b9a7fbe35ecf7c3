"""Windows of motions in ``root_sixd`` to train on: for a codec, for a net that fills gaps, and as codes.

The chance of an action is proportional to the square root of its total duration, so rare actions are drawn more often.
Letters in shapes: B windows, T frames, D channels, N steps of codes, P parts of a step (the root move first).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.bundle.graph import Floats
from motet.generate.codec import nearest_moves, seen_from
from motet.motion.rotations import Array
from motet.representation import placed
from motet.representation.base import FrameMirror
from motet.representation.root_block import poses_of
from motet_train.data.batches import Rows
from motet_train.data.errors import DataError
from motet_train.data.store import Store

Codes = NDArray[np.int64]

Flags = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Window(Rows):
    """B windows for a codec.

    frames: (B, T, D) in the contract's units, the first three channels as a codec's decoder gives them. inputs:
    (B, T, D) as the encoder takes them, as recorded. moves: (B, N) int64 entries of the book. way: (B, T, 3) the poses
    that the moves lead to, each repeated for the frames of its step.
    """

    frames: Tensor
    inputs: Tensor
    moves: Tensor
    way: Tensor


class SixdWindows:
    """Draws windows of ``frames`` frames of some records, half of them mirrored."""

    def __init__(
        self, store: Store, mended: Store, records: tuple[int, ...], frames: int, hop: int, mirror: FrameMirror
    ) -> None:
        """mended: the same records as they are to be shown. hop: frames of a step of codes. DataError if no motion is
        long enough."""
        self.store = store
        self.mended = mended
        self.frames = frames
        self.hop = hop
        self.mirror = mirror
        # spans that are longer than a window
        self.spans: list[tuple[int, int]] = []
        actions = []
        for record in records:
            entry = store.records[record]
            for start, stop in entry.spans:
                if stop - start > frames:
                    self.spans.append((start, stop))
                    actions.append(entry.shows)
        if not self.spans:
            raise DataError(f"all motions are shorter than {frames + 1} frames")
        # by the number of windows in a span, and the rarity of its action
        lengths = np.array([stop - start - frames for start, stop in self.spans], dtype=np.float64)
        chances = lengths / _root_durations(actions, lengths)
        self.chances = chances / chances.sum()

    def sequences(self) -> list[Array]:
        """The poses of every span, to fit the book of root moves."""
        return [poses_of(self.store.values(start, stop), self.store.fps) for start, stop in self.spans]

    def middles(self, book: Array) -> Iterator[Window]:
        """One window from the middle of every span, not mirrored."""
        for start, stop in self.spans:
            first = (start + stop - self.frames) // 2
            frames = self.store.values(first, first + self.frames + 1)
            shown = self.mended.values(first, first + self.frames + 1)
            yield window_of(frames[None], shown[None], self.store.fps, book, self.hop)

    def favour(self, times: Array) -> None:
        """Multiply the chance of each span by its entry in ``times``."""
        self.chances = self.chances * times / (self.chances * times).sum()

    def draw(self, batch: int, book: Array, rng: np.random.Generator) -> Window:
        """A batch of windows; their moves are entries of a book (K, 3)."""
        spans = [self.spans[i] for i in rng.choice(len(self.chances), batch, p=self.chances)]
        starts = [int(rng.integers(start, stop - self.frames)) for start, stop in spans]
        mirrored = rng.random(batch) < 0.5
        frames = _frames(self.store, starts, self.frames + 1, self.mirror, mirrored)
        shown = _frames(self.mended, starts, self.frames + 1, self.mirror, mirrored)
        return window_of(frames, shown, self.store.fps, book, self.hop)


def _root_durations(actions: Sequence[str | int], lengths: Array) -> Array:
    """For each motion the square root of the total duration of its action."""
    _, action = np.unique(np.array(actions), return_inverse=True)
    return np.sqrt(np.bincount(action, weights=lengths)[action])


def _frames(store: Store, starts: Sequence[int], count: int, mirror: FrameMirror, mirrored: Flags) -> Array:
    """``count`` frames from each start (B, count, D), some of the rows (B,) mirrored."""
    rows = np.stack([store.values(start, start + count) for start in starts])
    rows[mirrored] = mirror(rows[mirrored])
    return rows


def window_of(frames: Array, shown: Array, fps: float, book: Array, hop: int) -> Window:
    """Windows of frames (B, T + 1, D), and as they are to be shown; the last frame serves only to know where the root
    goes."""
    poses = np.stack([poses_of(row, fps) for row in frames])
    decoded, moves, along = with_way(shown[:, :-1], poses, book, hop)
    return Window(_float_tensor(decoded), _float_tensor(frames[:, :-1]), torch.from_numpy(moves), _float_tensor(along))


def _float_tensor(values: Array) -> Tensor:
    return torch.from_numpy(values.astype(np.float32))


def with_way(frames: Array, poses: Array, book: Array, hop: int) -> tuple[Array, Codes, Array]:
    """Frames (..., T, D) as the decoder gives them, entries of the book (..., N), and the way (..., T, 3).

    poses: (..., T + 1, 3), those of the frames and the one after them; T is a multiple of ``hop``.
    """
    moves, led = nearest_moves(poses[..., ::hop, :], book)
    along = np.repeat(led[..., :-1, :], hop, axis=-2)
    # the decoder gives root poses relative to the way of the moves
    relative = seen_from(along, poses[..., :-1, :])
    return np.concatenate([relative, frames[..., 3:]], axis=-1), moves, along


@dataclass(frozen=True, eq=False)
class GapWindow(Rows):
    """Placed frames of E channels, relative to the last pose before the gap.

    past: (B, P, E). plain: (B, N, E), the interpolation through the gap. after: (B, A, E). truth: (B, N, E), the
    recorded frames of the gap.
    """

    past: Tensor
    plain: Tensor
    after: Tensor
    truth: Tensor


class GapWindows:
    """Draws windows with a gap from some records, half of them mirrored."""

    def __init__(self, store: Store, records: tuple[int, ...], longest: int, mirror: FrameMirror) -> None:
        """longest: frames of the longest window; DataError if every motion is shorter."""
        self.store = store
        self.mirror = mirror
        spans: list[tuple[int, int]] = []
        actions = []
        for record in records:
            entry = store.records[record]
            spans += entry.spans
            actions += [entry.shows] * len(entry.spans)
        self.starts = np.array([start for start, _ in spans])
        self.lengths = np.array([stop - start for start, stop in spans])
        if not spans or self.lengths.max() < longest:
            raise DataError(f"all motions are shorter than {longest} frames")
        self.weights = 1 / _root_durations(actions, self.lengths)

    def draw(self, batch: int, sizes: tuple[int, int, int], rng: np.random.Generator) -> GapWindow:
        """A batch of windows with ``sizes`` frames before, in and after the gap."""
        frames = sum(sizes)
        # by the number of windows in a span, and the rarity of its action
        chances = np.maximum(self.lengths - frames + 1, 0) * self.weights
        span = rng.choice(len(chances), batch, p=chances / chances.sum())
        starts = self.starts[span] + rng.integers(self.lengths[span] - frames + 1)
        rows = _frames(self.store, starts.tolist(), frames, self.mirror, rng.random(batch) < 0.5)
        return gap_window(placed.placed_by_way(rows, self.store.fps), sizes[0], sizes[1])


def gap_window(frames: Array, before: int, count: int) -> GapWindow:
    """Windows of placed frames (B, T, E), ``before`` of which are before a gap of ``count`` frames."""
    relative = placed.seen_from(frames, placed.pose_of(frames[:, before - 1]))
    past, truth, after = np.split(relative, [before, before + count], axis=1)
    plain = placed.bridge(past, after, count)
    return GapWindow(*map(_float_tensor, (past, plain, after, truth)))


@dataclass(frozen=True, eq=False)
class CodedMotion:
    """A recording in codes (N, P), with the end code if the recording ends.

    action: the number of the action shown. starts: whether the recording begins with the first step, rather than being
    cut. first: whether it is the recording's first phase.
    """

    codes: Codes
    action: int
    starts: bool
    first: bool


def memory_of(motions: list[CodedMotion]) -> Tensor:
    """The steps (M, P + 2) int16 of all first phases in a row, each with its action and its age."""
    rows = []
    for motion in motions:
        if motion.first:
            # no step of a cut recording has age 0, which is a motion's start
            ages = np.arange(len(motion.codes))[:, None] + (not motion.starts)
            rows.append(np.concatenate([motion.codes, np.full_like(ages, motion.action), ages], axis=1))
    return torch.from_numpy(np.concatenate(rows).astype(np.int16))


@dataclass(frozen=True, eq=False)
class CodeBatch(Rows):
    """B windows of N steps.

    codes: (B, N, P). before: (B, N, P), the codes one step earlier. action, age: (B, N). weights: (B, N) of the loss, 0
    after the end.
    """

    codes: Tensor
    before: Tensor
    action: Tensor
    age: Tensor
    weights: Tensor


class CodeWindows:
    """Draws windows of coded motions."""

    def __init__(self, motions: list[CodedMotion], steps: int, end: int, first: float) -> None:
        """end: the end code. first: weight of the first step of a motion, which decides how the action is done."""
        self.motions = motions
        self.steps = steps
        self.nothing = end + 1
        self.first = first
        lengths = np.array([len(motion.codes) for motion in motions], dtype=np.float64)
        chances = lengths / _root_durations([motion.action for motion in motions], lengths)
        self.chances = chances / chances.sum()

    def draw(self, batch: int, unsaid: float, nobody: int, rng: np.random.Generator) -> CodeBatch:
        """A batch; a share ``unsaid`` of it has the action ``nobody``."""
        rows = []
        for number in rng.choice(len(self.chances), batch, p=self.chances):
            motion = self.motions[number]
            codes, before, age, weights = self._window(motion, self._start(motion, rng))
            action = nobody if rng.random() < unsaid else motion.action
            rows.append((codes, before, np.full_like(age, action), age, weights))
        # one array for each field
        columns = [np.stack(column) for column in zip(*rows, strict=True)]
        return CodeBatch(*map(torch.from_numpy, columns))

    def _window(self, motion: CodedMotion, start: int) -> tuple[Codes, Codes, Codes, Floats]:
        """Codes (N, P), the codes one step earlier (N, P), ages (N,) and weights (N,) from one step on."""
        window = motion.codes[start : start + self.steps]
        count = len(window)
        # windows that reach beyond the end are padded, with weight 0
        codes = np.zeros((self.steps, window.shape[1]), dtype=np.int64)
        codes[:count] = window
        weights = np.zeros(self.steps, dtype=np.float32)
        weights[:count] = 1.0
        # the first step of a motion follows nothing
        before = np.zeros_like(codes)
        before[1:count] = window[:-1]
        if start:
            before[0] = motion.codes[start - 1]
        else:
            before[0, 0] = self.nothing
            weights[0] = self.first if motion.starts else 0.0
        return codes, before, start + np.arange(self.steps), weights

    def _start(self, motion: CodedMotion, rng: np.random.Generator) -> int:
        """A random first step; half a window of draws before the motion's start fall on the start itself."""
        half = self.steps // 2
        return max(0, int(rng.integers(-self.steps // 2, max(1, len(motion.codes) - half))))
