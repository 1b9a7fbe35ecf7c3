"""Corpora: motions with sentences, from the KIT Motion-Language data or from mocap files beside a table."""

import json
from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from motet.figures.feet.treadmill import with_travel
from motet.formats import CLIPPED, MOCAP, clips, mmm, read_motion
from motet.formats.text import MARK
from motet.jobs import Shard
from motet.motion.motion import Motion
from motet_train.data.archive import BROKEN, Archive
from motet_train.data.errors import DataError
from motet_train.data.table import Described, Gait, Person, person, read_table

KIT_MOTION = "_mmm.xml"
"""Suffix of KIT's files of motion."""

KIT_SENTENCES = "_annotations.json"
"""Suffix of KIT's files of sentences."""

NO_MOTION = "no motion file of this name"
"""The reason for which a clip of the table is skipped if there is no file of it."""


@dataclass(frozen=True, eq=False)
class Record:
    """One motion with its sentences.

    subject: the performer, "" if unknown. unseen: sentences reserved for measuring, never for training. take: shared by
    motions that must not be divided between training and test; "" if the motion is a take of its own. action: the
    action shown, named the same in all motions that show it; "" if unknown. gaits: the gaits that it shows. loops:
    whether it is one period of a loop.
    """

    name: str
    subject: str
    motion: Motion
    sentences: tuple[str, ...]
    unseen: tuple[str, ...] = ()
    take: str = ""
    action: str = ""
    gaits: tuple[str, ...] = ()
    loops: bool = False


@dataclass(frozen=True)
class Skipped:
    """A motion of the corpus that cannot be used, and the reason."""

    name: str
    reason: str


@dataclass(frozen=True)
class Corpus:
    """A corpus on disk; iterating reads it anew, one motion at a time.

    paths: its folders and zips; later ones replace files of earlier ones. names: the motion files. kit: whether it is
    KIT's. table: of sentences, None for motions alone. people: the performers of clips. unit: see :func:`motet.read`.
    gaits: patterns of motions that show them, in addition to the gaits in the table.
    """

    paths: tuple[Path, ...]
    names: tuple[str, ...]
    kit: bool = False
    table: Path | None = None
    people: tuple[Person, ...] = ()
    unit: str | float | None = None
    gaits: tuple[Gait, ...] = ()

    def __len__(self) -> int:
        """The number of motion files; each gives a Record or Skipped, or one for each of its clips."""
        return len(self.names)

    def shard(self, shard: Shard) -> "Corpus":
        """One of ``shard.count`` nearly equal runs of files; DataError if it is empty."""
        start = len(self) * (shard.number - 1) // shard.count
        stop = len(self) * shard.number // shard.count
        if start == stop:
            raise DataError(f"{len(self)} motion files are too few for {shard.count} shards")
        return replace(self, names=self.names[start:stop])

    def __iter__(self) -> Iterator[Record | Skipped]:
        with Archive(*self.paths) as archive:
            if self.kit:
                items = kit_recordings(archive, self.names)
            else:
                table = None if self.table is None else read_table(self.table)
                items = recordings(archive, self.unit, table, self.people, self.names)
            for item in items:
                yield self._with_gaits(item) if isinstance(item, Record) else item

    def _with_gaits(self, record: Record) -> Record:
        """The record with the gaits whose patterns it matches."""
        action = record.action or record.take or record.name
        names = [*record.gaits]
        names += [gait.name for gait in self.gaits if gait.shown(action, record.subject)]
        return replace(record, gaits=tuple(dict.fromkeys(names)))


def read_corpus(
    paths: Path | Sequence[Path],
    table: Path | None = None,
    people: tuple[Person, ...] = (),
    unit: str | float | None = None,
    described: bool = True,
    gaits: tuple[Gait, ...] = (),
) -> Corpus:
    """The corpus at ``paths``, folders and zips; DataError if there is none.

    With files ``*_annotations.json`` it is KIT's. Otherwise it has motion files of the types .amc (with .asf) .bvh .npz
    .glb .vrma and a table of sentences: ``table``, or the only .tsv in the first folder, or the only one beside it.
    unit: the length unit of mocap files that do not state theirs, as in :func:`motet.read`. described: whether its
    motions need sentences; if not, a table is used only if it is named. people, gaits: see :class:`Corpus`.
    """
    places = (paths,) if isinstance(paths, Path) else tuple(paths)
    with Archive(*places) as archive:
        names = archive.names
        motions = motion_files(archive)
    # KIT's data by the names of its files, else motion files with a table
    if any(name.endswith(KIT_SENTENCES) for name in names):
        kit_motions = tuple(name for name in names if name.endswith(KIT_MOTION))
        return Corpus(places, kit_motions, kit=True, gaits=gaits)
    if not motions:
        raise DataError(
            f"no motion files ({' '.join(MOCAP)}) in {', '.join(map(str, places))}, nor KIT's NNNNN{KIT_SENTENCES}"
        )
    if table is None and described:
        table = _only_table(places[0])
    return Corpus(places, motions, False, table, people, unit, gaits)


