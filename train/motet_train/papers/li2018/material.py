"""The text files of the protocol as what predictors are trained on."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.cmu_trials import CMU_LICENCE
from motet_train.data.predict_data import Material
from motet_train.papers.li2018.expmap_files import ROOT_COLUMNS, ExpmapCorpus, Layout, scaling_of

STRIDE = 2
"""Of the protocol: every second frame of a text file."""


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpmapMaterial(Material):
    """Sequences of text files, which have no bones, and how their columns lie."""

    layout: Layout


def expmap_material(corpus: ExpmapCorpus, kept_back: Sequence[str] = ()) -> ExpmapMaterial:
    """The training files of the protocol: each action as often as another, whatever its length.

    kept_back: names of files, of :func:`validation_files`, that are for validation; they count in the statistics.
    """
    layout, scaling = corpus.layout, scaling_of(corpus.train)
    count = layout.columns
    channels = ("root.tx", "root.ty", "root.tz", *(f"joint{n}.e{a}" for n in range((count - 3) // 3) for a in "xyz"))
    units = ("length",) * 3 + ("rad",) * (count - 3)
    std = np.where(np.isin(np.arange(count), scaling.kept), scaling.std, 0.0)
    contract = MotionContract("angles", channels, units, layout.fps / STRIDE, scaling.mean, std, None)
    sequences, chances = _visited(corpus, kept_back)
    mirrored, signs = _mirrored_columns(layout)
    held = sum(column < ROOT_COLUMNS for column in scaling.kept)
    about = {"name": layout.name, "files": len(sequences), "missing": list(corpus.missing)}
    if kept_back:
        about["validation"] = list(kept_back)
    validation = [_sequence(files[name]) for files in corpus.train.values() for name in files if name in kept_back]
    return ExpmapMaterial(
        contract,
        sequences,
        chances,
        STRIDE,
        scaling.kept,
        held=held,
        mirrored=mirrored,
        signs=signs,
        licence=CMU_LICENCE if layout.name.startswith("cmu") else "Human3.6M, research use only",
        about=about,
        validation=validation,
        layout=layout,
    )


def validation_files(corpus: ExpmapCorpus, window: int) -> tuple[str, ...]:
    """Of each group that is measured, or of each where none is, the shortest file that is longer than a window.

    Groups of one file keep none back. window: in frames of every second one.
    """
    groups = {group: files for group, files in corpus.train.items() if group in corpus.test} or dict(corpus.train)
    found = []
    for files in groups.values():
        long = {name: len(frames) for name, frames in files.items() if len(frames) > STRIDE * (window + 1)}
        if len(files) > 1 and long:
            found.append(min(long, key=long.__getitem__))
    return tuple(found)


def _sequence(frames: Array) -> NDArray[np.float32]:
    # a file's first frame can be a T-pose that was added
    return frames[1:].astype(np.float32)


def _visited(corpus: ExpmapCorpus, kept_back: Sequence[str]) -> tuple[list[NDArray[np.float32]], Array]:
    """The training sequences, and how often each is visited."""
    extra = corpus.layout.extra
    # of the groups those that are measured, and what resembles them
    groups = {group: files for group, files in corpus.train.items() if group in corpus.test or group in extra}
    groups = groups or dict(corpus.train)
    groups = {group: {n: files[n] for n in files if n not in kept_back} for group, files in groups.items()}
    sequences = [_sequence(frames) for files in groups.values() for frames in files.values()]
    chances = [
        (0.5 if group in extra else 1.0) * len(frames) / sum(map(len, files.values()))
        for group, files in groups.items()
        for frames in files.values()
    ]
    return sequences, np.array(chances) / sum(chances)


def _mirrored_columns(layout: Layout) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Left is along x: its translation changes sign, and so do turns about the other two axes."""
    if not layout.pairs:
        return (), ()
    columns = np.arange(layout.columns)
    for left, right, width in layout.pairs:
        columns[left : left + width] = np.arange(right, right + width)
        columns[right : right + width] = np.arange(left, left + width)
    signs = np.tile([1.0, -1.0, -1.0], layout.columns // 3)
    signs[:3] = -1.0, 1.0, 1.0
    return tuple(columns.tolist()), tuple(signs.tolist())
