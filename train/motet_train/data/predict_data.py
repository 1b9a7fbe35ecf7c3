"""Training data of predictors: sequences of frames, and windows of them drawn afresh for each batch."""

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
    """Sequences (T, C) float32 at ``stride`` times the contract's frame rate.

    contract: its mean and std are those of training. chances: how often each sequence is drawn. kept: columns that
    vary, of which the first ``held`` are not predicted. mirrored, signs: see PredictorConfig. rates: columns that are
    velocities, which grow when a motion is played faster; with them it cannot be played backwards. about: the
    description of the data in the manifest. validation: sequences that were held out.
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
    # frames of training, longer motions more often
    sequences = _sequences(store, parts.train)
    lengths = np.array([len(frames) for frames in sequences], dtype=np.float64)
    mirrored, signs = _mirroring(contract)
    about = {
        "name": name,
        "files": len(parts.train),
        "split": by,
        "skipped": [item.name for item in store.skipped],
        "validation": store.names(parts.validation),
        "test": store.names(parts.test),
    }
    return Material(
        contract,
        sequences,
        chances=lengths / lengths.sum(),
        stride=1,
        kept=tuple(int(column) for column in np.flatnonzero(contract.std)),
        mirrored=mirrored,
        signs=signs,
        rates=_rates(contract),
        about=about,
        validation=_sequences(store, parts.validation),
    )


def _rates(contract: MotionContract) -> tuple[int, ...]:
    """The columns of velocities."""
    return tuple(column for column, unit in enumerate(contract.units) if unit.endswith("/s"))


def _sequences(store: Store, records: Sequence[int]) -> list[NDArray[np.float32]]:
    """The frames of all spans of some records."""
    sequences = []
    for record in records:
        sequences += [store.frames[start:stop] for start, stop in store.records[record].spans]
    return sequences


def _mirroring(contract: MotionContract) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """The columns and signs that mirror frames; empty where they cannot be mirrored."""
    try:
        mirror = contract.mirror
    except MotionError:
        return (), ()
    return tuple(mirror.columns.tolist()), tuple(mirror.signs.tolist())


class Windows:
    """Draws windows (B, T, C) of the sequences at the contract's frame rate.

    frames: T. warp: a window is played slower or faster, by a factor of up to exp(+-warp). reverse, mirror: shares of
    windows played backwards and mirrored. seed: number of first frames that a predictor is given; exponential maps are
    :func:`anchored` at the last of them, as they are in use. DataError if every sequence is too short.
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
        self.material = material
        self.frames = frames
        self.warp = warp
        self.reverse = reverse
        self.mirror = mirror
        self.seed = seed
        self.maps = _vector_columns(material.contract)
        self.lengths = np.array([len(sequence) for sequence in material.sequences])
        self.starts = np.cumsum(self.lengths) - self.lengths
        # sequences too short for a window are never drawn
        usable = self.lengths > material.stride * (frames - 1) + 1
        if not usable.any():
            raise DataError(f"all motions are shorter than a window of {frames} frames at the model's rate")
        chances = np.where(usable, material.chances, 0.0)
        self.chances = chances / chances.sum()
        self.all = torch.from_numpy(np.concatenate(material.sequences))
        self.columns = torch.tensor(material.mirrored)
        self.signs = torch.tensor(material.signs)

    def draw(self, batch: int, rng: np.random.Generator) -> Tensor:
        """A batch of windows."""
        sequence = rng.choice(len(self.chances), batch, p=self.chances)
        start, speed = self._drawn(sequence, rng)
        times = start[:, None] + speed[:, None] * np.arange(self.frames)
        windows = self._interpolated(sequence, times)
        # velocities change with the speed of play
        factor = torch.from_numpy((speed / self.material.stride).astype(np.float32))
        windows[..., self.material.rates] *= factor[:, None, None]
        # play some backwards, and mirror some
        windows = torch.where(_chosen(self.reverse, batch, rng), windows.flip(1), windows)
        if self.mirror:
            mirrored = windows[..., self.columns] * self.signs
            windows = torch.where(_chosen(self.mirror, batch, rng), mirrored, windows)
        return self._anchored(windows)

    def _drawn(self, sequence: NDArray[np.int64], rng: np.random.Generator) -> tuple[Array, Array]:
        """For each window a start in its sequence, and a speed in frames of the sequence per frame: (B,) each."""
        batch = len(sequence)
        # a slow enough play that the window fits
        last = self.lengths[sequence] - 1.01
        speed = self.material.stride * np.exp(rng.uniform(-self.warp, self.warp, batch))
        speed = np.minimum(speed, last / (self.frames - 1))
        # anywhere that leaves room for it
        start = rng.uniform(0, 1, batch) * (last - speed * (self.frames - 1))
        if self.warp:
            return start, speed
        # unwarped windows are the recorded frames themselves
        return np.floor(start), np.full(batch, float(self.material.stride))

    def _interpolated(self, sequence: NDArray[np.int64], times: Array) -> Tensor:
        """Frames (B, T, C) of sequences (B,) at fractional times (B, T), linear between recorded ones."""
        before = np.floor(times + 1e-6).astype(np.int64)
        weight = torch.from_numpy(np.maximum(times - before, 0).astype(np.float32))[..., None]
        index = torch.from_numpy(before + self.starts[sequence][:, None])
        after = (index + 1).clamp_max(len(self.all) - 1)
        return self.all[index] * (1 - weight) + self.all[after] * weight

    def along(self, sequences: Sequence[NDArray[np.float32]], apart: int) -> Tensor:
        """Windows (W, T, C) of sequences (T, C) at the contract's frame rate, unchanged, starting every ``apart``
        frames; DataError if every sequence is too short."""
        windows = []
        for sequence in sequences:
            for start in range(0, len(sequence) - self.frames + 1, apart):
                windows.append(sequence[start : start + self.frames])
        if not windows:
            raise DataError(f"the motions held out are all shorter than a window of {self.frames} frames")
        return self._anchored(torch.from_numpy(np.stack(windows)))

    def _anchored(self, windows: Tensor) -> Tensor:
        if self.seed is not None and self.maps:
            maps = windows[..., self.maps].reshape(*windows.shape[:2], -1, 3)
            windows[..., self.maps] = anchored(maps, self.seed - 1).flatten(2)
        return windows


