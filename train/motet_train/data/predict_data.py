"""What a predictor is trained on: sequences of frames, and windows of them that are drawn afresh for each batch."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet.errors import MotionError
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.root_block import VECTOR_KINDS, joints_of
from motet_train.data.errors import DataError
from motet_train.data.preparation import VECTORS
from motet_train.data.store import Store, split


@dataclass(frozen=True, eq=False)
class Material:
    """Sequences (T, C) float32 at ``stride`` times the contract's frame rate, and how often each is visited.

    contract: its mean and std are those of training. kept: columns that vary, of which the first ``held`` are not
    predicted. mirrored, signs: see PredictorConfig. rates: columns that are velocities, which are faster where a motion
    is played faster; with them it cannot be played backwards. about: what the manifest says of the data. validation:
    sequences that were held out.
    """

    contract: MotionContract
    sequences: Sequence[NDArray[np.float32]]
    chances: Array
    stride: int
    kept: tuple[int, ...]
    held: int = 0
    mirrored: tuple[int, ...] = ()
    signs: tuple[float, ...] = ()
    rates: tuple[int, ...] = ()
    licence: str | None = None
    about: dict[str, Any] = field(default_factory=dict)
    validation: Sequence[NDArray[np.float32]] = ()


def store_material(store: Store, name: str, by: str = "subject") -> Material:
    """The motions of a store that was prepared for predictors, all phases, without the test motions.

    name: the store's. by: how it is divided, see :func:`motet_train.data.store.split`.
    """
    if store.representation != VECTORS.representation:
        raise DataError(f"{name} is a store of {store.representation}: prepare it with --for predict")
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    sequences, validation = (
        [store.frames[start:stop] for record in part for start, stop in store.records[record].spans]
        for part in (parts.train, parts.validation)
    )
    lengths = np.array([len(frames) for frames in sequences], dtype=np.float64)
    try:
        mirrored, signs = contract.mirror.columns.tolist(), contract.mirror.signs.tolist()
    except MotionError:
        mirrored, signs = [], []
    named = {part: [store.records[record].name for record in getattr(parts, part)] for part in ("validation", "test")}
    skipped = [item.name for item in store.skipped]
    return Material(
        contract,
        sequences,
        lengths / lengths.sum(),
        1,
        tuple(int(column) for column in np.flatnonzero(contract.std)),
        mirrored=tuple(mirrored),
        signs=tuple(signs),
        rates=tuple(column for column, unit in enumerate(contract.units) if unit.endswith("/s")),
        about={"name": name, "files": len(parts.train), "split": by, "skipped": skipped, **named},
        validation=validation,
    )


class Windows:
    """Draws windows (B, T, C) of the sequences at the contract's frame rate.

    warp: a window is slower or faster by up to this much, as exp(+-warp). reverse: the share played backwards. mirror:
    the share that is mirrored. seed: how many frames of a window are given, where exponential maps are to be
    :func:`anchored` at their end, as they are for a predictor in use. DataError where no sequence is long enough.
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
        times = start[:, None] + speed[:, None] * np.arange(self.frames)
        before = np.floor(times + 1e-6).astype(np.int64)
        part = torch.from_numpy(np.maximum(times - before, 0).astype(np.float32))[..., None]
        index = torch.from_numpy(before + self.starts[which][:, None])
        after = (index + 1).clamp_max(len(self.all) - 1)
        windows = self.all[index] * (1 - part) + self.all[after] * part
        faster = torch.from_numpy((speed / self.material.stride).astype(np.float32))
        windows[..., self.material.rates] *= faster[:, None, None]

        def some(share: float) -> Tensor:
            return torch.from_numpy(rng.random(batch) < share)[:, None, None]

        windows = torch.where(some(self.reverse), windows.flip(1), windows)
        if self.mirror:
            windows = torch.where(some(self.mirror), windows[..., self.columns] * self.signs, windows)
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


def anchored(vectors: Tensor, frame: int) -> Tensor:
    """Continuous exponential maps (B, T, J, 3) shifted by whole turns to be at most half a turn at one frame.

    A seed that is given alone ends in this range, whatever its joints have turned before.
    """
    then = vectors[:, frame : frame + 1]
    turns = torch.round(then.norm(dim=-1, keepdim=True) / (2 * torch.pi))
    if not turns.any():
        return vectors
    angle = vectors.norm(dim=-1, keepdim=True)
    axis = torch.where(angle > 1e-3, vectors / angle.clamp_min(1e-9), torch.nn.functional.normalize(then, dim=-1))
    # an axis that points the other way belongs to a negative angle
    axis = axis * torch.where((axis * then).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    return vectors - 2 * torch.pi * turns * axis
