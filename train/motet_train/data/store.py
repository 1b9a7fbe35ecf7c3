"""The store: a corpus prepared once, its frames in one memory-mapped array.

A folder with ``frames.npy``, (N, D) float32 in the contract's channels, and ``store.json``, which says what they
are, where each record's sequences lie, and what was skipped.
"""

import json
import shutil
import uuid
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotetError, MotionError, OutputError
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract
from motet_train.data.errors import DataError
from motet_train.data.records import Record, Skipped
from motet_train.data.representation import Representation

Floats = NDArray[np.float32]
Item = Record | Skipped

FRAMES, INDEX = "frames.npy", "store.json"
CONSTANT = 1e-4
"""In any unit: a channel with a smaller standard deviation is constant."""

HEADER = 128
"""Bytes before the numbers in ``frames.npy``: fixed, so that it can be written when the number of frames is known."""


@dataclass(frozen=True)
class Entry:
    """A record of the store: for each down-sampling offset the span (start, stop) of its frames."""

    name: str
    subject: str
    sentences: tuple[str, ...]
    spans: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Store:
    """A prepared corpus. frames: all frames (N, D) float32, memory-mapped, read-only."""

    frames: Floats
    channels: tuple[str, ...]
    units: tuple[str, ...]
    fps: float
    skeleton: Skeleton | None
    records: tuple[Entry, ...]
    skipped: tuple[Skipped, ...]

    def sequence(self, record: int, offset: int = 0) -> Floats:
        """The frames (T, D) float32 of one record at one down-sampling offset: a view."""
        start, stop = self.records[record].spans[offset]
        return self.frames[start:stop]

    def contract(self, indices: Sequence[int]) -> MotionContract:
        """The motion contract with mean and standard deviation over the records ``indices`` only, 1 where constant."""
        parts = [self.frames[slice(*span)] for index in indices for span in self.records[index].spans]
        count = sum(map(len, parts))
        if not count:
            raise DataError("mean and standard deviation need at least one record")
        mean = sum((part.sum(axis=0, dtype=np.float64) for part in parts), np.zeros(len(self.channels))) / count
        squares = sum((((part - mean) ** 2).sum(axis=0) for part in parts), np.zeros(len(self.channels)))
        std = np.sqrt(squares / count)
        std[std < CONSTANT] = 1.0
        return MotionContract(self.channels, self.units, self.fps, mean, std, self.skeleton)

    @staticmethod
    def open(path: Path) -> "Store":
        """Open what :func:`prepare` wrote; DataError where it is no whole store."""
        try:
            data = json.loads((path / INDEX).read_text(encoding="utf-8"))
            frames = np.load(path / FRAMES, mmap_mode="r")
            skeleton = None if data["skeleton"] is None else Skeleton.from_json(data["skeleton"])
            entries = tuple(_entry(entry) for entry in data["records"])
            skipped = tuple(Skipped(**item) for item in data["skipped"])
            channels, units, fps = tuple(data["channels"]), tuple(data["units"]), float(data["fps"])
        except (OSError, KeyError, TypeError, ValueError, MotetError) as error:
            raise DataError(f"{path} is no store of a prepared corpus: {error}") from error
        stop = max((stop for entry in entries for _, stop in entry.spans), default=0)
        if frames.shape != (stop, len(channels)) or frames.dtype != np.float32:
            raise DataError(f"{path / FRAMES} does not go with {INDEX}: prepare the corpus again")
        return Store(frames, channels, units, fps, skeleton, entries, skipped)


def _entry(data: dict[str, Any]) -> Entry:
    spans = tuple((int(start), int(stop)) for start, stop in data["spans"])
    return Entry(str(data["name"]), str(data["subject"]), tuple(data["sentences"]), spans)


