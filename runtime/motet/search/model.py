"""Search: motions and sentences as unit vectors of one space, in which matching ones are near; and a folder's index.

An index is kept in one file so that searches are instant: an .npz of two arrays, ``vectors`` (N, E) float32, a unit
vector for each window of each motion, and ``index``, the bytes of a JSON object with the model that made them and, for
each motion file, its size and modification time, and its windows in seconds or why it could not be used.
"""

import io
import json
import logging
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Annotated, Any, ClassVar, overload

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.errors import ArgumentError, FormatError, MotetError, MotionError, OutputError, UnitError, quoted
from motet.figures.feet.treadmill import is_in_place, with_travel
from motet.files import files_in, write_whole
from motet.formats import MOCAP, clips, read_motion
from motet.formats.npz import array
from motet.formats.text import MARK
from motet.jobs import Shard, in_order
from motet.models.language import MAX_SECONDS, LanguageModel, texts_of
from motet.motion.motion import Motion, is_many, motions_of
from motet.motion.skeleton import metres
from motet.search.nearest import LOOPS
from motet.settings import Progress, Range, Settings, silent

log = logging.getLogger(__name__)

Query = str | Motion
"""A sentence, or a motion to find similar ones."""

INDEX_FILE = ".motet-search.npz"  # of the index file in its folder
VERSION = 3  # of its format


@dataclass(frozen=True)
class IndexSettings(Settings):
    """window: longest motion for one vector; longer ones are cut, so that a hit has a time.

    like_text, like_motion: the score from which a hit is like a sentence or a motion, which 95 % of the first hits that
    are right have for people kept back (docs/search.md).
    """

    FEATURE: ClassVar[str] = "index"
    window: Annotated[float, Range(0.5, MAX_SECONDS, "s")] = 10.0
    like_text: Annotated[float, Range(-1, 1)] = 0.45
    like_motion: Annotated[float, Range(-1, 1)] = 0.87


