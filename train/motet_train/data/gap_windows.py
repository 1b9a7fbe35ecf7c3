"""Windows of motions with a gap, to learn to fill it."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from motet.motion.rotations import Array
from motet.representation.base import FrameMirror
from motet.representation.placed import bridge, placed_by_way, pose_of, seen_from
from motet_train.data.errors import DataError
from motet_train.data.sixd_windows import action_of
from motet_train.data.store import Store


@dataclass(frozen=True, eq=False)
class GapWindow:
    """B windows of placed frames, seen from the last one before the gap. past: (B, P, E). plain: (B, N, E), a plain way
    through the gap. after: (B, A, E). truth: (B, N, E), what was there."""

    past: Tensor
    plain: Tensor
    after: Tensor
    truth: Tensor

    def __len__(self) -> int:
        """B."""
        return len(self.past)

    def __getitem__(self, rows: slice) -> "GapWindow":
        """Some of the windows."""
        return GapWindow(self.past[rows], self.plain[rows], self.after[rows], self.truth[rows])

    def to(self, device: torch.device | str) -> "GapWindow":
        """The same windows on a device."""
        return GapWindow(*(part.to(device) for part in (self.past, self.plain, self.after, self.truth)))


class GapWindows:
    """Draws windows of some records, half of them mirrored, those of rare actions oftener.

    A window's chance goes by the root of how long its action is shown in all.
    """

    def __init__(self, store: Store, records: tuple[int, ...], longest: int, mirror: FrameMirror) -> None:
        """longest: frames of the longest window; DataError where no motion is as long."""
        self.store, self.mirror = store, mirror
        spans = [(span, action_of(store, record)) for record in records for span in store.records[record].spans]
        self.starts = np.array([span[0] for span, _ in spans])
        self.lengths = np.array([span[1] - span[0] for span, _ in spans])
        if not spans or self.lengths.max() < longest:
            raise DataError(f"all motions are shorter than {longest} frames")
        shown: dict[str, float] = {}
        for length, (_, action) in zip(self.lengths, spans, strict=True):
            shown[action] = shown.get(action, 0.0) + float(length)
        self.weights = 1 / np.sqrt([shown[action] for _, action in spans])

    def draw(self, batch: int, sizes: tuple[int, int, int], rng: np.random.Generator) -> GapWindow:
        """A batch of windows with so many frames before, in and after the gap."""
        frames = sum(sizes)
        room = np.maximum(self.lengths - frames + 1, 0) * self.weights
        which = rng.choice(len(room), batch, p=room / room.sum())
        starts = self.starts[which] + rng.integers(self.lengths[which] - frames + 1)
        found = np.stack([np.array(self.store.frames[start : start + frames], np.float64) for start in starts])
        mirrored = rng.random(batch) < 0.5
        found[mirrored] = self.mirror(found[mirrored])
        return gap_window(placed_by_way(found, self.store.fps), sizes[0], sizes[1])


def gap_window(frames: Array, before: int, count: int) -> GapWindow:
    """Windows of placed frames (B, T, E), ``before`` of which are before a gap of ``count`` frames."""
    seen = seen_from(frames, pose_of(frames[:, before - 1]))
    past, truth, after = np.split(seen, [before, before + count], axis=1)
    parts = (past, bridge(past, after, count), after, truth)
    return GapWindow(*(torch.from_numpy(part.astype(np.float32)) for part in parts))
