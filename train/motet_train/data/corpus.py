"""Corpora: motions with sentences, from the KIT Motion-Language data or from mocap files beside a table."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from motet.formats import MOCAP, read_motion
from motet_train.data import kit
from motet_train.data.archive import BROKEN, Archive
from motet_train.data.errors import DataError
from motet_train.data.preparation import ANGLES, FULL, Preparation
from motet_train.data.records import Record, Skipped


@dataclass(frozen=True)
class Described:
    """What a table says of a clip: sentences, and who moved, "" where it does not say that."""

    sentences: tuple[str, ...]
    subject: str = ""


@dataclass(frozen=True)
class Corpus:
    """A corpus on disk; iterating reads it anew, one motion at a time.

    names: the motion files. preparation: how its motions become sequences. A motion that cannot be read,
    has no sentence or comes twice is given as Skipped, and so is a clip of the table without a motion.
    """

    path: Path
    names: tuple[str, ...]
    preparation: Preparation
    table: Path | None = None
    unit: str | float | None = None

    def __len__(self) -> int:
        """The number of motion files: each gives one Record or Skipped."""
        return len(self.names)

    def __iter__(self) -> Iterator[Record | Skipped]:
        with Archive(self.path) as archive:
            if self.table is None:
                yield from kit.records(archive)
            else:
                yield from recordings(archive, self.unit, read_table(self.table))


def read_corpus(path: Path, table: Path | None = None, unit: str | float | None = None) -> Corpus:
    """The corpus at ``path``, a folder or a zip; DataError where it is none.

    With files ``*_annotations.json`` it is KIT's. Else it has motion files of the types .amc (with .asf) .bvh .npz
    and a table of sentences: ``table``, or the only .tsv in the folder, or the only one beside the folder or zip.
    unit: the length unit of mocap files that do not state theirs, as in :func:`motet.read`.
    """
    with Archive(path) as archive:
        names, motions = archive.names, motion_files(archive)
    if any(name.endswith(kit.ANNOTATIONS) for name in names):
        return Corpus(path, tuple(name for name in names if name.endswith(kit.MOTION)), ANGLES)
    if not motions:
        raise DataError(
            f"no corpus in {path}: it has neither KIT's NNNNN{kit.ANNOTATIONS} nor motion files ({' '.join(MOCAP)})"
        )
    return Corpus(path, motions, FULL, table or _only_table(path), unit)


def motion_files(archive: Archive) -> tuple[str, ...]:
    """The motion files of an archive, in order of their names."""
    return tuple(name for name in archive.names if PurePosixPath(name).suffix.lower() in MOCAP)


def recordings(
    archive: Archive, unit: str | float | None = None, table: Mapping[str, Described] | None = None
) -> Iterator[Record | Skipped]:
    """The motion of each file of an archive, one of each clip's name; Skipped where it cannot be read or used.

    unit: the length unit of files that do not state theirs, as in :func:`motet.read`. table: what is said of each clip,
    without which a motion is skipped, as is a clip without a motion; by default all motions are given, without
    sentences. A clip's subject is what the table says, or else its name up to the first "_".
    """
    for name in archive.names:
        if name.lower().endswith(".asf"):
            archive.place(name)  # the reader of an AMC file looks for its skeleton near it
    seen: set[str] = set()
    for file in motion_files(archive):
        clip = _clip(file, table or {})
        said = Described(()) if table is None else table.get(clip)
        if said is None:
            yield Skipped(clip, "no sentence")
        elif clip in seen:
            yield Skipped(clip, f"a second motion of this name: {file}")
        else:
            yield _record(archive, file, clip, said, unit)
        seen.add(clip)
    yield from (Skipped(clip, "no motion file of this name") for clip in table or () if clip not in seen)


def read_table(path: Path) -> dict[str, Described]:
    """What a table says of each clip: tabs between, and a header that has the columns ``clip`` and ``sentence``.

    Several lines of a clip give several sentences, empty ones are left out. A column ``subject`` says who moved, once
    for each clip or always alike. DataError names the line that does not fit.
    """
    try:
        lines = [line.split("\t") for line in path.read_text(encoding="utf-8-sig").split("\n")]
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the table of sentences {path} cannot be read: {error}") from error
    header = lines[0] if lines else []
    if not {"clip", "sentence"} <= set(header):
        raise DataError(f"{path}, line 1: the header needs the columns clip and sentence, with tabs between: {header}")
    sentences: dict[str, list[str]] = {}
    subjects: dict[str, str] = {}
    for number, line in enumerate(lines[1:], start=2):
        if line == [""]:
            continue
        if len(line) != len(header):
            raise DataError(f"{path}, line {number}: {len(line)} columns where the header has {len(header)}")
        row = dict(zip(header, map(str.strip, line), strict=True))
        clip, subject = row["clip"], row.get("subject", "")
        if clip and row["sentence"]:
            sentences.setdefault(clip, []).append(row["sentence"])
        if subject and subjects.setdefault(clip, subject) != subject:
            raise DataError(
                f"{path}, line {number}: the subject of {clip} is {subject!r}, and {subjects[clip]!r} above"
            )
    return {clip: Described(tuple(said), subjects.get(clip, "")) for clip, said in sentences.items()}


def _record(archive: Archive, file: str, clip: str, said: Described, unit: str | float | None) -> Record | Skipped:
    try:
        with archive.opened(file) as place:
            motion = read_motion(place, unit=unit)
        return Record(clip, said.subject or clip.rpartition("/")[2].split("_")[0], motion, said.sentences)
    except BROKEN as error:
        return Skipped(clip, archive.reason(error))


def _clip(file: str, table: Mapping[str, Described]) -> str:
    """The name of a motion file in the table: its path without the extension, or else its stem."""
    path = PurePosixPath(file)
    whole = path.with_suffix("").as_posix()
    return whole if whole in table else path.stem


def _only_table(path: Path) -> Path:
    inside = sorted(path.glob("*.tsv")) if path.is_dir() else []
    found = inside or sorted(path.absolute().parent.glob("*.tsv"))
    if len(found) != 1:
        raise DataError(
            f"{path} needs one table of sentences (.tsv) in it or beside it, with the columns clip and sentence; "
            f"found: {', '.join(map(str, found)) or 'none'}"
        )
    return found[0]
