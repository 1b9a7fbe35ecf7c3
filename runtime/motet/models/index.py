"""The motions of a folder as vectors, kept in one file so that searches are instant.

The file is an .npz of two arrays: ``vectors`` (N, E) float32, a unit vector for each window of each motion, and
``index``, the bytes of a JSON object with the model that made them and, for each motion file, its size and
modification time, and its windows in seconds or why it could not be used.
"""

import io
import json
import logging
import zipfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, overload

import numpy as np

from motet.bundle.graph import Floats
from motet.errors import FormatError, MotetError, MotionError, OutputError, UnitError
from motet.files import files_in, write_whole
from motet.formats import MOCAP, clips, read_motion
from motet.formats.clips import MARK
from motet.formats.npy import array
from motet.models.search import IndexSettings, SearchModel
from motet.motion.motion import Motion
from motet.motion.units import metres
from motet.settings import Progress, silent

log = logging.getLogger(__name__)

Query = str | Motion
"""A sentence, or a motion to find similar ones."""

NAME = ".motet-search.npz"
"""Name of the index file in its folder."""

VERSION = 2
"""Version of the file's format."""


@dataclass(frozen=True)
class Hit:
    """A motion file, the seconds in which it matches the query, and how well: 1 is identical.

    clip: its name in a file that holds several; else empty.
    """

    path: Path
    start: float
    stop: float
    score: float
    clip: str = ""

    @property
    def place(self) -> str:
        """The path, with the clip if there is one, as taken by :func:`motet.read`."""
        return f"{self.path}{MARK}{self.clip}" if self.clip else str(self.path)


@dataclass(frozen=True)
class Member:
    """A motion file of the folder, by its path within it, or a clip of one that holds several.

    windows: (start, stop) in seconds; fault: why it has none.
    """

    path: str
    size: int
    changed: int
    windows: tuple[tuple[float, float], ...] = ()
    fault: str = ""
    clip: str = ""

    @property
    def name(self) -> str:
        """The path, with the clip if there is one."""
        return f"{self.path}{MARK}{self.clip}" if self.clip else self.path


class Index:
    """The searchable motions of a folder; :meth:`open` makes one.

    folder: root of the paths of hits. vectors: (N, E) float32, of all windows of all members. vanished: files that no
    longer exist. unit: length unit with which :func:`motet.read` read them.
    """

    def __init__(
        self,
        model: SearchModel,
        folder: Path,
        members: Sequence[Member],
        vectors: Floats,
        vanished: Sequence[Path] = (),
        unit: str | float | None = None,
    ) -> None:
        self.model, self.folder, self.members, self.vectors = model, folder, tuple(members), vectors
        self.vanished, self.unit = tuple(vanished), unit
        self._windows = [(member, *window) for member in members for window in member.windows]

    @staticmethod
    def open(
        place: str | Path,
        model: SearchModel,
        file: str | Path | None = None,
        *,
        unit: str | float | None = None,
        progress: Progress = silent,
    ) -> "Index":
        """The index of all motion files in a folder and its subfolders; or of the folder of an index file.

        An existing index is reused; new and changed motion files are read and embedded, and the index file is rewritten
        as a whole. Motion files that cannot be read or used are listed in :attr:`failed`, vanished ones in
        :attr:`vanished`.
        file: the index file, by default ".motet-search.npz" in the folder, if that is writable.
        unit: the length unit of files that do not state theirs, like in :func:`motet.read`; an index made with another
        unit is rebuilt.
        progress: called with the number of motion files done and in total.
        FormatError for a missing folder, one without motion files, or an index that is damaged or of another model;
        MotionError where no motion can be used, or for an unknown unit.
        """
        if unit is not None:
            metres(unit)
        place = Path(place)
        kept = place if place.is_file() else Path(file or place / NAME)
        before = _read(kept, model) if kept.is_file() else None
        folder = before.folder if before is not None and kept == place else place
        found = _renewed(folder, model, before, unit, progress)
        if before is None or found._told() != before._told():
            _keep(found, kept, needed=file is not None)
        for path in found.vanished:
            log.warning("%s has vanished since it was indexed", path)
        if not len(found.vectors):
            path, fault = next(iter(found.failed.items()))
            raise MotionError(f"none of {len(found.members)} motion files of {folder} can be used: {path}: {fault}")
        return found

    @property
    def failed(self) -> dict[Path, str]:
        """The motion files that could not be indexed, and why."""
        return {self.folder / member.name: member.fault for member in self.members if member.fault}

    @overload
    def search(  # type: ignore[overload-overlap]  # a string is a sequence of strings, too
        self, queries: Query, count: int | None = None
    ) -> list[Hit]: ...
    @overload
    def search(self, queries: Sequence[Query], count: int | None = None) -> list[list[Hit]]: ...
    def search(self, queries: Query | Sequence[Query], count: int | None = None) -> list[Hit] | list[list[Hit]]:
        """The ``count`` files or clips nearest to a sentence or a motion, best first, each with its best window; for
        several queries, a list for each.

        count: the bundle's by default. TextError for a sentence without a known word, MotionError for a motion that
        the model cannot take, DecodingError for a count that is not between 1 and 1,000.
        """
        wanted = int(self.model.loop.settled(self.model.defaults, {"count": count})["count"])
        if isinstance(queries, str | Motion):
            return self._nearest(queries, wanted)
        return [self._nearest(query, wanted) for query in queries]

    def _nearest(self, query: Query, wanted: int) -> list[Hit]:
        scores = self.vectors @ self._vector(query)
        found: dict[str, Hit] = {}
        for row in self.model.loop.run(scores, len(scores)):
            member, start, stop = self._windows[row]
            if member.name not in found:
                place = self.folder / member.path
                found[member.name] = Hit(place, start, stop, float(scores[row]), member.clip)
            if len(found) == wanted:
                break
        return list(found.values())

    def _told(self) -> tuple[Path, str | float | None, tuple[Member, ...]]:
        """Contents of the file, except the vectors and the model."""
        return self.folder.absolute(), self.unit, self.members

    def _vector(self, query: Query) -> Floats:
        """The vector (E,) of a sentence or a motion."""
        return self.model.embed_text(query) if isinstance(query, str) else direction(self.model, query)


