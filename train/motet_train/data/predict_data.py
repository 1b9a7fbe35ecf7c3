"""What a predictor is trained on: sequences of frames, here those of motion files in a store."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotionError
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.errors import DataError
from motet_train.data.preparation import VECTORS
from motet_train.data.split import split
from motet_train.data.store import Store


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

    name: the store's. by: which those are, and those for validation, see :func:`motet_train.data.split.split`.
    """
    if store.representation != VECTORS.representation:
        raise DataError(f"{name} is a store of {store.representation}: prepare it with --for predict")
    parts = split(store.records, 0, by)
    contract = store.contract(parts.train)
    sequences = _spans(store, parts.train)
    lengths = np.array([len(frames) for frames in sequences], dtype=np.float64)
    mirrored, signs = _mirrored(contract)
    named = {part: [store.records[record].name for record in getattr(parts, part)] for part in ("validation", "test")}
    return Material(
        contract,
        sequences,
        lengths / lengths.sum(),
        1,
        tuple(int(column) for column in np.flatnonzero(contract.std)),
        mirrored=mirrored,
        signs=signs,
        rates=tuple(column for column, unit in enumerate(contract.units) if unit.endswith("/s")),
        about={
            "name": name,
            "files": len(parts.train),
            "split": by,
            "skipped": [item.name for item in store.skipped],
            **named,
        },
        validation=_spans(store, parts.validation),
    )


def _spans(store: Store, records: Sequence[int]) -> list[NDArray[np.float32]]:
    """The frames of some records, of all phases."""
    return [store.frames[start:stop] for record in records for start, stop in store.records[record].spans]


def _mirrored(contract: MotionContract) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Columns and signs of mirrored frames; nothing where they cannot be mirrored."""
    try:
        return tuple(contract.mirror.columns.tolist()), tuple(contract.mirror.signs.tolist())
    except MotionError:
        return (), ()