class SearchModel(LanguageModel):
    """A model that embeds motions and sentences in one space; their similarity is the product of their vectors. Its
    loop takes scores (Q, N) and the number of best ones wanted, and returns their columns."""

    VERB = "search"
    SETTINGS = (IndexSettings,)
    LOOPS = LOOPS
    ROLES = ("motion", "text")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        vector = {"vector": "batch E"}
        self.bind("motion", {"frames": "batch time D", "lengths": "*batch"}, vector)
        self.bind("text", {"words": "*batch words", "lengths": "*batch"}, vector)

    def embed(self, motions: Motion | Sequence[Motion]) -> Floats:
        """The unit vector (E,) float32 of a motion, or vectors (N, E) of several; MotionError like :meth:`frames`."""
        many = motions_of(motions)
        vectors = self.contexts([self.frames(motion) for motion in many], "motion")
        return vectors[0] if isinstance(motions, Motion) else vectors

    def embed_text(self, sentences: str | Sequence[str]) -> Floats:
        """The unit vector (E,) float32 of a sentence, or vectors (N, E) of several; errors like :meth:`ids`."""
        texts = texts_of(sentences)
        vectors = self.contexts([self.ids(text) for text in texts], "text")
        return vectors[0] if isinstance(sentences, str) else vectors

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Frames (T, D) and a sentence ("text" of the settings) to ids (words,) int64 and the vectors (E,) of both."""
        ids, _ = self.vocabulary.encode(str(settings["text"]))
        motion = self.contexts([inputs["frames"]], "motion")
        text = self.contexts([ids], "text")
        return {"ids": ids, "motion": motion[0], "text": text[0]}


@dataclass(frozen=True)
class Hit:
    """A motion file, the seconds in which it matches the query, and how well: 1 is identical.

    clip: its name in a file that holds several; else empty. in_place: whether it is a clip in place, which is compared
    with the path that its feet imply. like: whether it is like the query at all, and not only nearer than the others.
    """

    path: Path
    start: float
    stop: float
    score: float
    clip: str = ""
    in_place: bool = False
    like: bool = True

    @property
    def place(self) -> str:
        """The path, with the clip if there is one, as taken by :func:`motet.read`."""
        return f"{self.path}{MARK}{self.clip}" if self.clip else str(self.path)


@dataclass(frozen=True)
class Member:
    """A motion file of the folder, by its path within it, or a clip of one that holds several.

    windows: (start, stop) in seconds; fault: why it has none. in_place: whether it is a clip in place.
    """

    path: str
    size: int
    changed: int
    windows: tuple[tuple[float, float], ...] = ()
    fault: str = ""
    clip: str = ""
    in_place: bool = False

    @property
    def state(self) -> tuple[str, int, int]:
        """By which its file is known again: path, size and modification time."""
        return self.path, self.size, self.changed

    @property
    def name(self) -> str:
        """The path, with the clip if there is one."""
        return f"{self.path}{MARK}{self.clip}" if self.clip else str(self.path)


@dataclass(frozen=True, eq=False, repr=False)
class Index:
    """The searchable motions of a folder; :meth:`open` makes one.

    folder: root of the paths of hits. vectors: (N, E) float32, of all windows of all members. vanished: files that no
    longer exist. unit: length unit with which :func:`motet.read` read them. shard: which of the files it has.
    """

    model: SearchModel
    folder: Path
    members: tuple[Member, ...]
    vectors: Floats
    vanished: tuple[Path, ...] = ()
    unit: str | float | None = None
    shard: Shard = field(default_factory=Shard)

    @staticmethod
    def open(  # noqa: PLR0913  options by name
        place: str | Path,
        model: SearchModel,
        file: str | Path | None = None,
        *,
        unit: str | float | None = None,
        jobs: int | None = 1,
        shard: Shard | None = None,
        merge: Sequence[str | Path] = (),
        progress: Progress = silent,
    ) -> "Index":
        """The index of all motion files in a folder and its subfolders; or of the folder of an index file.

        An existing index is reused; only new and changed motion files are read and embedded. Motion files that cannot
        be read or used are listed in :attr:`failed`, vanished ones in :attr:`vanished`.
        file: the index file, by default ".motet-search.npz" in the folder, if that is writable.
        unit: the length unit of files that do not state theirs, like in :func:`motet.read`; an index made with another
        unit is rebuilt.
        jobs: processes for many files that are new or have changed; None: one for each core.
        shard: only these of the files, for one of several machines; None: as the index says, or all.
        merge: indexes of shards, whose vectors are taken for files that have not changed.
        progress: called with the number of motion files done and in total.
        FormatError for a missing folder, one without motion files, or an index that is damaged or of another model;
        MotionError where no motion can be used, or for an unknown unit.
        """
        if unit is not None:
            metres(unit)
        # the index that was kept before, if any
        place = Path(place)
        kept = place if place.is_file() else Path(file or place / INDEX_FILE)
        before = _read(kept, model) if kept.is_file() else None
        if before is not None and kept == place:
            folder = before.folder
            shard = shard or before.shard
        else:
            folder = place
            shard = shard or Shard()
        # vectors of files that have not changed are taken from it, and from other indexes
        known = [] if before is None else [before]
        for path in merge:
            merged = _read(Path(path), model)
            if merged is not None:
                known.append(merged)
        index = _renewed(folder, model, known, unit, jobs, shard, progress)
        # it is written only if something has changed
        if before is None or _state(before) != _state(index):
            _keep(index, kept, needed=file is not None)
        return _usable(index)

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
        several queries, a list for each. Where the first is not ``like`` the query, nothing is: none is like a sentence
        with a word that the model does not know.

        count: the bundle's by default. TextError for a sentence without a known word, MotionError for a motion that
        the model cannot take, DecodingError for a count that is not between 1 and 1,000.
        """
        wanted = int(self.model.loop.settled(self.model.defaults, {"count": count})["count"])
        if isinstance(queries, str | Motion):
            return self._nearest(queries, wanted)
        if not is_many(queries) or not all(isinstance(query, str | Motion) for query in queries):
            raise ArgumentError(f"expected a sentence or a motion, or several, not {quoted(repr(queries))}")
        return [self._nearest(query, wanted) for query in queries]

    @cached_property
    def _windows(self) -> list[tuple[Member, float, float]]:
        windows = []
        for member in self.members:
            for start, stop in member.windows:
                windows.append((member, start, stop))
        return windows

    def _nearest(self, query: Query, wanted: int) -> list[Hit]:
        settings = self.model.settings(IndexSettings)
        if isinstance(query, str):
            vector = self.model.embed_text(query)
            # nothing is like what the model has no word for, however near the rest of the sentence is
            least = np.inf if self.model.unknown(query) else settings.like_text
        else:
            vector = direction(self.model, query)
            least = settings.like_motion
        # the best window of each motion
        scores = self.vectors @ vector
        hits: dict[str, Hit] = {}
        for row in self._best_first(scores):
            member, start, stop = self._windows[row]
            if member.name not in hits:
                place = self.folder / member.path
                score = float(scores[row])
                hits[member.name] = Hit(place, start, stop, score, member.clip, member.in_place, score >= least)
            if len(hits) == wanted:
                break
        return list(hits.values())

    def _best_first(self, scores: Floats) -> Iterator[int]:
        """The columns of scores (N,) by the model's loop: the few that are mostly enough, then more."""
        done = 0
        count = 256
        while done < len(scores):
            best = self.model.loop.run(scores, count)[done:].tolist()
            yield from best
            done += len(best)
            count *= 16