def _vector_columns(contract: MotionContract) -> list[int]:
    """The columns of exponential maps, three for each joint."""
    columns = []
    for joint in joints_of(contract.channels):
        columns += [contract.channels.index(f"{joint}.{kind}") for kind in VECTOR_KINDS]
    return columns


def _chosen(share: float, batch: int, rng: np.random.Generator) -> Tensor:
    """Which windows of a batch are changed, (B, 1, 1) bool."""
    return torch.from_numpy(rng.random(batch) < share)[:, None, None]


def anchored(vectors: Tensor, frame: int) -> Tensor:
    """Continuous exponential maps (B, T, J, 3), shifted by whole turns to at most half a turn at one frame.

    A seed on its own ends in this range, however often its joints have turned before.
    """
    anchor = vectors[:, frame : frame + 1]
    turns = torch.round(anchor.norm(dim=-1, keepdim=True) / (2 * torch.pi))
    if not turns.any():
        return vectors
    # near the identity the axis is undefined: take that of the anchor
    angle = vectors.norm(dim=-1, keepdim=True)
    axis = torch.where(angle > 1e-3, vectors / angle.clamp_min(1e-9), torch.nn.functional.normalize(anchor, dim=-1))
    # an axis that points the other way belongs to a negative angle
    axis = axis * torch.where((axis * anchor).sum(-1, keepdim=True) < 0, -1.0, 1.0)
    return vectors - 2 * torch.pi * turns * axis
