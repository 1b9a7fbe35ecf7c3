"""Exponential-map text files: the CMU and Human3.6M motions that motion prediction is measured on.

One frame a line, columns separated by commas: the root's translation (3), then an exponential map (3, radians) for
each joint, the root first. Letters in shapes: T frames, C columns of a file (117 or 99).
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from motet.errors import FormatError
from motet.formats.text import numbers
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet_train.data.archive import Archive
from motet_train.data.cmu_trials import CMU_LICENCE
from motet_train.data.errors import DataError
from motet_train.data.predict_data import Material

STRIDE, SEED_FRAMES, OUTPUT_FRAMES = 2, 50, 25
"""Of the protocol: every second frame of a file, 50 in, 25 out."""

PROTOCOL_WINDOW = SEED_FRAMES + OUTPUT_FRAMES

CONSTANT_STD = 1e-4
"""A column whose standard deviation over the training files is smaller is dropped (protocol)."""

ROOT_COLUMNS = 6
"""Columns of the root: translation and rotation."""

Files = Mapping[str, Mapping[str, Array]]
"""Group (an action, or a subject) -> name of a file -> frames (T, C)."""


@dataclass(frozen=True)
class Layout:
    """How one corpus lies in its archive or folder: which files there ought to be, and what is in a line.

    train, test: group -> names. fps: of the files. pairs: (left, right, width), spans of columns that are mirrored.
    extra: groups of the training part that are not measured, as their test files are missing; they count half.
    """

    name: str
    columns: int
    train: Mapping[str, Sequence[str]]
    test: Mapping[str, Sequence[str]]
    fps: float
    pairs: tuple[tuple[int, int, int], ...] = ()
    extra: tuple[str, ...] = ()

    @property
    def names(self) -> list[str]:
        """All files."""
        return [name for groups in (self.train, self.test) for names in groups.values() for name in names]


# fmt: off
CMU_ACTIONS = (
    "basketball", "basketball_signal", "directing_traffic", "jumping", "running", "soccer", "walking", "washwindow",
)
H36M_ACTIONS = (
    "directions", "discussion", "eating", "greeting", "phoning", "posing", "purchases", "sitting", "sittingdown",
    "smoking", "takingphoto", "waiting", "walking", "walkingdog", "walkingtogether",
)
# fmt: on
CMU_LAYOUT = Layout(
    "cmu-expmap",
    117,
    {action: [f"train/{action}/{action}_{n}.txt" for n in range(1, 6)] for action in CMU_ACTIONS},
    {action: [f"test/{action}/{action}_1.txt"] for action in CMU_ACTIONS},
    120.0,
    pairs=((6, 24, 18), (63, 90, 27)),
    extra=("basketball_signal", "directing_traffic"),
)
"""Li et al. 2018: five training trials and one test trial of eight actions."""

H36M_LAYOUT = Layout(
    "h36m-expmap",
    99,
    {f"S{s}": [f"S{s}/{action}_{n}.txt" for action in H36M_ACTIONS for n in (1, 2)] for s in (1, 6, 7, 8, 9, 11)},
    {action: [f"S5/{action}_{n}.txt" for n in (1, 2)] for action in H36M_ACTIONS},
    50.0,
)
"""Human3.6M as its users cut it: subject 5 is the test, two trials of fifteen actions."""


@dataclass(frozen=True, eq=False)
class ExpmapCorpus:
    """The files that were found, at their own frame rate, and the names of those that were not."""

    layout: Layout
    train: Files
    test: Files
    missing: tuple[str, ...]

    def measured(self) -> Files:
        """The training files of the groups that are measured, or all where none is."""
        return {group: files for group, files in self.train.items() if group in self.test} or self.train


@dataclass(frozen=True, eq=False)
class Scaling:
    """Statistics over all training frames, not sub-sampled (protocol). mean, std (C); kept: columns that vary."""

    mean: Array
    std: Array
    kept: tuple[int, ...]

    def with_constants(self, frames: Array) -> Array:
        """Frames (..., C) whose dropped columns are at their mean, as after normalising and undoing it."""
        result = np.array(np.broadcast_to(self.mean, frames.shape))
        result[..., list(self.kept)] = frames[..., list(self.kept)]
        return result


def is_expmap(path: Path) -> bool:
    """Whether a folder or zip has a file of one of the layouts."""
    with Archive(path) as archive:
        return _found(archive) is not None


def read_expmap(path: Path) -> ExpmapCorpus:
    """Read what exists of a corpus in a folder or zip; its files tell which of the two it is.

    DataError where there is none of its files; FormatError names file and line of one that does not fit.
    """
    with Archive(path) as archive:
        found = _found(archive)
        if found is None:
            raise DataError(f"no exponential-map files in {path}: for example, it has no train/walking/walking_1.txt")
        layout, files = found

        def read(groups: Mapping[str, Sequence[str]]) -> Files:
            there = {group: [name for name in names if name in files] for group, names in groups.items()}
            return {g: {n: _read(archive, files[n], layout) for n in names} for g, names in there.items() if names}

        missing = tuple(name for name in layout.names if name not in files)
        return ExpmapCorpus(layout, read(layout.train), read(layout.test), missing)


def _found(archive: Archive) -> tuple[Layout, dict[str, str]] | None:
    """The layout of which there are files, and these: name -> file of the archive, in whatever folder."""
    for layout in (CMU_LAYOUT, H36M_LAYOUT):
        known = ((name, [one for one in archive.names if f"/{one}".endswith(f"/{name}")]) for name in layout.names)
        files = {name: places[0] for name, places in known if places}
        if files:
            return layout, files
    return None


def _read(archive: Archive, file: str, layout: Layout) -> Array:
    with archive.opened(file) as place:
        try:
            return parse(place.read_text(encoding="utf-8"), archive.origin(file), layout.columns)
        except UnicodeDecodeError as error:
            raise FormatError(archive.origin(file), "not a text file") from error


def parse(text: str, path: str | Path, columns: int) -> Array:
    """Text to frames (T, C); FormatError names file and line of what does not fit."""
    if not text.strip():
        raise FormatError(path, "no frames")
    try:
        frames = np.loadtxt(io.StringIO(text), delimiter=",", ndmin=2)
        if frames.shape[1] == columns and np.isfinite(frames).all():
            return frames
    except ValueError:
        pass  # the slow way finds the line
    rows = []
    for number, parts in ((n, line.split(",")) for n, line in enumerate(text.splitlines(), start=1) if line.strip()):
        if len(parts) != columns:
            raise FormatError(path, f"{len(parts)} numbers instead of {columns}", number)
        rows.append(numbers(parts, Path(path), number))
    return np.array(rows)


def scaling_of(train: Files) -> Scaling:
    """The statistics of the training files; DataError where there is none."""
    motions = [frames for files in train.values() for frames in files.values()]
    if not motions:
        raise DataError("there are no training files")
    frames = np.concatenate(motions)
    std = frames.std(axis=0)
    return Scaling(frames.mean(axis=0), std, tuple(np.flatnonzero(std >= CONSTANT_STD).tolist()))


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
    # of the groups those that are measured, and what resembles them
    groups = {g: files for g, files in corpus.train.items() if g in corpus.test or g in layout.extra} or corpus.train
    groups = {group: {n: files[n] for n in files if n not in kept_back} for group, files in groups.items()}
    sequences = [_sequence(frames) for files in groups.values() for frames in files.values()]
    chances = [
        (0.5 if group in layout.extra else 1.0) * len(frames) / sum(map(len, files.values()))
        for group, files in groups.items()
        for frames in files.values()
    ]
    mirrored, signs = _mirrored_columns(layout)
    about = {"name": layout.name, "files": len(sequences), "missing": list(corpus.missing)}
    return ExpmapMaterial(
        MotionContract("angles", channels, units, layout.fps / STRIDE, scaling.mean, std, None),
        sequences,
        np.array(chances) / sum(chances),
        STRIDE,
        scaling.kept,
        held=sum(column < ROOT_COLUMNS for column in scaling.kept),
        mirrored=mirrored,
        signs=signs,
        licence=CMU_LICENCE if layout.name.startswith("cmu") else "Human3.6M, research use only",
        about={**about, "validation": list(kept_back)} if kept_back else about,
        validation=[_sequence(files[name]) for files in corpus.train.values() for name in files if name in kept_back],
        layout=layout,
    )


def validation_files(corpus: ExpmapCorpus) -> tuple[str, ...]:
    """Of each group that is measured the shortest file that is longer than a window; groups of one file keep it."""
    found = []
    for files in corpus.measured().values():
        long = {name: len(frames) for name, frames in files.items() if len(frames) > STRIDE * (PROTOCOL_WINDOW + 1)}
        if len(files) > 1 and long:
            found.append(min(long, key=long.__getitem__))
    return tuple(found)


def _sequence(frames: Array) -> NDArray[np.float32]:
    return frames[1:].astype(np.float32)  # a file's first frame can be a T-pose that was added


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