def _only_table(path: Path) -> Path:
    """The only table in a folder, or else beside it or a zip; DataError if there is none or several."""
    inside = sorted(path.glob("*.tsv")) if path.is_dir() else []
    tables = inside or sorted(path.absolute().parent.glob("*.tsv"))
    if len(tables) != 1:
        raise DataError(
            f"{path} needs one table of sentences (.tsv) in it or beside it, with the columns clip and sentence; "
            f"found: {', '.join(map(str, tables)) or 'none'}"
        )
    return tables[0]


def motion_files(archive: Archive) -> tuple[str, ...]:
    """The motion files of an archive, sorted by name."""
    return tuple(name for name in archive.names if PurePosixPath(name).suffix.lower() in MOCAP)


def recordings(
    archive: Archive,
    unit: str | float | None = None,
    table: Mapping[str, Described] | None = None,
    people: tuple[Person, ...] = (),
    files: Sequence[str] | None = None,
) -> Iterator[Record | Skipped]:
    """The motions of an archive's files; Skipped for a file that cannot be read or used.

    A file of several motions gives each of them, named by the file and its own name: "people#Walk".
    unit: the length unit of files that do not state theirs, as in :func:`motet.read`. table: the description of each
    clip; motions and clips that only one side has are skipped. Without a table, all motions are given, without
    sentences. people: the performers of clips, unless the table names them. files: by default all.
    """
    for name in archive.names:
        if name.lower().endswith(".asf"):
            archive.place(name)  # the reader of an AMC file looks for its skeleton near it
    seen: set[str] = set()
    for file, motion_name in _motions(archive, motion_files(archive) if files is None else files):
        clip = _clip_name(file, motion_name, table or {})
        # a file is left out that has no sentence, or whose name has been read
        described = Described() if table is None else table.get(clip)
        if described is None:
            yield Skipped(clip, "no sentence")
        elif clip in seen:
            yield Skipped(clip, f"a second motion of this name: {file}")
        else:
            try:
                with archive.opened(file) as place:
                    motion = read_motion(place, unit=unit, clip=motion_name)
                item: Record | Skipped = _record(clip, motion, described, person(people, clip))
            except BROKEN as error:
                item = Skipped(clip, archive.reason(error))
            yield item
        seen.add(clip)
    # sentences without a motion
    for clip in table or ():
        if clip not in seen:
            yield Skipped(clip, NO_MOTION)


def _clip_name(file: str, motion_name: str | None, table: Container[str]) -> str:
    """The name of a motion: with its folders if the table has that, else without."""
    path = PurePosixPath(file)
    suffix = "" if motion_name is None else f"{MARK}{motion_name}"
    whole = path.with_suffix("").as_posix() + suffix
    return whole if whole in table else path.stem + suffix


def _record(clip: str, motion: Motion, described: Described, performer: Person) -> Record:
    return Record(
        clip,
        described.subject or performer.subject,
        with_travel(motion) if described.in_place else motion,
        tuple(described.sentences),
        tuple(described.unseen),
        performer.take,
        described.action,
        described.gaits,
        described.loops,
    )


def _motions(archive: Archive, files: Sequence[str]) -> Iterator[tuple[str, str | None]]:
    """Motion files with None, or, for a file of several motions, with the name of each."""
    for file in files:
        names: tuple[str, ...] = ()
        if PurePosixPath(file).suffix.lower() in CLIPPED:
            with suppress(*BROKEN), archive.opened(file) as place:  # reading the motion reports what is wrong
                names = clips(place)
        if len(names) > 1:
            for name in names:
                yield file, name
        else:
            yield file, None


def kit_recordings(archive: Archive, files: Sequence[str]) -> Iterator[Record | Skipped]:
    """The motions NNNNN_mmm.xml with their sentences in NNNNN_annotations.json.

    Skipped where there are no sentences or a file is damaged. files: the NNNNN_mmm.xml.
    """
    names = frozenset(archive.names)
    for name in files:
        stem = name.removesuffix(KIT_MOTION)
        item: Record | Skipped = Skipped(stem, "no sentence")
        try:
            sentences = _kit_sentences(archive, stem + KIT_SENTENCES) if stem + KIT_SENTENCES in names else ()
            if sentences:
                with archive.opened(name) as place:
                    subject = mmm.motion_name(place) or stem
                    item = Record(stem.rpartition("/")[2], subject, mmm.read(place), sentences)
        except BROKEN as error:
            item = Skipped(stem, archive.reason(error))
        yield item


def _kit_sentences(archive: Archive, name: str) -> tuple[str, ...]:
    with archive.opened(name) as path:
        try:
            sentences = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError) as error:
            raise DataError(f"{path.name} is not JSON: {error}") from error
        if not (isinstance(sentences, list) and all(isinstance(sentence, str) for sentence in sentences)):
            raise DataError(f"{path.name} is not a list of sentences")
    return tuple(sentence.strip() for sentence in sentences if sentence.strip())
