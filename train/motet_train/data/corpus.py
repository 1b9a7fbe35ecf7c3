"""Corpora: motions with sentences, from the KIT Motion-Language data or from mocap files beside a table."""

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from motet.formats import MOCAP, read_motion
from motet_train.data import kit
from motet_train.data.archive import BROKEN, Archive
from motet_train.data.errors import DataError
from motet_train.data.records import Record, Skipped
from motet_train.data.representation import ANGLES, FULL, Representation


@dataclass(frozen=True)
class Corpus:
    """A corpus on disk; iterating reads it anew, one motion at a time.

    names: the motion files. representation: how its motions become frames by default. A motion that cannot be read,
    has no sentence or comes twice is given as Skipped, and so is a clip of the table without a motion.
    """

    path: Path
    names: tuple[str, ...]
    representation: Representation
    table: Path | None = None
    metres_per_unit: float | None = None

    def __len__(self) -> int:
        """The number of motion files: each gives one Record or Skipped."""
        return len(self.names)

    def __iter__(self) -> Iterator[Record | Skipped]:
        with Archive(self.path) as archive:
            yield from kit.records(archive) if self.table is None else self._mocap(archive, read_table(self.table))

    def _mocap(self, archive: Archive, sentences: dict[str, tuple[str, ...]]) -> Iterator[Record | Skipped]:
        for name in archive.names:
            if name.lower().endswith(".asf"):
                archive.place(name)  # the reader of an AMC file looks for its skeleton near it
        seen: set[str] = set()
        for file in self.names:
            clip = _clip(file, sentences)
            if clip not in sentences:
                yield Skipped(clip, "no sentence")
            elif clip in seen:
                yield Skipped(clip, f"a second motion of this name: {file}")
            else:
                yield self._record(archive, file, clip, sentences[clip])
            seen.add(clip)
        yield from (Skipped(clip, "no motion file of this name") for clip in sentences if clip not in seen)

    def _record(self, archive: Archive, file: str, clip: str, sentences: tuple[str, ...]) -> Record | Skipped:
        try:
            with archive.opened(file) as place:
                motion = read_motion(place, unit=self.metres_per_unit)
            return Record(clip, clip.rpartition("/")[2].split("_")[0], motion, sentences)
        except BROKEN as error:
            return Skipped(clip, archive.reason(error))


def read_corpus(path: Path, table: Path | None = None, metres_per_unit: float | None = None) -> Corpus:
    """The corpus at ``path``, a folder or a zip; DataError where it is none.

    With files ``*_annotations.json`` it is KIT's. Else it has motion files of the types .amc (with .asf) .bvh .npz
    and a table of sentences: ``table``, or the only .tsv in the folder, or the only one beside the folder or zip.
    metres_per_unit: the length unit of mocap files, where they do not say it.
    """
    with Archive(path) as archive:
        names = archive.names
    if any(name.endswith(kit.ANNOTATIONS) for name in names):
        return Corpus(path, tuple(name for name in names if name.endswith(kit.MOTION)), ANGLES)
    motions = tuple(name for name in names if PurePosixPath(name).suffix.lower() in MOCAP)
    if not motions:
        raise DataError(
            f"no corpus in {path}: it has neither KIT's NNNNN{kit.ANNOTATIONS} nor motion files ({' '.join(MOCAP)})"
        )
    return Corpus(path, motions, FULL, table or _only_table(path), metres_per_unit)


def read_table(path: Path) -> dict[str, tuple[str, ...]]:
    """Clip -> its sentences, from a table with tabs and a header that has the columns ``clip`` and ``sentence``.

    Several lines of a clip give several sentences, empty ones are left out. DataError names the line that does not fit.
    """
    try:
        lines = list(
            csv.reader(path.read_text(encoding="utf-8-sig").splitlines(), delimiter="\t", quoting=csv.QUOTE_NONE)
        )
    except (OSError, UnicodeDecodeError) as error:
        raise DataError(f"the table of sentences {path} cannot be read: {error}") from error
    header = lines[0] if lines else []
    if not {"clip", "sentence"} <= set(header):
        raise DataError(f"{path}, line 1: the header needs the columns clip and sentence, with tabs between: {header}")
    found: dict[str, tuple[str, ...]] = {}
    for number, line in enumerate(lines[1:], start=2):
        if line and len(line) != len(header):
            raise DataError(f"{path}, line {number}: {len(line)} columns where the header has {len(header)}")
        row = dict(zip(header, map(str.strip, line), strict=False))
        if row.get("clip") and row["sentence"]:
            found[row["clip"]] = (*found.get(row["clip"], ()), row["sentence"])
    return found


def _clip(file: str, sentences: dict[str, tuple[str, ...]]) -> str:
    """The name of a motion file in the table: its path without the extension, or else its stem."""
    path = PurePosixPath(file)
    whole = path.with_suffix("").as_posix()
    return whole if whole in sentences else path.stem


def _only_table(path: Path) -> Path:
    inside = sorted(path.glob("*.tsv")) if path.is_dir() else []
    found = inside or sorted(path.absolute().parent.glob("*.tsv"))
    if len(found) != 1:
        raise DataError(
            f"{path} needs one table of sentences (.tsv) in it or beside it, with the columns clip and sentence; "
            f"found: {', '.join(map(str, found)) or 'none'}"
        )
    return found[0]
