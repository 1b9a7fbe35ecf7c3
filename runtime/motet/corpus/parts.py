"""Parts of a corpus's answers, each written by one of many processes or machines, and merged in the end.

A part is a file of JSON lines such as ``describe.3-of-16.jsonl``: first what its answers depend on and how many they
are, then an answer for each motion of every 16th file from the third: the number of the file, input, hash (SHA-256 of
the file), error and rows. It is called ``.partial`` until it is complete; a second call goes on where the first one
stopped.
"""

import errno
import hashlib
import heapq
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from motet.corpus.answers import Answer, to_json
from motet.corpus.sources import Source, size_of
from motet.errors import FormatError, OutputError
from motet.files import Json, replacing
from motet.formats.text import ContentError, naming
from motet.jobs import Shard

if sys.platform != "win32":
    import fcntl

MOST_ITEMS = 10**9
"""Files and answers that a part may say it is of."""


LONGEST_LINE = 64 << 20
"""Bytes of a line that is read: of a thousand times the rows that any answer has."""

ROWS = 10_000
"""Answers of one row group of a Parquet file."""


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of the names and sizes of files, by which all parts know that they are of one corpus."""
    digest = hashlib.sha256()
    for file in files:
        digest.update(f"{file}\0{size_of(file)}\n".encode(errors="surrogateescape"))
    return digest.hexdigest()


@dataclass(frozen=True)
class Part:
    """A part in a folder, with what its answers depend on, among it the verb and the shard."""

    folder: Path
    about: Json

    @property
    def path(self) -> Path:
        """Its file, once it is complete."""
        name = f"{self.about['verb'].lower()}.{self.about['shard'].replace('/', '-of-')}.jsonl"
        return self.folder / name

    def complete(self) -> bool:
        """Whether it is; OutputError where what is there was made of or by something else."""
        if not self.path.exists():
            return False
        self._check(_head(self.path), self.path)
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
                rest = sources[self._kept(file, partial, sources) :]
                for answer in answers(rest):
                    _append(file, _line(answer))
                os.fsync(file)
                partial.replace(self.path)
        except OSError as error:
            if isinstance(error, OutputError):
                raise
            kept = "; the answers before are kept, and the same command goes on after them"
            raise OutputError(f"cannot write {partial}: {error.strerror or error}{kept}") from error

    def _kept(self, file: Any, path: Path, sources: Sequence[Source]) -> int:
        """How many answers it has; what was being written when it was stopped is cut off. OutputError where they are
        not those of the first sources."""
        file.seek(0)
        # a line without an end was being written
        lines = [line for line in file if line.endswith(b"\n")]
        file.truncate(sum(map(len, lines)))
        file.seek(0, os.SEEK_END)
        if not lines:
            _append(file, json.dumps({**self.about, "answers": len(sources)}))
            return 0
        # the part is of the same work
        with naming(path):
            self._check(_checked_head(lines[0]), path)
        # and each answer is that of its motion
        kept = lines[1:]
        for number, (line, source) in enumerate(zip(kept, sources, strict=False), start=2):
            with naming(path):
                answer = _checked_answer(line, number)
            if (answer["file"], answer["input"]) != (source.number, str(source)):
                raise OutputError(
                    f"cannot go on with {path}, line {number}: expected the answer of {source}: remove it"
                )
        if len(kept) > len(sources):
            raise OutputError(f"cannot go on with {path}: it has more answers than there are motions: remove it")
        return len(kept)

    def _check(self, head: Json, path: Path) -> None:
        if different := _different(self.about, {key: value for key, value in head.items() if key != "answers"}):
            reason = f"it was begun with another {different}: remove it, or name another folder"
            raise OutputError(f"cannot go on with {path}: {reason}")


def failures(path: Path) -> tuple[int, int]:
    """How many answers a part has, and how many of them are errors; FormatError where it is damaged."""
    errors = [bool(answer["error"]) for _, answer in _answers(path)]
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


def _different(row: Json, other: Json) -> str:
    """What two parts differ in, by name."""
    return ", ".join(sorted(key for key in {*row, *other} if row.get(key) != other.get(key)))


def merge(paths: Sequence[Path], out: Path) -> int:
    """Merge all parts of a corpus, files or the folders that they are in, into one file; how many answers it has.

    out: ``.jsonl``, the same bytes as of one part for all; ``.parquet`` with the columns path, hash, answer (rows as
    JSON) and error, which needs the extra ``scale``; or ``.npy``, the vectors (N, C) float32 of rows that have one.
    FormatError for parts that are missing, not complete, or made of or by different things.
    """
    writers = {".jsonl": _write_lines, ".parquet": _write_parquet, ".npy": _write_vectors}
    if out.suffix.lower() not in writers:
        raise OutputError(f"cannot write {out}: parts are merged into {' '.join(writers)}")
    parts = _complete(paths)
    with replacing(out) as temporary:
        return writers[out.suffix.lower()](parts, temporary)


def _complete(folders: Sequence[Path]) -> list[Path]:
    """All parts of one corpus, in order."""
    by_shard = _by_shard(_part_files(folders))
    parts = list(by_shard.values())
    count = Shard.parse(next(iter(by_shard))).count
    expected = [str(Shard(number, count)) for number in range(1, count + 1)]
    missing = [name for name in expected if name not in by_shard]
    if wrong := missing or sorted(by_shard.keys() - set(expected)):
        reason = f"these shards are missing or of another count: {', '.join(wrong[:9])}"
        raise FormatError(parts[0].parent, f"{reason}; run the command with --shard for each")
    return [by_shard[name] for name in expected]


def _part_files(folders: Sequence[Path]) -> list[Path]:
    """The files of parts, of folders all in them."""
    paths = []
    for path in folders:
        paths += sorted(path.glob("*.jsonl*")) if path.is_dir() else [path]
    if not paths:
        raise FormatError(folders[0], "no parts (.jsonl) are in it")
    return paths


def _by_shard(paths: Sequence[Path]) -> dict[str, Path]:
    """Complete parts that were made alike, by their shards."""
    by_shard: dict[str, Path] = {}
    first: Json = {}
    for path in paths:
        about = _head(path)
        if path.suffix == ".partial":
            raise FormatError(path, f"it is not complete: run the command with --shard {about['shard']} again")
        shard = about.pop("shard")
        del about["answers"]
        first = first or about
        if different := _different(about, first):
            than = f"it was made with another {different} than {next(iter(by_shard.values()))}"
            raise FormatError(path, f"{than}: remove one, and run its command with --shard again")
        if shard in by_shard:
            raise FormatError(path, f"it is the same shard as {by_shard[shard]}: remove one")
        by_shard[shard] = path
    return by_shard


def _head(path: Path) -> Json:
    """What a part's answers depend on, the shard and their number; FormatError where it is no part."""
    try:
        with naming(path), path.open("rb") as file:
            return _checked_head(file.readline(LONGEST_LINE))
    except OSError as error:
        raise FormatError(path, f"cannot be read: {error.strerror or error}") from error


