"""The store: a corpus prepared once, its frames in one memory-mapped array, and divided for training.

A folder with ``frames.npy``, (N, D) float32 in the contract's channels, and ``store.json``, which says what they are,
where each record's sequences lie, and what was skipped. Or a folder with such a store for each of several
representations, by their names.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from motet.errors import MotetError, MotionError
from motet.files import new_folder
from motet.jobs import Shard
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract, living, sequences
from motet_train.data.corpus import Record, Skipped
from motet_train.data.errors import DataError
from motet_train.data.preparation import Preparation, repeated

Floats = NDArray[np.float32]
Item = Record | Skipped

FRAMES, INDEX = "frames.npy", "store.json"


@dataclass(frozen=True)
class Entry:
    """A record of the store: a motion or a piece of it, for each down-sampling offset the span (start, stop) of frames.

    skeleton: the index of its figure among the store's. take: what must not be divided, shared by the pieces of a
    motion. ends, starts: whether the motion ends and begins with it. Other fields: see
    :class:`motet_train.data.corpus.Record`.
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

    @property
    def shows(self) -> str:
        """The action shown, by the name that its corpus gives, or else by the record's own."""
        return self.action or self.take or self.name


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
        except (OSError, KeyError, TypeError, ValueError, RecursionError, MotetError) as error:
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
    shard: Shard | None = None,
) -> None:
    """Write stores of a corpus into the new folder ``path``, whole or not at all, one motion in memory at a time.

    parts: the preparation of each, by its folder inside. progress: called with each item when it is done; what some
    part could not use comes as Skipped. shard: which of the corpus the items are; the index says so for
    :func:`motet_train.data.merging.merge_stores`.

    The first usable motion sets channels and the joints' axes; others are converted to these, and one that lacks
    channels, or whose bones point elsewhere at rest, is skipped, as is any that the representation refuses.
    OutputError if there is something at ``path``, DataError if no motion can be used.
    """
    with new_folder(path) as folder, ExitStack() as files:
        writers = []
        for name, preparation in parts.items():
            (folder / name).mkdir(exist_ok=True)
            writers.append(_Preparing(files.enter_context((folder / name / FRAMES).open("wb")), preparation))
        for item in items:
            added = [writer.add(item) for writer in writers]
            progress(next((one for one in added if isinstance(one, Skipped)), item))
        for name, writer in zip(parts, writers, strict=True):
            index = writer.finish() | ({} if shard is None else {"shard": str(shard)})
            (folder / name / INDEX).write_text(json.dumps(index), encoding="utf-8")


class StoreWriter:
    """Writes ``frames.npy``, one sequence after the other, and gathers what ``store.json`` says."""

    def __init__(self, file: BinaryIO, representation: str) -> None:
        self.file, self.representation = file, representation
        self.first: Motion | None = None
        self.skeletons: dict[Skeleton, int] = {}
        self.entries: list[Entry] = []
        self.skipped: list[Skipped] = []
        self.frames = 0

    def put(self, features: Motion) -> tuple[int, int]:
        """Write a sequence; its span of frames."""
        if self.first is None:
            self.first = features
            self._header()
        self.file.write(features.values.astype("<f4").tobytes())
        self.frames += len(features)
        return self.frames - len(features), self.frames

    def skeleton(self, skeleton: Skeleton) -> int:
        """The number of a figure."""
        return self.skeletons.setdefault(skeleton, len(self.skeletons))

    def _header(self) -> None:
        """Write the header of an NPY file, whose length does not depend on the number of frames."""
        assert self.first is not None
        header = {"descr": "<f4", "fortran_order": False, "shape": (self.frames, len(self.first.channels))}
        np.lib.format.write_array_header_1_0(self.file, header)

    def finish(self) -> dict[str, Any]:
        """Write the header, now that the number of frames is known; the content of ``store.json``."""
        if self.first is None:
            reasons = "; ".join(f"{item.name}: {item.reason}" for item in self.skipped[:3])
            raise DataError(f"no motion can be used, {len(self.skipped)} were skipped: {reasons}")
        self.file.seek(0)
        self._header()
        return {
            "representation": self.representation,
            "channels": self.first.channels,
            "units": self.first.units,
            "fps": self.first.fps,
            "skeletons": [skeleton.to_json() for skeleton in self.skeletons],
            "records": [asdict(entry) for entry in self.entries],
            "skipped": [asdict(item) for item in self.skipped],
        }


