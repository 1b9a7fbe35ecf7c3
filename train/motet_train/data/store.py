"""The store: a corpus prepared once, its frames in one memory-mapped array, and its division for training.

A store is a folder with ``frames.npy``, (N, D) float32 in the contract's channels, and ``store.json``, the index: the
channels, the span of each record's sequences, and the skipped motions. Or it is a folder of such folders, one for each
of several representations, by their names.
"""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import MotetError, MotionError
from motet.figures.trimming import repeated
from motet.files import new_folder
from motet.jobs import Shard
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract, living, sequences
from motet_train.data.corpus import Record, Skipped
from motet_train.data.errors import DataError
from motet_train.data.preparation import Preparation

Item = Record | Skipped

FRAMES_FILE = "frames.npy"
INDEX = "store.json"


@dataclass(frozen=True)
class Entry:
    """A record of the store: a motion or a piece of it.

    spans: of frames (start, stop), one for each down-sampling offset. skeleton: the index of its figure among the
    store's. take: shared by records that must not be divided between training and test, such as the pieces of a motion.
    ends, starts: whether it is the last and the first piece of its motion. Other fields: see
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
        """The action shown, as named by the corpus, or else the name of the take or of the record."""
        return self.action or self.take or self.name


@dataclass(frozen=True, eq=False)
class Store:
    """A prepared corpus.

    frames: all frames (N, D) float32, memory-mapped, read-only. skeletons: the different figures, in metres where their
    unit is known; each record has the index of its own.
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
        """The first record's figure, on which generated motions are shown; None for joint angles alone."""
        return self.skeletons[0] if self.skeletons else None

    def needs_sixd(self, use: str) -> None:
        """DataError if the store is not in ``root_sixd``. use: that of the store, such as "a codec is trained on"."""
        if self.representation != "root_sixd":
            raise DataError(f"{use} root_sixd (motet prepare --for codes), not {self.representation}")

    def names(self, records: Iterable[int]) -> list[str]:
        """The names of some records."""
        return [self.records[record].name for record in records]

    def sequence(self, record: int, offset: int = 0) -> Floats:
        """The frames (T, D) float32 of one record at one down-sampling offset: a view."""
        start, stop = self.records[record].spans[offset]
        return self.frames[start:stop]

    def values(self, start: int, stop: int) -> Array:
        """Some of the frames (T, D) in float64: a copy."""
        return np.array(self.frames[start:stop], np.float64)

    def motion(self, record: int, offset: int = 0) -> Motion:
        """The features of one record at one down-sampling offset, with its own figure."""
        index = self.records[record].skeleton
        skeleton = None if index is None else self.skeletons[index]
        values = self.sequence(record, offset).astype(np.float64)
        return Motion(values, self.channels, self.units, self.fps, skeleton)

    def contract(self, indices: Sequence[int]) -> MotionContract:
        """The motion contract with mean and standard deviation over the records ``indices`` only, 0 where dead."""
        sequences = []
        for index in indices:
            sequences += [self.frames[start:stop] for start, stop in self.records[index].spans]
        count = sum(map(len, sequences))
        if not count:
            raise DataError("mean and standard deviation need at least one record")
        # in two passes, one sequence in memory at a time
        zero = np.zeros(len(self.channels))
        mean = sum((frames.sum(axis=0, dtype=np.float64) for frames in sequences), zero) / count
        squares = sum((((frames - mean) ** 2).sum(axis=0) for frames in sequences), zero)
        std = living(np.sqrt(squares / count), self.units)
        return MotionContract(self.representation, self.channels, self.units, self.fps, mean, std, self.skeleton)

    @staticmethod
    def open(path: Path) -> "Store":
        """Open a store that :func:`prepare_parts` wrote; DataError if it is incomplete."""
        try:
            index = json.loads((path / INDEX).read_text(encoding="utf-8"))
            frames = np.load(path / FRAMES_FILE, mmap_mode="r")
            store = Store(
                frames,
                str(index["representation"]),
                tuple(index["channels"]),
                tuple(index["units"]),
                float(index["fps"]),
                tuple(map(Skeleton.from_json, index["skeletons"])),
                tuple(map(_entry, index["records"])),
                tuple(Skipped(**item) for item in index["skipped"]),
            )
        except (OSError, KeyError, TypeError, ValueError, RecursionError, MotetError) as error:
            raise DataError(f"{path} is not a prepared store: {error}") from error
        # the last span ends where the frames end
        stops = [0]
        for entry in store.records:
            stops += [stop for _, stop in entry.spans]
        if frames.shape != (max(stops), len(store.channels)) or frames.dtype != np.float32:
            raise DataError(f"{path / FRAMES_FILE} does not match {INDEX}: prepare the corpus again")
        return store


