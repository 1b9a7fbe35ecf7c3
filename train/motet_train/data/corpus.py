"""Corpora: motions with sentences, from the KIT Motion-Language data or from mocap files beside a table."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from motet.formats import CLIPPED, MOCAP, clips, read_motion
from motet.formats.lines import MARK
from motet_train.data import kit
from motet_train.data.archive import BROKEN, Archive
from motet_train.data.errors import DataError
from motet_train.data.gaits import Gait
from motet_train.data.records import Record, Skipped
from motet_train.data.table import Described, Person, person, read_table


@dataclass(frozen=True)
class Corpus:
    """A corpus on disk; iterating reads it anew, one motion at a time.

    paths: its folders and zips, of which the later takes the place of the earlier's files. names: the motion files.
    kit: whether it is KIT's. table: of sentences, None for motions alone. people: who moves in which clips. A motion
    that cannot be read, comes twice or is not in the table is given as Skipped, and so is a clip of the table without a
    motion. gaits: which motions show them, beside those of which the table says so.
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

    def __iter__(self) -> Iterator[Record | Skipped]:
        with Archive(*self.paths) as archive:
            if self.kit:
                found = kit.records(archive)
            else:
                said = None if self.table is None else read_table(self.table)
                found = recordings(archive, self.unit, said, self.people)
            yield from (self._moving(item) if isinstance(item, Record) else item for item in found)

    def _moving(self, record: Record) -> Record:
        action = record.action or record.take or record.name
        shown = (gait.name for gait in self.gaits if gait.shown(action, record.subject))
        return replace(record, gaits=tuple(dict.fromkeys((*record.gaits, *shown))))


def read_corpus(
    paths: Path | Sequence[Path],
    table: Path | None = None,
    people: tuple[Person, ...] = (),
    unit: str | float | None = None,
    described: bool = True,
    gaits: tuple[Gait, ...] = (),
) -> Corpus:
    """The corpus at ``paths``, folders and zips; DataError where it is none.

    With files ``*_annotations.json`` it is KIT's. Else it has motion files of the types .amc (with .asf) .bvh .npz
    .glb .vrma and a table of sentences: ``table``, or the only .tsv in the first folder, or the only one beside
    it. Of two files of one name that of the later place counts. people: who moves in which clips.
    unit: the length unit of mocap files that do not state theirs, as in :func:`motet.read`. described: whether its
    motions need sentences; else a table that is not named is not looked for. gaits: see :class:`Corpus`.
    """
    places = (paths,) if isinstance(paths, Path) else tuple(paths)
    with Archive(*places) as archive:
        names, motions = archive.names, motion_files(archive)
    if any(name.endswith(kit.ANNOTATIONS) for name in names):
        return Corpus(places, tuple(name for name in names if name.endswith(kit.MOTION)), kit=True, gaits=gaits)
    if not motions:
        raise DataError(
            f"no motion files ({' '.join(MOCAP)}) in {', '.join(map(str, places))}, nor KIT's NNNNN{kit.ANNOTATIONS}"
        )
    table = table or (_only_table(places[0]) if described else None)
    return Corpus(places, motions, False, table, people, unit, gaits)


def motion_files(archive: Archive) -> tuple[str, ...]:
    """The motion files of an archive, in order of their names."""
    return tuple(name for name in archive.names if PurePosixPath(name).suffix.lower() in MOCAP)


def recordings(
    archive: Archive,
    unit: str | float | None = None,
    table: Mapping[str, Described] | None = None,
    people: tuple[Person, ...] = (),
) -> Iterator[Record | Skipped]:
    """The motion of each file of an archive, one of each clip's name; Skipped where it cannot be read or used.

    A file of several motions gives each by the file's name and its own: "people#Walk".
    unit: the length unit of files that do not state theirs, as in :func:`motet.read`. table: what is said of each clip,
    without which a motion is skipped, as is a clip without a motion; by default all motions are given, without
    sentences. A clip's subject is what the table says, or else what ``people`` say.
    """
    for name in archive.names:
        if name.lower().endswith(".asf"):
            archive.place(name)  # the reader of an AMC file looks for its skeleton near it
    seen: set[str] = set()
    for file, own in _motions(archive):
        clip = _clip(file, own, table or {})
        said = Described() if table is None else table.get(clip)
        if said is None:
            yield Skipped(clip, "no sentence")
        elif clip in seen:
            yield Skipped(clip, f"a second motion of this name: {file}")
        else:
            yield _record(archive, file, own, said, person(people, clip), clip, unit)
        seen.add(clip)
    yield from (Skipped(clip, "no motion file of this name") for clip in table or () if clip not in seen)


def _motions(archive: Archive) -> Iterator[tuple[str, str | None]]:
    """The motion files of an archive; one of several motions with the name of each."""
    for file in motion_files(archive):
        names = _clips(archive, file) if PurePosixPath(file).suffix.lower() in CLIPPED else ()
        yield from ((file, name) for name in (names if len(names) > 1 else (None,)))


def _clips(archive: Archive, file: str) -> tuple[str, ...]:
    try:
        with archive.opened(file) as place:
            return clips(place)
    except BROKEN:  # it is said when the file is read
        return ()


def _record(
    archive: Archive, file: str, own: str | None, said: Described, who: Person, clip: str, unit: str | float | None
) -> Record | Skipped:
    try:
        with archive.opened(file) as place:
            motion = read_motion(place, unit=unit, clip=own)
        subject = said.subject or who.subject
        return Record(
            clip, subject, motion, tuple(said.sentences), tuple(said.unseen), who.take, said.action, said.gaits
        )
    except BROKEN as error:
        return Skipped(clip, archive.reason(error))


def _clip(file: str, own: str | None, table: Mapping[str, Described]) -> str:
    """The name of a motion in the table: its file's path without the extension, or else its stem; and its own name."""
    path, behind = PurePosixPath(file), "" if own is None else f"{MARK}{own}"
    whole = path.with_suffix("").as_posix() + behind
    return whole if whole in table else path.stem + behind


def _only_table(path: Path) -> Path:
    inside = sorted(path.glob("*.tsv")) if path.is_dir() else []
    found = inside or sorted(path.absolute().parent.glob("*.tsv"))
    if len(found) != 1:
        raise DataError(
            f"{path} needs one table of sentences (.tsv) in it or beside it, with the columns clip and sentence; "
            f"found: {', '.join(map(str, found)) or 'none'}"
        )
    return found[0]
