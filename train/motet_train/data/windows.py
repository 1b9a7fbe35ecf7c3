"""Windows of motions to train predictors on, drawn afresh for each batch."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.representation.root_vectors import VECTOR_KINDS, joints_of
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material


class Windows:
    """Draws windows (B, T, C) of the sequences at the contract's frame rate.

    warp: a window is slower or faster by up to this much, as exp(+-warp). reverse: the share played backwards. mirror:
    the share that is mirrored. seed: how many frames of a window are given, where exponential maps are to be as a
    predictor is asked about them (:func:`anchored`). DataError where no sequence is long enough.
    """

    def __init__(
        self,
        material: Material,
        frames: int,
        warp: float = 0.0,
        reverse: float = 0.0,
        mirror: float = 0.0,
        seed: int | None = None,
    ) -> None:
        self.material, self.frames, self.seed = material, frames, seed
        joints = joints_of(material.contract.channels)
        self.maps = [material.contract.channels.index(f"{joint}.{kind}") for joint in joints for kind in VECTOR_KINDS]
        self.warp, self.reverse, self.mirror = warp, reverse, mirror
        lengths = np.array([len(sequence) for sequence in material.sequences])
        usable = lengths > material.stride * (frames - 1) + 1
        if not usable.any():
            raise DataError(f"all motions are shorter than a window of {frames} frames at the model's rate")
        chances = np.where(usable, material.chances, 0.0)
        self.chances = chances / chances.sum()
        self.lengths, self.starts = lengths, np.cumsum(lengths) - lengths
        self.all = torch.from_numpy(np.concatenate(material.sequences))
        self.columns, self.signs = torch.tensor(material.mirrored), torch.tensor(material.signs)

    def draw(self, batch: int, rng: np.random.Generator) -> Tensor:
        """A batch of windows."""
        which = rng.choice(len(self.chances), batch, p=self.chances)
        last = self.lengths[which] - 1.01
        speed = self.material.stride * np.exp(rng.uniform(-self.warp, self.warp, batch))
        speed = np.minimum(speed, last / (self.frames - 1))
        start = rng.uniform(0, 1, batch) * (last - speed * (self.frames - 1))
        if not self.warp:
            speed, start = np.full(batch, float(self.material.stride)), np.floor(start)
        windows = self._interpolated(which, start[:, None] + speed[:, None] * np.arange(self.frames))
        faster = torch.from_numpy((speed / self.material.stride).astype(np.float32))
        windows[..., self.material.rates] *= faster[:, None, None]
        backwards = _some(rng, batch, self.reverse)
        windows = torch.where(backwards, windows.flip(1), windows)
        if self.mirror:
            windows = torch.where(_some(rng, batch, self.mirror), windows[..., self.columns] * self.signs, windows)
        return self._anchored(windows)

    def along(self, sequences: Sequence[NDArray[np.float32]], apart: int) -> Tensor:
        """Windows (W, T, C) all along sequences (T, C) at the contract's frame rate, as they are, every ``apart``
        frames; DataError where all are too short."""
        starts = [(one, start) for one in sequences for start in range(0, len(one) - self.frames + 1, apart)]
        if not starts:
            raise DataError(f"the motions held out are all shorter than a window of {self.frames} frames")
        return self._anchored(torch.from_numpy(np.stack([one[start : start + self.frames] for one, start in starts])))

    def _anchored(self, windows: Tensor) -> Tensor:
        if self.seed is not None and self.maps:
            maps = windows[..., self.maps].reshape(*windows.shape[:2], -1, 3)
            windows[..., self.maps] = anchored(maps, self.seed - 1).flatten(2)
        return windows

    def _interpolated(self, which: Any, times: Any) -> Tensor:
        before = np.floor(times + 1e-6).astype(np.int64)
        part = torch.from_numpy(np.maximum(times - before, 0).astype(np.float32))[..., None]
        index = torch.from_numpy(before + self.starts[which][:, None])
        after = (index + 1).clamp_max(len(self.all) - 1)
        return self.all[index] * (1 - part) + self.all[after] * part


def anchored(vectors: Tensor, frame: int) -> Tensor:
    """Continuous exponential maps (B, T, J, 3) that are at most half a turn at one frame, as where a seed ends.

    A joint that has turned further over a whole motion is given in other numbers than in a motion that ends there.
    """
    then = vectors[:, frame : frame + 1]
    turns = torch.round(then.norm(dim=-1, keepdim=True) / (2 * torch.pi))
    if not turns.any():
        return vectors
    angle = vectors.norm(dim=-1, keepdim=True)
    axis = torch.where(angle > 1e-3, vectors / angle.clamp_min(1e-9), torch.nn.functional.normalize(then, dim=-1))
    # an axis that points the other way is that of a negative angle
    axis = axis * torch.where((axis * then).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    return vectors - 2 * torch.pi * turns * axis


def _some(rng: np.random.Generator, batch: int, share: float) -> Tensor:
    return torch.from_numpy(rng.random(batch) < share)[:, None, None]