def _entry(data: dict[str, Any]) -> Entry:
    """An entry from JSON, whose lists become tuples."""
    spans = tuple((int(start), int(stop)) for start, stop in data["spans"])
    texts = {key: tuple(data.get(key, ())) for key in ("sentences", "unseen", "gaits")}
    return Entry(**{**data, **texts, "spans": spans})


def is_store(path: Path) -> bool:
    """Whether there is a store at a path, of one representation or several."""
    return (path / INDEX).is_file() or any(path.glob(f"*/{INDEX}"))


def part(path: Path, representation: str) -> Path:
    """The path of the store in a representation: the part of that name if there is one, else the path itself."""
    return path / representation if (path / representation / INDEX).is_file() else path


def prepare_parts(
    items: Iterable[Item],
    path: Path,
    parts: Mapping[str, Preparation],
    progress: Callable[[Item], object] = lambda item: None,
    shard: Shard | None = None,
) -> None:
    """Write stores of a corpus into the new folder ``path``, whole or not at all, one motion in memory at a time.

    parts: the preparation of each, by its folder inside ``path``. progress: called with each item when it is done, as
    Skipped if some part could not use it. shard: the shard of the corpus that the items are, noted in the index for
    :func:`motet_train.data.merging.merge_stores`.

    The first usable motion determines the channels and the joints' axes, to which the others are converted. A motion
    that lacks channels, has bones that point elsewhere at rest, or is refused by the representation, is skipped.
    OutputError if ``path`` exists, DataError if no motion can be used.
    """
    with new_folder(path) as folder, ExitStack() as files:
        # a writer for each representation
        writers = []
        for name, preparation in parts.items():
            (folder / name).mkdir(exist_ok=True)
            writers.append(_Preparing(files.enter_context((folder / name / FRAMES_FILE).open("wb")), preparation))
        # each item is read once, and goes to all of them
        for item in items:
            results = [writer.add(item) for writer in writers]
            progress(next((result for result in results if isinstance(result, Skipped)), item))
        for name, writer in zip(parts, writers, strict=True):
            index = writer.finish()
            if shard is not None:
                index["shard"] = str(shard)
            (folder / name / INDEX).write_text(json.dumps(index), encoding="utf-8")


class StoreWriter:
    """Writes ``frames.npy``, one sequence after the other, and collects the content of ``store.json``."""

    def __init__(self, file: BinaryIO, representation: str) -> None:
        self.file = file
        self.representation = representation
        self.first: Motion | None = None
        self.skeletons: dict[Skeleton, int] = {}
        self.entries: list[Entry] = []
        self.skipped: list[Skipped] = []
        self.frames = 0

    def put(self, features: Motion) -> tuple[int, int]:
        """Write a sequence and return its span of frames."""
        if self.first is None:
            self.first = features
            self._header()
        self.file.write(features.values.astype("<f4").tobytes())
        self.frames += len(features)
        return self.frames - len(features), self.frames

    def skeleton(self, skeleton: Skeleton) -> int:
        """The index of a figure, which is added if it is new."""
        return self.skeletons.setdefault(skeleton, len(self.skeletons))

    def _header(self) -> None:
        """Write the header of an NPY file; its length does not depend on the number of frames."""
        assert self.first is not None
        header = {"descr": "<f4", "fortran_order": False, "shape": (self.frames, len(self.first.channels))}
        np.lib.format.write_array_header_1_0(self.file, header)

    def finish(self) -> dict[str, Any]:
        """Write the header, now that the number of frames is known, and return the content of ``store.json``."""
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
    """Prepares and writes one item after the other."""

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
        preparation = self.preparation
        pieces: list[list[Motion]] = []
        for piece in preparation.pieces(record.motion):
            # one sequence for each down-sampling offset
            features = sequences(preparation.representation, piece, preparation.fps, self.first)
            pieces.append([repeated(phase) if record.loops else phase for phase in features])
        for number, phases in enumerate(pieces, start=1):
            entry = Entry(
                record.name if len(pieces) == 1 else f"{record.name}.{number}",
                record.subject,
                record.sentences,
                spans=tuple(map(self.put, phases)),
                skeleton=self._figure(phases[-1].skeleton),
                unseen=record.unseen,
                take=record.take or record.name,
                ends=number == len(pieces),
                starts=number == 1,
                action=record.action,
                gaits=record.gaits,
            )
            self.entries.append(entry)

    def _figure(self, skeleton: Skeleton | None) -> int | None:
        """The index of a figure, in metres if its unit is known."""
        if skeleton is None:
            return None
        return self.skeleton(skeleton if skeleton.metres_per_unit is None else skeleton.scaled(1.0))

    def finish(self) -> dict[str, Any]:
        """As in any writer, with a hint for figures that are not human."""
        try:
            return super().finish()
        except DataError as error:
            hint = "; figures that are not human need --figure own" if self.preparation.humanoid else ""
            raise DataError(f"{error}{hint}") from error


