"""Parts of a corpus's answers, each written by one of many processes or machines, and merged in the end.

A part is a file of JSON lines such as ``describe.3-of-16.jsonl``: first what its answers depend on, then an answer for
each motion of every 16th file from the third: the number of the file, input, hash (SHA-256 of the file), error and
rows. It is called ``.partial`` until it is complete; a second call goes on where the first one stopped.
"""

import errno
import hashlib
import heapq
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from motet.corpus.answers import Answer, to_json
from motet.corpus.sources import Source, size_of
from motet.errors import FormatError, OutputError
from motet.files import replacing
from motet.jobs import Shard

if sys.platform != "win32":
    import fcntl

ROWS = 10_000
"""Answers of one row group of a Parquet file."""


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of the names and sizes of files, by which all parts know that they are of one corpus."""
    found = hashlib.sha256()
    for file in files:
        found.update(f"{file}\0{size_of(file)}\n".encode(errors="surrogateescape"))
    return found.hexdigest()


@dataclass(frozen=True)
class Part:
    """A part in a folder, with what its answers depend on, among it the verb and the shard."""

    folder: Path
    about: Mapping[str, Any]

    @property
    def path(self) -> Path:
        """Its file, once it is complete."""
        name = f"{self.about['verb'].lower()}.{self.about['shard'].replace('/', '-of-')}.jsonl"
        return self.folder / name

    def complete(self) -> bool:
        """Whether it is; OutputError where what is there was made of or by something else."""
        if not self.path.exists():
            return False
        with self.path.open("rb") as file:
            self._check(file.readline(), self.path)
        return True

    def write(self, sources: Sequence[Source], answers: Callable[[Sequence[Source]], Iterator[Answer]]) -> None:
        """Write the answers of all sources, but for those that it has; then it is complete.

        answers: gives the answers of sources, in order. OutputError where it cannot be written, as where the disk is
        full: what it has is kept. Also where another process is writing it.
        """
        partial = self.path.with_suffix(".jsonl.partial")
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            with _locked(partial) as file:
                if self.complete():  # by who had the lock
                    return
                rest = sources[self._kept(file, partial) :]
                for answer in answers(rest):
                    _append(file, _line(answer))
                os.fsync(file)
                partial.replace(self.path)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            kept = "; the answers before are kept, and the same command goes on after them"
            raise OutputError(f"cannot write {partial}: {error.strerror or error}{kept}") from error

    def _kept(self, file: Any, path: Path) -> int:
        """How many answers it has; what was being written when it was stopped is cut off."""
        file.seek(0)
        lines = [line for line in file if line.endswith(b"\n")]
        file.truncate(sum(map(len, lines)))
        file.seek(0, os.SEEK_END)
        if not lines:
            _append(file, json.dumps(dict(self.about)))
            return 0
        self._check(lines[0], path)
        return len(lines) - 1

    def _check(self, line: bytes, path: Path) -> None:
        if different := _different(self.about, json.loads(line)):
            said = f"it was begun with another {different}: remove it, or name another folder"
            raise OutputError(f"cannot go on with {path}: {said}")


def failures(path: Path) -> tuple[int, int]:
    """How many answers a part has, and how many of them are errors."""
    with path.open(encoding="utf-8") as file:
        next(file)
        errors = [bool(json.loads(line)["error"]) for line in file]
    return len(errors), sum(errors)


def _line(answer: Answer) -> str:
    about = {"file": answer.source.number, "input": str(answer.source), "hash": answer.hash}
    return to_json({**about, "error": answer.error, "rows": answer.rows})


def _append(file: Any, line: str) -> None:
    data = line.encode() + b"\n"
    if file.write(data) < len(data):  # unbuffered: a disk that gets full takes a piece of it
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@contextmanager
def _locked(path: Path) -> Iterator[Any]:
    """A file to read and append to, of this process alone; the lock goes with the process."""
    with path.open("a+b", buffering=0) as file:
        if sys.platform != "win32":
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise OutputError(f"cannot write {path}: another process is writing it") from error
        yield file


def _different(one: Mapping[str, Any], other: Mapping[str, Any]) -> str:
    """What two parts differ in, by name."""
    return ", ".join(sorted(key for key in {*one, *other} if one.get(key) != other.get(key)))


def merge(given: Sequence[Path], out: Path) -> int:
    """Merge all parts of a corpus, files or the folders that they are in, into one file; how many answers it has.

    out: ``.jsonl``, the same bytes as of one part for all; ``.parquet`` with the columns path, hash, answer (rows as
    JSON) and error, which needs the extra ``scale``; or ``.npy``, the vectors (N, C) float32 of rows that have one.
    FormatError for parts that are missing, not complete, or made of or by different things.
    """
    writers = {".jsonl": _write_lines, ".parquet": _write_parquet, ".npy": _write_vectors}
    if out.suffix.lower() not in writers:
        raise OutputError(f"cannot write {out}: parts are merged into {' '.join(writers)}")
    parts = _complete(given)
    with replacing(out) as temporary:
        return writers[out.suffix.lower()](parts, temporary)


def _complete(given: Sequence[Path]) -> list[Path]:
    """All parts of one corpus, in order."""
    paths = [one for path in given for one in (sorted(path.glob("*.jsonl*")) if path.is_dir() else [path])]
    if not paths:
        raise FormatError(given[0], "no parts (.jsonl) are in it")
    found: dict[str, Path] = {}
    first: dict[str, Any] = {}
    for path in paths:
        about = _about(path)
        if path.suffix == ".partial":
            raise FormatError(path, f"it is not complete: run the command with --shard {about['shard']} again")
        shard = about.pop("shard")
        first = first or about
        if different := _different(about, first):
            than = f"it was made with another {different} than {next(iter(found.values()))}"
            raise FormatError(path, f"{than}: remove one, and run its command with --shard again")
        found[shard] = path
    count = Shard.parse(shard).count
    wanted = [str(Shard(number, count)) for number in range(1, count + 1)]
    if missing := [one for one in wanted if one not in found] or sorted(found.keys() - set(wanted)):
        said = f"these shards are missing or of another count: {', '.join(missing[:9])}"
        raise FormatError(paths[0].parent, f"{said}; run the command with --shard for each")
    return [found[one] for one in wanted]


def _about(path: Path) -> dict[str, Any]:
    try:
        with path.open(encoding="utf-8") as file:
            found: dict[str, Any] = json.loads(file.readline())
        Shard.parse(found["shard"])
        return found
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(path, f"not a part of a corpus's answers: {error}") from error


def _lines(parts: Sequence[Path]) -> Iterator[str]:
    """The answers of all parts in the order of their files, one of each in memory."""

    def of(path: Path) -> Iterator[str]:
        with path.open(encoding="utf-8") as file:
            next(file)
            yield from file

    return heapq.merge(*map(of, parts), key=lambda line: int(line[line.index(":") + 1 : line.index(",")]))


def _write_lines(parts: Sequence[Path], out: Path) -> int:
    with out.open("w", encoding="utf-8", newline="\n") as file:
        file.write(json.dumps({**_about(parts[0]), "shard": str(Shard())}) + "\n")
        return sum(bool(file.write(line)) for line in _lines(parts))


def _write_parquet(parts: Sequence[Path], out: Path) -> int:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise OutputError("Parquet needs pyarrow: pip install 'motet[scale]'") from error
    columns, count = {"path": "input", "hash": "hash", "answer": "rows", "error": "error"}, 0
    answers = ({**one, "rows": json.dumps(one["rows"])} for one in map(json.loads, _lines(parts)))
    schema = pa.schema([(name, pa.string()) for name in columns])
    with pq.ParquetWriter(out, schema) as writer:
        while batch := list(islice(answers, ROWS)):
            table = {name: [one[key] for one in batch] for name, key in columns.items()}
            writer.write_table(pa.table(table, schema=schema))
            count += len(batch)
    return count


def _write_vectors(parts: Sequence[Path], out: Path) -> int:
    def vectors() -> Iterator[Any]:
        for one in map(json.loads, _lines(parts)):
            yield from (row["vector"] for row in one["rows"] if "vector" in row)

    first = next(vectors(), None)
    if first is None:
        raise OutputError("cannot write vectors: the parts have none; they are written by motet embed")
    size = sum(1 for _ in vectors()), len(first)
    found = np.lib.format.open_memmap(out, "w+", np.float32, size)
    for row, vector in zip(found, vectors(), strict=True):
        row[:] = vector
    found.flush()
    return size[0]