def prepare(
    items: Iterable[Item],
    path: Path,
    representation: Representation,
    progress: Callable[[Item], object] = lambda item: None,
) -> Store:
    """Write the store of a corpus into the new folder ``path``, whole or not at all, one motion in memory at a time.

    The first motion that can be used sets channels and skeleton; others have their channels put into its order, and
    one with other channels or differently oriented joints is skipped, as is any that the representation refuses.
    progress: called with each item when it is done; what could not be used comes as Skipped.
    OutputError if there is something at ``path``, DataError if no motion can be used.
    """
    if path.exists() or not path.absolute().parent.is_dir():
        raise OutputError(f"cannot write the store {path}: it exists, or the folder around it does not")
    partial = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    partial.mkdir()
    try:
        with (partial / FRAMES).open("wb") as file:
            writer = _Writer(file, representation)
            for item in items:
                progress(writer.add(item))
            index = writer.finish()
        (partial / INDEX).write_text(json.dumps(index), encoding="utf-8")
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        raise
    return Store.open(path)


class _Writer:
    """Puts one item after the other into ``frames.npy``."""

    def __init__(self, file: BinaryIO, representation: Representation) -> None:
        self.file, self.representation = file, representation
        self.first: tuple[str, Motion] | None = None
        self.entries: list[Entry] = []
        self.skipped: list[Skipped] = []
        self.frames = 0
        file.write(bytes(HEADER))

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
        sequences = self.representation.sequences(record.motion)
        if self.first is None:
            self.first = record.name, sequences[0]
        sequences = [_fitting(sequence, *self.first) for sequence in sequences]
        spans = []
        for sequence in sequences:
            self.file.write(sequence.values.astype("<f4").tobytes())
            spans.append((self.frames, self.frames + len(sequence)))
            self.frames += len(sequence)
        self.entries.append(Entry(record.name, record.subject, record.sentences, tuple(spans)))

    def finish(self) -> dict[str, Any]:
        """Write the header; the content of ``store.json``."""
        if self.first is None:
            reasons = "; ".join(f"{item.name}: {item.reason}" for item in self.skipped[:3])
            raise DataError(f"no motion can be used, {len(self.skipped)} were skipped: {reasons}")
        first = self.first[1]
        self.file.seek(0)
        self.file.write(_header(self.frames, len(first.channels)))
        skeleton = first.skeleton
        if skeleton is not None and skeleton.metres_per_unit is not None:
            skeleton = skeleton.scaled(1.0)
        return {
            "channels": first.channels,
            "units": first.units,
            "fps": first.fps,
            "skeleton": None if skeleton is None else skeleton.to_json(),
            "records": [asdict(entry) for entry in self.entries],
            "skipped": [asdict(item) for item in self.skipped],
        }


def _fitting(motion: Motion, name: str, first: Motion) -> Motion:
    """The motion with the channels of the first one in its order; MotionError if their skeletons do not go together."""
    different = sorted(set(motion.channels) ^ set(first.channels))
    if different:
        raise MotionError(f"it has another skeleton than {name}: only one of them has {', '.join(different)}")
    if motion.skeleton is not None and first.skeleton is not None:
        frames = {joint.name: joint for joint in first.skeleton.joints}
        moving = {channel.rpartition(".")[0] for channel in motion.channels}
        for joint in motion.skeleton.joints:
            other = frames.get(joint.name, joint)
            alike = joint.order == other.order and np.allclose(joint.frame, other.frame, rtol=0, atol=1e-3)
            if joint.name in moving and not alike:
                raise MotionError(f"it has another skeleton than {name}: joint {joint.name!r} turns about other axes")
    return motion.select(first.channels, first.units)


def _header(frames: int, channels: int) -> bytes:
    """The header of an NPY file, version 1.0, padded to HEADER bytes."""
    text = repr({"descr": "<f4", "fortran_order": False, "shape": (frames, channels)})
    return b"\x93NUMPY\x01\x00" + (HEADER - 10).to_bytes(2, "little") + text.ljust(HEADER - 11).encode() + b"\n"
