"""Corpora: motions with sentences, from the KIT Motion-Language data or from mocap files beside a table."""

import json
from collections.abc import Iterator, Mapping, Sequence
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

KIT_MOTION, KIT_SENTENCES = "_mmm.xml", "_annotations.json"
"""Ends of the names of KIT's files."""

NO_MOTION = "no motion file of this name"
"""Why a clip of the table is skipped that none of the files is."""


@dataclass(frozen=True, eq=False)
class Record:
    """One motion and what people said about it.

    subject: who moved, if the corpus tells. unseen: sentences whose wordings are for measuring, never for training.
    take: what it is a part of that must not be divided; "" where it is a take of its own. action: what it shows, named
    alike for all motions that show it; "" where that is not said. gaits: the ways of moving that it shows. loops:
    whether it is one period of what repeats.
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
    """A motion of the corpus that cannot be used, and why."""

    name: str
    reason: str


@dataclass(frozen=True)
class Corpus:
    """A corpus on disk; iterating reads it anew, one motion at a time.

    paths: its folders and zips; later ones replace files of earlier ones. names: the motion files. kit: whether it is
    KIT's. table: of sentences, None for motions alone. people: who moves in which clips. gaits: which motions show
    them, in addition to what the table says.
    """

    paths: tuple[Path, ...]
    names: tuple[str, ...]
    kit: bool = False
    table: Path | None = None
    people: tuple[Person, ...] = ()
    unit: str | float | None = None
    gaits: tuple[Gait, ...] = ()

    def __len__(self) -> int:
        """The number of motion files: each gives one Record or Skipped, or one for each of its clips."""
        return len(self.names)

    def shard(self, shard: Shard) -> "Corpus":
        """A part of it: files in a row, as many as of every other shard but for one; DataError if that is none."""
        start, stop = (len(self) * number // shard.count for number in (shard.number - 1, shard.number))
        if start == stop:
            raise DataError(f"{len(self)} motion files are too few for {shard.count} shards")
        return replace(self, names=self.names[start:stop])

    def __iter__(self) -> Iterator[Record | Skipped]:
        with Archive(*self.paths) as archive:
            if self.kit:
                found = kit_recordings(archive, self.names)
            else:
                said = None if self.table is None else read_table(self.table)
                found = recordings(archive, self.unit, said, self.people, self.names)
            for item in found:
                if isinstance(item, Record):
                    action = item.action or item.take or item.name
                    shown = (gait.name for gait in self.gaits if gait.shown(action, item.subject))
                    yield replace(item, gaits=tuple(dict.fromkeys((*item.gaits, *shown))))
                else:
                    yield item


def read_corpus(
    paths: Path | Sequence[Path],
    table: Path | None = None,
    people: tuple[Person, ...] = (),
    unit: str | float | None = None,
    described: bool = True,
    gaits: tuple[Gait, ...] = (),
) -> Corpus:
    """The corpus at ``paths``, folders and zips; DataError where there is none.

    With files ``*_annotations.json`` it is KIT's. Else it has motion files of the types .amc (with .asf) .bvh .npz
    .glb .vrma and a table of sentences: ``table``, or the only .tsv in the first folder, or the only one beside it.
    unit: the length unit of mocap files that do not state theirs, as in :func:`motet.read`. described: whether its
    motions need sentences; if not, only a named table is used. people, gaits: see :class:`Corpus`.
    """
    places = (paths,) if isinstance(paths, Path) else tuple(paths)
    with Archive(*places) as archive:
        names, motions = archive.names, motion_files(archive)
    if any(name.endswith(KIT_SENTENCES) for name in names):
        return Corpus(places, tuple(name for name in names if name.endswith(KIT_MOTION)), kit=True, gaits=gaits)
    if not motions:
        raise DataError(
            f"no motion files ({' '.join(MOCAP)}) in {', '.join(map(str, places))}, nor KIT's NNNNN{KIT_SENTENCES}"
        )
    if table is None and described:
        path = places[0]
        inside = sorted(path.glob("*.tsv")) if path.is_dir() else []
        found = inside or sorted(path.absolute().parent.glob("*.tsv"))
        if len(found) != 1:
            raise DataError(
                f"{path} needs one table of sentences (.tsv) in it or beside it, with the columns clip and sentence; "
                f"found: {', '.join(map(str, found)) or 'none'}"
            )
        table = found[0]
    return Corpus(places, motions, False, table, people, unit, gaits)


def motion_files(archive: Archive) -> tuple[str, ...]:
    """The motion files of an archive, in order of their names."""
    return tuple(name for name in archive.names if PurePosixPath(name).suffix.lower() in MOCAP)


def recordings(
    archive: Archive,
    unit: str | float | None = None,
    table: Mapping[str, Described] | None = None,
    people: tuple[Person, ...] = (),
    files: Sequence[str] | None = None,
) -> Iterator[Record | Skipped]:
    """The motion of each file of an archive, one of each clip's name; Skipped where it cannot be read or used.

    A file of several motions gives each by the file's name and its own: "people#Walk".
    unit: the length unit of files that do not state theirs, as in :func:`motet.read`. table: what is said of each clip,
    without which a motion is skipped, as is a clip without a motion; by default all motions are given, without
    sentences. A clip's subject is what the table says, or else what ``people`` say. files: which, by default all.
    """
    for name in archive.names:
        if name.lower().endswith(".asf"):
            archive.place(name)  # the reader of an AMC file looks for its skeleton near it
    seen: set[str] = set()
    for file, own in _motions(archive, motion_files(archive) if files is None else files):
        path, behind = PurePosixPath(file), "" if own is None else f"{MARK}{own}"
        whole = path.with_suffix("").as_posix() + behind
        clip = whole if whole in (table or {}) else path.stem + behind
        said = Described() if table is None else table.get(clip)
        if said is None:
            found: Record | Skipped = Skipped(clip, "no sentence")
        elif clip in seen:
            found = Skipped(clip, f"a second motion of this name: {file}")
        else:
            who, told = person(people, clip), (tuple(said.sentences), tuple(said.unseen))
            try:
                with archive.opened(file) as place:
                    motion = read_motion(place, unit=unit, clip=own)
                motion = with_travel(motion) if said.in_place else motion
                subject = said.subject or who.subject
                found = Record(clip, subject, motion, *told, who.take, said.action, said.gaits, said.loops)
            except BROKEN as error:
                found = Skipped(clip, archive.reason(error))
        yield found
        seen.add(clip)
    yield from (Skipped(clip, NO_MOTION) for clip in table or () if clip not in seen)


def _motions(archive: Archive, files: Sequence[str]) -> Iterator[tuple[str, str | None]]:
    """Motion files of an archive; one of several motions with the name of each."""
    for file in files:
        names: tuple[str, ...] = ()
        if PurePosixPath(file).suffix.lower() in CLIPPED:
            with suppress(*BROKEN), archive.opened(file) as place:  # reading it will say what is wrong
                names = clips(place)
        yield from ((file, name) for name in (names if len(names) > 1 else (None,)))


def kit_recordings(archive: Archive, files: Sequence[str]) -> Iterator[Record | Skipped]:
    """NNNNN_mmm.xml with the sentences of NNNNN_annotations.json; Skipped where there are none or a file is damaged.
    files: the NNNNN_mmm.xml."""
    names = frozenset(archive.names)
    for stem in (name.removesuffix(KIT_MOTION) for name in files):
        found: Record | Skipped = Skipped(stem, "no sentence")
        try:
            if sentences := _kit_sentences(archive, stem + KIT_SENTENCES) if stem + KIT_SENTENCES in names else ():
                with archive.opened(stem + KIT_MOTION) as place:
                    who = mmm.motion_name(place) or stem
                    found = Record(stem.rpartition("/")[2], who, mmm.read(place), sentences)
        except BROKEN as error:
            found = Skipped(stem, archive.reason(error))
        yield found


def _kit_sentences(archive: Archive, name: str) -> tuple[str, ...]:
    with archive.opened(name) as path:
        try:
            found = json.loads(path.read_text(encoding="utf-8"))
        except (ValueError, RecursionError) as error:
            raise DataError(f"{path.name} is not JSON: {error}") from error
        if not (isinstance(found, list) and all(isinstance(sentence, str) for sentence in found)):
            raise DataError(f"{path.name} is not a list of sentences")
    return tuple(sentence.strip() for sentence in found if sentence.strip())