def direction(model: SearchModel, motion: Motion) -> Floats:
    """The unit vector (E,) float32 of a motion of any length: the mean direction of its windows; MotionError for one
    that the model cannot take."""
    mean = model.embed([part for _, part in model.windows(motion, model.settings(IndexSettings).window)]).mean(axis=0)
    unit_direction: Floats = mean / np.linalg.norm(mean)
    return unit_direction


Entries = dict[tuple[str, int, int], list[tuple[Member, Floats]]]
"""The members of each file, by its :attr:`Member.state`, with their vectors (windows, E)."""


def _renewed(
    folder: Path,
    model: SearchModel,
    before: Sequence[Index],
    unit: str | float | None,
    jobs: int | None,
    shard: Shard,
    progress: Progress,
) -> Index:
    """The current index of a folder, reusing the entries of unchanged files."""
    known: Entries = {}
    for index in before:
        known |= _entries(index) if index.unit == unit else {}
    files = [_file(folder, path) for path in _motion_files(folder, shard)]

    # what is new or has changed, read and embedded
    new = [file for file in files if file.state not in known]
    embedded = in_order(partial(_embedded, folder, model=model, unit=unit), new, jobs)
    rows = list[tuple[Member, Floats]]()
    for done, file in enumerate(files, start=1):
        rows += known.get(file.state) or next(embedded)
        progress(done, len(files))

    vanished = _vanished(folder, known)
    members, vectors = zip(*rows, strict=True)
    return Index(model, folder, members, np.concatenate(vectors), vanished, unit, shard)


def _vanished(folder: Path, known: Entries) -> tuple[Path, ...]:
    """The files that were indexed before, and are there no more."""
    paths = sorted({path for path, _, _ in known})
    return tuple(folder / path for path in paths if not (folder / path).exists())


def _motion_files(folder: Path, shard: Shard) -> Sequence[Path]:
    if not folder.is_dir():
        raise FormatError(folder, "neither a folder of motion files nor an index of one")
    paths = shard.of(files_in(folder, MOCAP))
    if not paths:
        raise FormatError(folder, f"no motion files ({' '.join(MOCAP)}) are in {'it' if shard == Shard() else shard}")
    return paths


def _entries(index: Index) -> Entries:
    entries: Entries = {}
    stops = np.cumsum([len(member.windows) for member in index.members])
    for member, rows in zip(index.members, np.split(index.vectors, stops)[:-1], strict=True):
        entries.setdefault(member.state, []).append((member, rows))
    return entries


def _state(index: Index) -> tuple[object, ...]:
    return index.folder.absolute(), index.unit, index.shard, index.members


