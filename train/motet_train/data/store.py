"""The store: a corpus prepared once, its frames in one memory-mapped array.

A folder with ``frames.npy``, (N, D) float32 in the contract's channels, and ``store.json``, which says what they
are, where each record's sequences lie, and what was skipped. Or a folder with such a store in each of several
representations, by their names.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotetError, MotionError
from motet.files import new_folder
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract, living
from motet_train.data.errors import DataError
from motet_train.data.preparation import Preparation
from motet_train.data.records import Record, Skipped

Floats = NDArray[np.float32]
Item = Record | Skipped

FRAMES, INDEX = "frames.npy", "store.json"


@dataclass(frozen=True)
class Entry:
    """A record of the store: a motion or a piece of it, for each down-sampling offset the span (start, stop) of frames.

    skeleton: the index of its figure among the store's. unseen: sentences for measuring. take: what must not be
    divided, which the pieces of a motion have in common. ends: whether the motion ends with it. starts: whether it
    begins with it. action: what is shown, named alike in all records that show it; "" where it is not said. gaits: the
    ways of moving that are shown, where that is said.
    """

    name: str
    subject: str
    sentences: tuple[str, ...]
    spans: tuple[tuple[int, int], ...]
    skeleton: int | None = None
    unseen: tuple[str, ...] = ()
    take: str = ""
    ends: bool = True
    starts: bool = True
    action: str = ""
    gaits: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Store:
    """A prepared corpus. frames: all frames (N, D) float32, memory-mapped, read-only.

    skeletons: the different ones, in metres where their unit is known; each record has the index of its own.
    """

    frames: Floats
    representation: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    fps: float
    skeletons: tuple[Skeleton, ...]
    records: tuple[Entry, ...]
    skipped: tuple[Skipped, ...]

    @property
    def skeleton(self) -> Skeleton | None:
        """The first record's, which shows what is generated."""
        return self.skeletons[0] if self.skeletons else None

    def sequence(self, record: int, offset: int = 0) -> Floats:
        """The frames (T, D) float32 of one record at one down-sampling offset: a view."""
        start, stop = self.records[record].spans[offset]
        return self.frames[start:stop]

    def motion(self, record: int, offset: int = 0) -> Motion:
        """The features of one record at one down-sampling offset, of its own figure."""
        own = self.records[record].skeleton
        skeleton = None if own is None else self.skeletons[own]
        values = self.sequence(record, offset).astype(np.float64)
        return Motion(values, self.channels, self.units, self.fps, skeleton)

    def contract(self, indices: Sequence[int]) -> MotionContract:
        """The motion contract with mean and standard deviation over the records ``indices`` only, 0 where dead."""
        parts = [self.frames[slice(*span)] for index in indices for span in self.records[index].spans]
        count = sum(map(len, parts))
        if not count:
            raise DataError("mean and standard deviation need at least one record")
        mean = sum((part.sum(axis=0, dtype=np.float64) for part in parts), np.zeros(len(self.channels))) / count
        squares = sum((((part - mean) ** 2).sum(axis=0) for part in parts), np.zeros(len(self.channels)))
        std = living(np.sqrt(squares / count), self.units)
        return MotionContract(self.representation, self.channels, self.units, self.fps, mean, std, self.skeleton)

    @staticmethod
    def open(path: Path) -> "Store":
        """Open what :func:`prepare` wrote; DataError where it is not a complete store."""
        try:
            data = json.loads((path / INDEX).read_text(encoding="utf-8"))
            frames = np.load(path / FRAMES, mmap_mode="r")
            skeletons = tuple(Skeleton.from_json(skeleton) for skeleton in data["skeletons"])
            entries = tuple(_entry(entry) for entry in data["records"])
            skipped = tuple(Skipped(**item) for item in data["skipped"])
            channels, units, fps = tuple(data["channels"]), tuple(data["units"]), float(data["fps"])
            representation = str(data["representation"])
        except (OSError, KeyError, TypeError, ValueError, MotetError) as error:
            raise DataError(f"{path} is not a prepared store: {error}") from error
        stop = max((stop for entry in entries for _, stop in entry.spans), default=0)
        if frames.shape != (stop, len(channels)) or frames.dtype != np.float32:
            raise DataError(f"{path / FRAMES} does not match {INDEX}: prepare the corpus again")
        return Store(frames, representation, channels, units, fps, skeletons, entries, skipped)


def _entry(data: dict[str, Any]) -> Entry:
    spans = tuple((int(start), int(stop)) for start, stop in data["spans"])
    said = {key: tuple(data.get(key, ())) for key in ("sentences", "unseen", "gaits")}
    return Entry(**{**data, **said, "spans": spans})


def is_store(path: Path) -> bool:
    """Whether a store is at a place, of one representation or several."""
    return (path / INDEX).is_file() or any(path.glob(f"*/{INDEX}"))


