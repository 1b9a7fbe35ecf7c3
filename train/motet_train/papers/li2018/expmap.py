"""Exponential-map text files: the CMU and Human3.6M motions on which motion prediction is measured.

One frame per line, columns separated by commas: the root's translation (3), then an exponential map (3, radians) for
each joint, the root first. Letters in shapes: T frames, C columns of a file (117 or 99).
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import FormatError
from motet.formats.text import naming, numbers
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.archive import Archive
from motet_train.data.cmu_trials import CMU_LICENCE
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material
from motet_train.data.table import read_toml
from motet_train.models.net import configured

STRIDE = 2
"""The protocol uses every second frame of a file."""

SEED_FRAMES = 50
"""Frames that a predictor is given."""

OUTPUT_FRAMES = 25
"""Frames that it predicts."""

PROTOCOL_WINDOW = SEED_FRAMES + OUTPUT_FRAMES

CONSTANT_STD = 1e-4
"""A column whose standard deviation over the training files is smaller is dropped (protocol)."""

ROOT_COLUMNS = 6
"""Columns of the root: translation and rotation."""

Files = Mapping[str, Mapping[str, Array]]
"""Group (an action, or a subject) -> name of a file -> frames (T, C)."""


@dataclass(frozen=True)
class Layout:
    """The files of a corpus in its archive or folder, and the columns of a line.

    train, test: group -> names. fps: of the files. pairs: (left, right, width), spans of columns that are mirrored.
    extra: training groups that are not measured, as their test files are missing; they count half. first, room: a test
    window of a motion of T sub-sampled frames starts in [first, T - room). padding: of the convolutions of Li et al.
    2018.
    """

    name: str
    columns: int
    train: Mapping[str, Sequence[str]]
    test: Mapping[str, Sequence[str]]
    fps: float
    pairs: tuple[tuple[int, int, int], ...]
    extra: tuple[str, ...] = ()
    first: int = 0
    room: int = PROTOCOL_WINDOW
    padding: Literal["valid", "same"] = "valid"

    @property
    def names(self) -> list[str]:
        """The names of all files."""
        return [*chain.from_iterable(self.train.values()), *chain.from_iterable(self.test.values())]


LAYOUTS = read_toml(__file__, "layouts.toml")
CMU_LAYOUT: Layout = configured(Layout, LAYOUTS["cmu"])
H36M_LAYOUT: Layout = configured(Layout, LAYOUTS["h36m"])


@dataclass(frozen=True, eq=False)
class ExpmapCorpus:
    """The existing files, at their own frame rate, and the names of missing ones."""

    layout: Layout
    train: Files
    test: Files
    missing: tuple[str, ...]

    def measured(self) -> Files:
        """The training files of the groups that are measured, or all if none is."""
        return {group: files for group, files in self.train.items() if group in self.test} or self.train


class Scaling(NamedTuple):
    """Statistics over all training frames, not sub-sampled (protocol). mean, std: (C,). kept: columns that vary."""

    mean: Array
    std: Array
    kept: tuple[int, ...]

    def with_constants(self, frames: Array) -> Array:
        """Frames (..., C) with dropped columns at their mean, as after normalising and undoing it."""
        result = np.array(np.broadcast_to(self.mean, frames.shape))
        result[..., list(self.kept)] = frames[..., list(self.kept)]
        return result


def is_expmap(path: Path) -> bool:
    """Whether a folder or zip has a file of one of the layouts."""
    with Archive(path) as archive:
        return _detected(archive) is not None


def read_expmap(path: Path) -> ExpmapCorpus:
    """Read the existing files of a corpus in a folder or zip, and detect which of the two corpora it is.

    DataError if none of the files exists; FormatError names file and line of an error.
    """
    with Archive(path) as archive:
        detected = _detected(archive)
        if detected is None:
            raise DataError(f"no exponential-map files in {path}: for example, it has no train/walking/walking_1.txt")
        layout, files = detected
        train = _read_groups(archive, layout.train, files, layout)
        test = _read_groups(archive, layout.test, files, layout)
        missing = tuple(name for name in layout.names if name not in files)
        return ExpmapCorpus(layout, train, test, missing)


def _detected(archive: Archive) -> tuple[Layout, dict[str, str]] | None:
    """The layout of the files of an archive, and these: name -> first file of the archive, in any folder."""
    for layout in (CMU_LAYOUT, H36M_LAYOUT):
        files = {}
        for name in layout.names:
            matches = (file for file in archive.names if f"/{file}".endswith(f"/{name}"))
            file = next(matches, None)
            if file is not None:
                files[name] = file
        if files:
            return layout, files
    return None


def _read_groups(
    archive: Archive, groups: Mapping[str, Sequence[str]], files: Mapping[str, str], layout: Layout
) -> Files:
    """The existing files of groups, without empty groups."""
    read: dict[str, dict[str, Array]] = {}
    for group, names in groups.items():
        for name in names:
            if name in files:
                read.setdefault(group, {})[name] = _read(archive, files[name], layout)
    return read


def _read(archive: Archive, file: str, layout: Layout) -> Array:
    with archive.opened(file) as place:
        try:
            return parse(place.read_text(encoding="utf-8"), archive.origin(file), layout.columns)
        except UnicodeDecodeError as error:
            raise FormatError(archive.origin(file), "not a text file") from error


def parse(text: str, path: str | Path, columns: int) -> Array:
    """Text to frames (T, C); FormatError names file and line of an error."""
    if not text.strip():
        raise FormatError(path, "no frames")
    try:
        frames = np.loadtxt(io.StringIO(text), delimiter=",", ndmin=2)
        if frames.shape[1] == columns and np.isfinite(frames).all():
            return frames
    except ValueError:
        pass  # read line by line to name the one at fault
    rows = []
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        parts = line.split(",")
        if len(parts) != columns:
            raise FormatError(path, f"{len(parts)} numbers instead of {columns}", number)
        with naming(path):
            rows.append(numbers(parts, number))
    return np.array(rows)


def scaling_of(train: Files) -> Scaling:
    """The statistics of the training files; DataError if there are none."""
    motions = _all_frames(train)
    if not motions:
        raise DataError("there are no training files")
    frames = np.concatenate(motions)
    std = frames.std(axis=0)
    return Scaling(frames.mean(axis=0), std, tuple(np.flatnonzero(std >= CONSTANT_STD).tolist()))


def _all_frames(groups: Files) -> list[Array]:
    return list(chain.from_iterable(files.values() for files in groups.values()))


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpmapMaterial(Material):
    """Sequences of text files, which have no skeleton, and the layout of their columns."""

    layout: Layout


def expmap_material(corpus: ExpmapCorpus, kept_back: Sequence[str] = ()) -> ExpmapMaterial:
    """The training files of the protocol: all actions are drawn equally often, whatever their length.

    kept_back: names of files, from :func:`validation_files`, for validation; they count in the statistics.
    """
    layout = corpus.layout
    scaling = scaling_of(corpus.train)
    # the files to train on, and those kept back
    groups = _training_groups(corpus, kept_back)
    sequences = [_sequence(frames) for frames in _all_frames(groups)]
    validation = []
    for files in corpus.train.values():
        validation += [_sequence(files[name]) for name in files if name in kept_back]
    mirrored, signs = _mirrored_columns(layout)
    # what the manifest says of them
    about: dict[str, Any] = {"name": layout.name, "files": len(sequences), "missing": list(corpus.missing)}
    if kept_back:
        about["validation"] = list(kept_back)
    return ExpmapMaterial(
        _contract(layout, scaling),
        sequences,
        _chances(groups, layout),
        STRIDE,
        scaling.kept,
        held=sum(column < ROOT_COLUMNS for column in scaling.kept),
        mirrored=mirrored,
        signs=signs,
        licence=CMU_LICENCE if layout.name.startswith("cmu") else "Human3.6M, research use only",
        about=about,
        validation=validation,
        layout=layout,
    )


def _training_groups(corpus: ExpmapCorpus, kept_back: Sequence[str]) -> Files:
    """The groups to train on, without files kept back: those that are measured, and the extra ones."""
    names = [group for group in corpus.train if group in corpus.test or group in corpus.layout.extra]
    groups = {}
    for group in names or corpus.train:
        files = corpus.train[group]
        groups[group] = {name: frames for name, frames in files.items() if name not in kept_back}
    return groups


def _chances(groups: Files, layout: Layout) -> Array:
    """Chances of files: equal for groups, half for extra ones, and by length within a group."""
    chances: list[float] = []
    for group, files in groups.items():
        total = sum(map(len, files.values()))
        weight = 0.5 if group in layout.extra else 1.0
        chances += [weight * len(frames) / total for frames in files.values()]
    return np.array(chances) / sum(chances)


def _contract(layout: Layout, scaling: Scaling) -> MotionContract:
    """The contract of all columns at the protocol's rate, with a deviation of 0 for dropped ones."""
    count = layout.columns
    channels = ["root.tx", "root.ty", "root.tz"]
    for number in range((count - 3) // 3):
        channels += [f"joint{number}.e{axis}" for axis in "xyz"]
    units = ("length",) * 3 + ("rad",) * (count - 3)
    std = np.where(np.isin(np.arange(count), scaling.kept), scaling.std, 0.0)
    return MotionContract("angles", tuple(channels), units, layout.fps / STRIDE, scaling.mean, std, None)


def validation_files(corpus: ExpmapCorpus) -> tuple[str, ...]:
    """For each measured group of several files, the shortest one that is longer than a window."""
    names = []
    for files in corpus.measured().values():
        long = {name: len(frames) for name, frames in files.items() if len(frames) > STRIDE * (PROTOCOL_WINDOW + 1)}
        if len(files) > 1 and long:
            names.append(min(long, key=long.__getitem__))
    return tuple(names)


def _sequence(frames: Array) -> Floats:
    return frames[1:].astype(np.float32)  # a file's first frame can be a T-pose that was added


def _mirrored_columns(layout: Layout) -> tuple[tuple[int, ...], tuple[float, ...]]:
    """Columns and signs that mirror frames: left is along x, so its translation and turns about y and z change sign."""
    # exchange the columns of both sides
    columns = np.arange(layout.columns)
    for left, right, width in layout.pairs:
        columns[left : left + width] = np.arange(right, right + width)
        columns[right : right + width] = np.arange(left, left + width)
    signs = np.tile([1.0, -1.0, -1.0], layout.columns // 3)
    signs[:3] = -1.0, 1.0, 1.0
    return tuple(columns.tolist()), tuple(signs.tolist())