def direction(model: SearchModel, motion: Motion) -> Floats:
    """The unit vector (E,) float32 of a motion of any length: the mean direction of its windows; MotionError for one
    that the model cannot take."""
    mean = model.embed([part for _, part in model.windows(motion, model.settings(IndexSettings).window)]).mean(axis=0)
    found: Floats = mean / np.linalg.norm(mean)
    return found


def _renewed(
    folder: Path, model: SearchModel, before: Index | None, unit: str | float | None, progress: Progress
) -> Index:
    """The current index of a folder, reusing the entries of unchanged files."""
    known = {} if before is None else _by_file(before)
    usable = known if before is not None and before.unit == unit else {}
    if not folder.is_dir():
        raise FormatError(folder, "neither a folder of motion files nor an index of one")
    paths = files_in(folder, MOCAP)
    if not paths:
        raise FormatError(folder, f"no motion files ({' '.join(MOCAP)}) are in it")
    members, vectors = [], []
    for done, path in enumerate(paths, start=1):
        state = path.stat()
        file = Member(path.relative_to(folder).as_posix(), state.st_size, state.st_mtime_ns)
        was = usable.get((file.path, file.size, file.changed))
        for member, rows in was or _embedded_clips(path, file, model, unit):
            members.append(member)
            vectors.append(rows)
        progress(done, len(paths))
    gone = {path for path, _, _ in known} - {member.path for member in members}
    return Index(model, folder, members, np.concatenate(vectors), [folder / path for path in sorted(gone)], unit)


def _by_file(index: Index) -> dict[tuple[str, int, int], list[tuple[Member, Floats]]]:
    """For each motion file, with its size and modification time, its members and their vectors."""
    found: dict[tuple[str, int, int], list[tuple[Member, Floats]]] = {}
    stop = 0
    for member in index.members:
        start, stop = stop, stop + len(member.windows)
        file = member.path, member.size, member.changed
        found.setdefault(file, []).append((member, index.vectors[start:stop]))
    return found


def _embedded_clips(
    path: Path, file: Member, model: SearchModel, unit: str | float | None
) -> list[tuple[Member, Floats]]:
    """The members of a motion file, one for each clip, with their vectors."""
    try:
        names = clips(path)
    except MotetError:  # it is said when the file is read
        names = ()
    found = [replace(file, clip=name) for name in names] if len(names) > 1 else [file]
    return [_embedded(path, member, model, unit) for member in found]


def _embedded(path: Path, member: Member, model: SearchModel, unit: str | float | None) -> tuple[Member, Floats]:
    """A member with its windows and their vectors, or with the reason for having none."""
    size = model.sizes["E"]
    try:
        motion = read_motion(path, unit=unit, clip=member.clip or None)
        parts = model.windows(motion, model.settings(IndexSettings).window)
        vectors = model.embed([part for _, part in parts])
    except MotetError as error:
        hint = " (Index.open's unit, --unit-in)" if isinstance(error, UnitError) else ""
        fault = str(error).removeprefix(f"{path}: ") + hint
        return replace(member, fault=fault), np.empty((0, size), np.float32)
    windows = tuple((start, start + part.duration) for start, part in parts)
    return replace(member, windows=windows), vectors


def _keep(index: Index, file: Path, needed: bool) -> None:
    """Write the file; if not ``needed``, only warn where that fails."""
    text = {
        "version": VERSION,
        "model": index.model.identity,
        "folder": str(index.folder.absolute()),
        "unit": index.unit,
        "members": [asdict(member) for member in index.members],
    }
    content = io.BytesIO()
    np.savez(content, vectors=index.vectors, index=np.frombuffer(json.dumps(text).encode(), np.uint8))
    try:
        write_whole(file, content.getvalue())
    except OutputError as error:
        if needed:
            raise
        log.warning("the index is not kept: %s", error)


def _read(file: Path, model: SearchModel) -> Index:
    """Read what :func:`_keep` wrote; FormatError for anything else, or another model's index."""
    try:
        with zipfile.ZipFile(file) as archive:
            vectors, text = array(archive, "vectors", "f"), array(archive, "index", "u")
        data = json.loads(text.tobytes())
        version, made = int(data["version"]), str(data["model"])
        folder, unit = Path(data["folder"]), data.get("unit")
        members = [_member(entry) for entry in data["members"]] if version == VERSION else []
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        reason = str(error)[:200]
        raise FormatError(file, f"not an index of motions: {reason}; remove it, or name another") from error
    if version != VERSION or made != model.identity:
        by = f"the model {made}, not {model.identity}" if version == VERSION else f"another motet (version {version})"
        raise FormatError(file, f"this index was made by {by}: remove it, or name another")
    if vectors.shape != (sum(len(member.windows) for member in members), model.sizes["E"]):
        raise FormatError(file, "this index is damaged: its vectors are not those of its windows; remove it")
    return Index(model, folder, members, vectors.astype(np.float32, copy=False), unit=unit)


def _member(data: dict[str, Any]) -> Member:
    windows = tuple((float(start), float(stop)) for start, stop in data["windows"])
    size, changed, fault, clip = int(data["size"]), int(data["changed"]), str(data["fault"]), str(data["clip"])
    return Member(str(data["path"]), size, changed, windows, fault, clip)