def _file(folder: Path, path: Path) -> Member:
    state = path.stat()
    return Member(path.relative_to(folder).as_posix(), state.st_size, state.st_mtime_ns)


def _embedded(folder: Path, file: Member, model: SearchModel, unit: str | float | None) -> list[tuple[Member, Floats]]:
    """The members of a motion file, one for each clip, with their windows' vectors, or with the reason for none."""
    path = folder / file.path
    try:
        names = clips(path)
    except MotetError:  # it is said when the file is read
        names = ()
    members = [replace(file, clip=name) for name in names] if len(names) > 1 else [file]
    return [_embedded_member(path, member, model, unit) for member in members]


def _embedded_member(path: Path, member: Member, model: SearchModel, unit: str | float | None) -> tuple[Member, Floats]:
    """A member with its windows and their vectors, or with the reason for none."""
    try:
        motion = read_motion(path, unit=unit, clip=member.clip or None)
        # a clip in place is searched as if it travelled
        in_place = is_in_place(motion)
        motion = with_travel(motion) if in_place else motion
        parts = model.windows(motion, model.settings(IndexSettings).window)
        vectors = model.embed([part for _, part in parts])
    except MotetError as error:
        # what is wrong with a file is kept, so that it is not read again
        hint = " (Index.open's unit, --unit-in)" if isinstance(error, UnitError) else ""
        fault = str(error).removeprefix(f"{path}: ") + hint
        return replace(member, fault=fault), np.empty((0, model.sizes["E"]), np.float32)
    windows = tuple((start, start + part.duration) for start, part in parts)
    return replace(member, windows=windows, in_place=in_place), vectors


def _keep(index: Index, file: Path, needed: bool) -> None:
    """Write the file; if not ``needed``, only warn where that fails."""
    text = {
        "version": VERSION,
        "model": index.model.manifest.identity,
        "folder": str(index.folder.absolute()),
        "unit": index.unit,
        "shard": str(index.shard),
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


def _usable(index: Index) -> Index:
    """An index, once files that vanished are logged; MotionError where it has no motion."""
    for path in index.vanished:
        log.warning("%s has vanished since it was indexed", path)
    if not len(index.vectors):
        path, fault = next(iter(index.failed.items()))
        raise MotionError(f"none of {len(index.members)} motion files of {index.folder} can be used: {path}: {fault}")
    return index


def _read(file: Path, model: SearchModel) -> Index:
    """Read what :func:`_keep` wrote; FormatError for anything else, or another model's index."""
    try:
        with zipfile.ZipFile(file) as archive:
            vectors = array(archive, "vectors", "f")
            text = array(archive, "index", "u")
        data = json.loads(text.tobytes())
        version = int(data["version"])
        made = str(data["model"])
        folder = Path(data["folder"])
        unit = data.get("unit")
        shard = Shard.parse(data.get("shard", "1/1"))
        members = tuple(_member(**entry) for entry in data["members"]) if version == VERSION else ()
    # a damaged archive makes zipfile, its unpackers, numpy and json raise errors of a dozen types
    except Exception as error:
        reason = str(error)[:200]
        raise FormatError(file, f"not an index of motions: {reason}; remove it, or name another") from error
    if version != VERSION:
        raise FormatError(file, f"this index was made by another motet (version {version}): remove it, or name another")
    if made != model.manifest.identity:
        other = f"the model {made}, not {model.manifest.identity}"
        raise FormatError(file, f"this index was made by {other}: remove it, or name another")
    if vectors.shape != (sum(len(member.windows) for member in members), model.sizes["E"]):
        raise FormatError(file, "this index is damaged: its vectors are not those of its windows; remove it")
    return Index(model, folder, members, vectors.astype(np.float32, copy=False), (), unit, shard)


def _member(path: str, size: int, changed: int, windows: Any, fault: str, clip: str, in_place: bool) -> Member:
    spans = tuple((float(start), float(stop)) for start, stop in windows)
    return Member(str(path), int(size), int(changed), spans, str(fault), str(clip), bool(in_place))
