"""Exponential-map text files: the CMU and Human3.6M motions that motion prediction is measured on.

One frame a line, columns separated by commas: the root's translation (3), then an exponential map (3, radians) for
each joint, the root first. Letters in shapes: T frames, C columns of a file (117 or 99).
"""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from motet.errors import FormatError
from motet.formats.lines import numbers
from motet.motion.rotations import Array
from motet_train.data.archive import Archive
from motet_train.data.errors import DataError

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


def _numbered(part: str, actions: Sequence[str], count: int) -> dict[str, list[str]]:
    return {action: [f"{part}/{action}/{action}_{n}.txt" for n in range(1, count + 1)] for action in actions}


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
    _numbered("train", CMU_ACTIONS, 5),
    _numbered("test", CMU_ACTIONS, 1),
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
        return _layout(archive) is not None


def read_expmap(path: Path) -> ExpmapCorpus:
    """Read what exists of a corpus in a folder or zip; its files tell which of the two it is.

    DataError where there is none of its files; FormatError names file and line of one that does not fit.
    """
    with Archive(path) as archive:
        layout = _layout(archive)
        if layout is None:
            raise DataError(f"no exponential-map files in {path}: for example, it has no train/walking/walking_1.txt")
        train = _groups(archive, layout.train, layout.columns)
        test = _groups(archive, layout.test, layout.columns)
        missing = tuple(name for name in _names(layout) if _found(archive, name) is None)
        return ExpmapCorpus(layout, train, test, missing)


def scaling_of(train: Files) -> Scaling:
    """The statistics of the training files; DataError where there is none."""
    motions = [frames for files in train.values() for frames in files.values()]
    if not motions:
        raise DataError("there are no training files")
    frames = np.concatenate(motions)
    std = frames.std(axis=0)
    kept = tuple(int(column) for column in np.flatnonzero(std >= CONSTANT_STD))
    return Scaling(frames.mean(axis=0), std, kept)


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
    lines = enumerate(text.splitlines(), start=1)
    return np.array([_row(line, path, number, columns) for number, line in lines if line.strip()])


def _row(line: str, path: str | Path, number: int, columns: int) -> list[float]:
    parts = line.split(",")
    if len(parts) != columns:
        raise FormatError(path, f"{len(parts)} numbers instead of {columns}", number)
    return numbers(parts, Path(path), number)


def _layout(archive: Archive) -> Layout | None:
    layouts = (CMU_LAYOUT, H36M_LAYOUT)
    return next((layout for layout in layouts if any(_found(archive, name) for name in _names(layout))), None)


def _names(layout: Layout) -> list[str]:
    return [name for groups in (layout.train, layout.test) for names in groups.values() for name in names]


def _found(archive: Archive, name: str) -> str | None:
    """The file of the archive that has this name, in whatever folder."""
    return next((known for known in archive.names if known == name or known.endswith(f"/{name}")), None)


def _groups(archive: Archive, groups: Mapping[str, Sequence[str]], columns: int) -> dict[str, dict[str, Array]]:
    read = {group: {name: _read(archive, name, columns) for name in names} for group, names in groups.items()}
    found = {group: {n: frames for n, frames in files.items() if frames is not None} for group, files in read.items()}
    return {group: files for group, files in found.items() if files}


def _read(archive: Archive, name: str, columns: int) -> Array | None:
    known = _found(archive, name)
    if known is None:
        return None
    with archive.opened(known) as place:
        try:
            return parse(place.read_text(encoding="utf-8"), archive.origin(known), columns)
        except UnicodeDecodeError as error:
            raise FormatError(archive.origin(known), "not a text file") from error