def _checked_head(line: bytes) -> Json:
    head = _parsed(line, 1)
    numbers = [head.get(name) for name in ("files", "answers")]
    counted = all(type(number) is int and 0 <= number <= MOST_ITEMS for number in numbers)
    try:
        if not counted or not isinstance(head.get("verb"), str):
            raise ValueError("it does not say its verb, and how many files and answers it is of")
        Shard.parse(str(head.get("shard")))
    except ValueError as error:
        raise ContentError(f"not a part of a corpus's answers: {error}", 1) from error
    return head


def _checked_answer(line: bytes, number: int) -> Json:
    """The answer of a line; FormatError for one that is cut or no answer."""
    answer = _parsed(line, number)
    rows = answer.get("rows")
    error = answer.get("error")
    if (
        type(answer.get("file")) is not int
        or not isinstance(answer.get("input"), str)
        or not isinstance(answer.get("hash"), str)
        or "error" not in answer
        or not (error is None or isinstance(error, str))
        or not (isinstance(rows, list) and all(isinstance(row, dict) for row in rows))
    ):
        raise ContentError("expected an answer: file, input, hash, error and rows", number)
    return answer


def _parsed(line: bytes, number: int) -> Json:
    if not line.endswith(b"\n"):
        reason = "the line is cut" if len(line) < LONGEST_LINE else f"the line has more than {LONGEST_LINE} bytes"
        raise ContentError(f"not a part of a corpus's answers: {reason}", number)
    try:
        parsed = json.loads(line.decode())  # as UTF-8: json would take other encodings, too
    except (ValueError, RecursionError) as error:
        raise ContentError(f"not a part of a corpus's answers: {error}", number) from error
    if not isinstance(parsed, dict):
        raise ContentError("not a part of a corpus's answers: expected a JSON object", number)
    return parsed