class _Preparing(StoreWriter):
    """Prepares one item after the other."""

    def __init__(self, file: BinaryIO, preparation: Preparation) -> None:
        super().__init__(file, preparation.representation)
        self.preparation = preparation

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
        how = self.preparation
        pieces = how.pieces(record.motion)
        found = [list(sequences(how.representation, piece, how.fps, self.first)) for piece in pieces]
        if record.loops:
            found = [list(map(repeated, phases)) for phases in found]
        for number, phases in enumerate(found, start=1):
            spans = tuple(map(self.put, phases))
            own, skeleton = None, phases[-1].skeleton
            if skeleton is not None:
                own = self.skeleton(skeleton if skeleton.metres_per_unit is None else skeleton.scaled(1.0))
            name = record.name if len(found) == 1 else f"{record.name}.{number}"
            place = record.take or record.name, number == len(found), number == 1
            said = record.sentences, spans, own, record.unseen, *place, record.action, record.gaits
            self.entries.append(Entry(name, record.subject, *said))

    def finish(self) -> dict[str, Any]:
        """As of any writer, with a hint where no figure is human."""
        try:
            return super().finish()
        except DataError as error:
            hint = "; figures that are not human need --figure own" if self.preparation.humanoid else ""
            raise DataError(f"{error}{hint}") from error


SPLITS = ("trial", "subject", "none")
"""How motions are divided, see :func:`split`."""


@dataclass(frozen=True)
class Split:
    """Indices into the entries of a store, sorted."""

    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]


def split(entries: Sequence[Entry], seed: int, by: str = "trial") -> Split:
    """Divide motions .8/.1/.1 by chance (Plappert et al. 2017, section 5.1), the same for the same seed.

    by: "trial", which keeps the pieces of a take together, or "subject" to keep all motions of a person together, so
    that validation and test show people never seen in training; these parts then have at most .1 each. "none" trains on
    everything, the validation and test motions of "trial" as well. Patterns with a "*", such as "ACCAD_*,CC0_*", name
    the clips of the test part; of the others people are for validation. DataError where a part would be empty.
    """
    if "*" in by:
        return _without(entries, seed, by)
    if by not in SPLITS:
        raise DataError(f"motions are split by trial, by subject, by none or by a pattern with a *, not by {by!r}")
    if by == "none":
        return replace(split(entries, seed), train=tuple(range(len(entries))))
    groups: dict[str, list[int]] = {}
    for index, entry in enumerate(entries):
        groups.setdefault(entry.subject if by == "subject" else entry.take or entry.name, []).append(index)
    wanted = max(1, round(0.1 * len(entries)))
    parts: list[list[int]] = [[], [], []]
    for key in np.random.default_rng(seed).permutation(sorted(groups)).tolist():
        room = [2, 1, 0] if len(parts[1]) >= len(parts[2]) else [1, 2, 0]
        fits = (part for part in room if part == 0 or len(parts[part]) + len(groups[key]) <= wanted)
        parts[next(fits)].extend(groups[key])
    if not all(parts):
        who = " (who moved: the column subject of the table, or else the name up to its first _)"
        raise DataError(
            f"{len(entries)} motions of {len(groups)} {by}s are too few for training, validation and test"
            + who * (by == "subject")
        )
    return Split(*(tuple(sorted(part)) for part in parts))


def matches(name: str, patterns: str) -> bool:
    """Whether a clip's name matches one of several patterns, separated by commas."""
    return any(fnmatchcase(name, one) for one in patterns.split(","))


def _without(entries: Sequence[Entry], seed: int, pattern: str) -> Split:
    """What matches a pattern is the test part; of the rest the test part is for training, too."""
    test = tuple(i for i, entry in enumerate(entries) if matches(entry.name, pattern))
    rest = [index for index in range(len(entries)) if index not in set(test)]
    if not test or not rest:
        raise DataError(f"{len(test)} of {len(entries)} motions match {pattern}: some must, and some must not")
    parts = split([entries[index] for index in rest], seed, "subject")
    train = sorted(rest[place] for place in (*parts.train, *parts.test))
    return Split(tuple(train), tuple(rest[place] for place in parts.validation), test)
