"""Frames of codes as they come: as many as the decoder can give before it knows what follows."""

from dataclasses import dataclass

import numpy as np

from motet.bundle.graph import Graph
from motet.decode.planar import moved, seen_from, way_of
from motet.decode.rollout import Ids
from motet.motion.rotations import Array

PATH = 3
"""Of the decoder's channels the first: the root's forward, left and turn, seen from where the moves have led."""

REST = 0.4
"""Seconds over which what a given motion's last frame is beside its codes is taken back."""


@dataclass(frozen=True)
class Sight:
    """How many steps of codes the decoder looks back and ahead, and how many frames a step has."""

    back: int
    ahead: int
    hop: int


class Unrolled:
    """Frames (T, D) of steps of codes (P,) that are pushed one by one; holds all state of one request.

    The root's forward, left and turn come as rates a second, from each frame to the next, so that adding them up gives
    the way. last: the last frame (D,) of a motion that goes on, in the contract's units, whose codes are ``given``.
    """

    def __init__(
        self, decoder: Graph, sight: Sight, fps: float, given: Ids | None = None, last: Array | None = None
    ) -> None:
        self.decoder, self.sight, self.fps = decoder, sight, fps
        self.codes = [] if given is None else list(given)
        self.count = len(self.codes)  # steps of which frames were given
        self.way = np.zeros((1, 3))
        self.pose: Array | None = None
        self.off, self.taken = np.zeros(0), 0
        if last is not None:
            self._join(last)

    def _join(self, last: Array) -> None:
        """Begin where a motion ends: its way goes on, and its pose is left little by little."""
        self.count -= 1
        self.codes.append(self.codes[-1])  # something has to follow
        frames = self._settled(self.count + 1)
        self.codes.pop()
        self.off, self.taken = last[PATH:] - frames[-1, PATH:], 0

    def push(self, step: Ids) -> Array:
        """Frames (T, D) that a further step settles; none at first."""
        self.codes.append(step)
        found = self._settled(len(self.codes) - self.sight.ahead)
        over = max(0, self.count - self.sight.back)  # out of sight
        self.codes, self.count = self.codes[over:], self.count - over
        return found

    def all(self, steps: Ids) -> Array:
        """The frames of steps (N, P) with nothing following."""
        self.codes += list(steps)
        return self.finish()

    def finish(self) -> Array:
        """The frames that are left, nothing following."""
        return self._settled(len(self.codes))

    def _settled(self, until: int) -> Array:
        if until <= self.count:
            return np.empty((0, self.decoder.spec.output("frames").size(-1)))
        start = max(0, self.count - self.sight.back)
        part = np.array(self.codes[start : until + self.sight.ahead])
        found = self.decoder({"codes": np.stack([part, part])})  # two rows: a lone one is rounded differently
        moves = found["moves"][0].astype(np.float64)
        frames = found["frames"][0, self.count - start : until - start].astype(np.float64)
        way = way_of(self.way[-1], moves[self.count - start : until - start])
        self.way, self.count = way[-1:], until
        return self._blended(self._rated(frames, way[:-1]))

    def _rated(self, frames: Array, way: Array) -> Array:
        """Frames (N, H, D), the root seen from the way (N, 3), as frames (N H, D) with rates."""
        poses = moved(way[:, None], frames[..., :PATH]).reshape(-1, PATH)
        before = poses[:1] if self.pose is None else self.pose[None]
        rates = seen_from(np.concatenate([before, poses[:-1]]), poses) * self.fps
        if self.pose is None:
            rates[:1] = rates[1:2]
        self.pose = poses[-1]
        return np.concatenate([rates, frames.reshape(len(poses), -1)[:, PATH:]], axis=1)

    def _blended(self, frames: Array) -> Array:
        if len(self.off):
            times = (self.taken + 1 + np.arange(len(frames))) / (REST * self.fps)
            frames[:, PATH:] += np.maximum(1 - times, 0)[:, None] ** 2 * self.off
            self.taken += len(frames)
        return frames