def part(path: Path, representation: str) -> Path:
    """The store in a representation at a place: the part of that name, or else the place itself."""
    return path / representation if (path / representation / INDEX).is_file() else path


def prepare(
    items: Iterable[Item],
    path: Path,
    preparation: Preparation,
    progress: Callable[[Item], object] = lambda item: None,
) -> Store:
    """Write the store of a corpus, see :func:`prepare_parts`."""
    prepare_parts(items, path, {".": preparation}, progress)
    return Store.open(path)


def prepare_parts(
    items: Iterable[Item],
    path: Path,
    parts: Mapping[str, Preparation],
    progress: Callable[[Item], object] = lambda item: None,
) -> None:
    """Write stores of a corpus into the new folder ``path``, whole or not at all, one motion in memory at a time.

    parts: the preparation of each, by its folder inside.

    The first motion that can be used sets channels and the joints' axes; others are brought to these, and one that
    lacks channels, or whose bones point elsewhere at rest, is skipped, as is any that the representation refuses.
    progress: called with each item when it is done; what some part could not use comes as Skipped.
    OutputError if there is something at ``path``, DataError if no motion can be used.
    """
    with new_folder(path) as folder, ExitStack() as files:
        writers = []
        for name, preparation in parts.items():
            (folder / name).mkdir(exist_ok=True)
            writers.append(_Writer(files.enter_context((folder / name / FRAMES).open("wb")), preparation))
        for item in items:
            added = [writer.add(item) for writer in writers]
            progress(next((one for one in added if isinstance(one, Skipped)), item))
        for name, writer in zip(parts, writers, strict=True):
            (folder / name / INDEX).write_text(json.dumps(writer.finish()), encoding="utf-8")


class _Writer:
    """Puts one item after the other into ``frames.npy``."""

    def __init__(self, file: BinaryIO, preparation: Preparation) -> None:
        self.file, self.preparation = file, preparation
        self.first: Motion | None = None
        self.skeletons: dict[Skeleton, int] = {}
        self.entries: list[Entry] = []
        self.skipped: list[Skipped] = []
        self.frames = 0

    def add(self, item: Item) -> Item:
        try:
            if isinstance(item, Record):
                self._write(item)
                return item
        except MotionError as error:
            item = Skipped(item.name, str(error))
        self.skipped.append(item)
        return item

    def _write(self, record: Record) -> None:
        pieces = self.preparation.pieces(record.motion)
        found = [list(self.preparation.sequences(piece, self.first)) for piece in pieces]
        for number, phases in enumerate(found, start=1):
            place = number == len(found), number == 1
            name = record.name if len(found) == 1 else f"{record.name}.{number}"
            self._write_piece(replace(record, name=name, take=record.take or record.name), phases, place)

    def _write_piece(self, record: Record, phases: Sequence[Motion], place: tuple[bool, bool]) -> None:
        spans = []
        for features in phases:
            if self.first is None:
                self.first = features
                self._header()
            self.file.write(features.values.astype("<f4").tobytes())
            spans.append((self.frames, self.frames + len(features)))
            self.frames += len(features)
        own = None if features.skeleton is None else self._number(features.skeleton)
        said = record.sentences, tuple(spans), own, record.unseen, record.take, *place, record.action, record.gaits
        self.entries.append(Entry(record.name, record.subject, *said))

    def _number(self, skeleton: Skeleton) -> int:
        if skeleton.metres_per_unit is not None:
            skeleton = skeleton.scaled(1.0)
        return self.skeletons.setdefault(skeleton, len(self.skeletons))

    def _header(self) -> None:
        """The header of an NPY file, at the place where the file is: as long whatever the number of frames is."""
        assert self.first is not None
        shape = (self.frames, len(self.first.channels))
        header = {"descr": "<f4", "fortran_order": False, "shape": shape}
        np.lib.format.write_array_header_1_0(self.file, header)

    def finish(self) -> dict[str, Any]:
        """Write the header, now that the number of frames is known; the content of ``store.json``."""
        if self.first is None:
            reasons = "; ".join(f"{item.name}: {item.reason}" for item in self.skipped[:3])
            other = "; what is no human figure is prepared with --figure own" if self.preparation.humanoid else ""
            raise DataError(f"no motion can be used, {len(self.skipped)} were skipped: {reasons}{other}")
        self.file.seek(0)
        self._header()
        return {
            "representation": self.preparation.representation,
            "channels": self.first.channels,
            "units": self.first.units,
            "fps": self.first.fps,
            "skeletons": [skeleton.to_json() for skeleton in self.skeletons],
            "records": [asdict(entry) for entry in self.entries],
            "skipped": [asdict(item) for item in self.skipped],
        }