class _Order:
    """Which answers a part is to have: of each of its shard's files, in order, as many in all as its head says."""

    def __init__(self, head: Json) -> None:
        shard = Shard.parse(head["shard"])
        self.files = range(shard.number - 1, head["files"], shard.count)
        self.count = head["answers"]
        self.begun = 0  # files
        self.inputs: set[str] = set()  # of the last of them
        self.line = 1

    def take(self, answer: Json) -> None:
        """The next answer: of another clip of the same file, or of the next file. FormatError for any other."""
        self.line += 1
        file = answer["file"]
        name = answer["input"]
        if self.begun and file == self.files[self.begun - 1]:
            if name in self.inputs:
                raise ContentError(f"the answer of {name} is there twice", self.line)
        elif self.begun < len(self.files) and file == self.files[self.begun]:
            self.begun += 1
            self.inputs.clear()
        else:
            wanted = self.files[self.begun] if self.begun < len(self.files) else "no more"
            raise ContentError(f"expected the answer of file {wanted}, not of {file}", self.line)
        self.inputs.add(name)

    def end(self) -> None:
        """FormatError where answers are missing."""
        if self.begun < len(self.files):
            reason = f"the answer of file {self.files[self.begun]} is missing: run the command again"
            raise ContentError(reason, self.line + 1)
        if self.line - 1 != self.count:
            reason = f"it has {self.line - 1} answers instead of {self.count}: run the command again"
            raise ContentError(reason, self.line)


def _answers(path: Path) -> Iterator[tuple[str, Json]]:
    """The answers of a part, with their lines. FormatError where one is cut, twice, missing or out of order."""
    with naming(path), path.open("rb") as file:
        order = _Order(_checked_head(file.readline(LONGEST_LINE)))
        while line := file.readline(LONGEST_LINE):
            answer = _checked_answer(line, order.line + 1)
            order.take(answer)
            yield line.decode(), answer
        order.end()


def _in_order(parts: Sequence[Path]) -> Iterator[tuple[str, Json]]:
    """The answers of all parts in the order of their files, one of each in memory."""
    return heapq.merge(*map(_answers, parts), key=lambda pair: int(pair[1]["file"]))


def _write_lines(parts: Sequence[Path], out: Path) -> int:
    heads = [_head(part) for part in parts]
    head = {**heads[0], "shard": str(Shard()), "answers": sum(int(each["answers"]) for each in heads)}
    count = 0
    with out.open("w", encoding="utf-8", newline="\n") as file:
        file.write(json.dumps(head) + "\n")
        for line, _ in _in_order(parts):
            file.write(line)
            count += 1
    return count


def _write_parquet(parts: Sequence[Path], out: Path) -> int:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise OutputError("Parquet needs pyarrow: pip install 'motet[scale]'") from error
    columns = {"path": "input", "hash": "hash", "answer": "rows", "error": "error"}
    count = 0
    answers = ({**answer, "rows": json.dumps(answer["rows"])} for _, answer in _in_order(parts))
    schema = pa.schema([(name, pa.string()) for name in columns])
    with pq.ParquetWriter(out, schema) as writer:
        while batch := list(islice(answers, ROWS)):
            table = {}
            for name, key in columns.items():
                table[name] = [row[key] for row in batch]
            writer.write_table(pa.table(table, schema=schema))
            count += len(batch)
    return count


def _write_vectors(parts: Sequence[Path], out: Path) -> int:
    first: list[Any] = []
    count = 0
    for answer, vector in _vectors(parts):
        first = first or vector
        # a larger number is none in float32
        numbers = all(isinstance(value, int | float) and abs(value) <= 3e38 for value in vector)
        if not numbers or len(vector) != len(first):
            raise FormatError(answer["input"], f"its vector is not of {len(first)} numbers: run its command again")
        count += 1
    if not first:
        raise OutputError("cannot write vectors: the parts have none; they are written by motet embed")
    vectors = np.lib.format.open_memmap(out, "w+", np.float32, (count, len(first)))
    for row, (_, vector) in zip(vectors, _vectors(parts), strict=True):
        row[:] = vector
    vectors.flush()
    return count


def _vectors(parts: Sequence[Path]) -> Iterator[tuple[Json, list[Any]]]:
    """The vectors of rows that have one, with the answer that each is of."""
    for _, answer in _in_order(parts):
        for row in answer["rows"]:
            if "vector" in row:
                vector = row["vector"]
                yield answer, vector if isinstance(vector, list) and vector else [None]