KEYED = "KEYED"
"""Who shows the clips that nobody performed, acts by key poses: the beginning of their names, up to "_"."""

SPLITS = ("trial", "subject", "none")
"""The ways to divide motions, see :func:`split`."""


@dataclass(frozen=True)
class Split:
    """Indices into the entries of a store, sorted."""

    train: tuple[int, ...]
    validation: tuple[int, ...]
    test: tuple[int, ...]


def split(entries: Sequence[Entry], seed: int, by: str = "trial") -> Split:
    """Divide motions .8/.1/.1 at random (Plappert et al. 2017, section 5.1); a seed always gives the same parts.

    by: "trial" keeps the pieces of a take together. "subject" keeps all motions of a person together, so that
    validation and test show people never seen in training; these parts then have at most .1 each. "none" trains on
    everything, including the validation and test motions of "trial". Patterns with a "*", such as "ACCAD_*,CC0_*",
    select the clips of the test part; the rest is divided by subject. DataError if a part would be empty.
    """
    if "*" in by:
        return _without(entries, seed, by)
    if by not in SPLITS:
        raise DataError(f"motions are split by trial, by subject, by none or by a pattern with a *, not by {by!r}")
    if by == "none":
        return replace(split(entries, seed), train=tuple(range(len(entries))))
    # groups stay together
    groups = _groups(entries, by)
    wanted = max(1, round(0.1 * len(entries)))
    parts = _divided(groups, wanted, np.random.default_rng(seed))
    if not all(parts):
        hint = " (who moved: the column subject of the table, or else the name up to its first _)"
        raise DataError(
            f"{len(entries)} motions of {len(groups)} {by}s are too few for training, validation and test"
            + (hint if by == "subject" else "")
        )
    train, validation, test = (tuple(sorted(part)) for part in parts)
    return Split(train, validation, test)


def _groups(entries: Sequence[Entry], by: str) -> dict[str, list[int]]:
    """The motions of each person or take."""
    groups: dict[str, list[int]] = {}
    for index, entry in enumerate(entries):
        key = entry.subject if by == "subject" else entry.take or entry.name
        groups.setdefault(key, []).append(index)
    return groups


def _divided(groups: Mapping[str, list[int]], wanted: int, rng: np.random.Generator) -> list[list[int]]:
    """Training, validation and test part of groups of motions that stay together.

    Groups come in random order; each goes into the smaller one of validation and test that has room for it, of
    ``wanted`` motions, or else into training.
    """
    train: list[int] = []
    validation: list[int] = []
    test: list[int] = []
    for key in rng.permutation(sorted(groups)).tolist():
        group = groups[key]
        held_out = (test, validation) if len(validation) >= len(test) else (validation, test)
        part = next((part for part in held_out if len(part) + len(group) <= wanted), train)
        part.extend(group)
    return [train, validation, test]


def matches(name: str, patterns: str) -> bool:
    """Whether the name of a clip matches one of several patterns, separated by commas."""
    return any(fnmatchcase(name, pattern) for pattern in patterns.split(","))


def _without(entries: Sequence[Entry], seed: int, patterns: str) -> Split:
    """The split whose test part are the clips that match; validation are other people, and training is the rest, with
    what nobody performed."""
    test = [index for index, entry in enumerate(entries) if matches(entry.name, patterns)]
    rest = [index for index, entry in enumerate(entries) if not matches(entry.name, patterns)]
    if not test or not rest:
        raise DataError(f"{len(test)} of {len(entries)} motions match {patterns}: some must, and some must not")
    # the rest by people, all but validation to train on; clips by rule change nothing of who these are
    performed = [index for index in rest if entries[index].subject.partition("_")[0] != KEYED]
    parts = split([entries[index] for index in performed], seed, "subject")
    validation = [performed[place] for place in parts.validation]
    train = sorted(set(rest).difference(validation))
    return Split(tuple(train), tuple(validation), tuple(test))
