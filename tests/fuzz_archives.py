"""Mutated zips of motions and parts of answers: only motet's own errors come out, soon and in little memory.

A zip reads nothing of its host, and what is merged is whole.

    python tests/fuzz_archives.py --count 5000 [--seed N] [--first N] [--seconds 2] [--megabytes 500]

Of zips, bytes, names, fields of the tables and the motions in them are altered. Each is listed, unpacked, read, and
opened as a corpus for training. Of parts, bytes, lines and values are altered. They are counted and merged, and gone on
with as if their writer had been stopped.
"""

import io
import json
import os
import stat
import struct
import sys
import warnings
import zipfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache, partial
from pathlib import Path

from fuzzing import NASTY, Files, Generator, Mutant, altered, damaged, fuzz, options

import motet
from motet.corpus.answers import Answer
from motet.corpus.parts import Part, failures, merge
from motet.corpus.sources import Source, files_of, opened, size_of
from motet_train.data.archive import Archive

CLIPS = Path(__file__).parents[1] / "train" / "motet_train" / "data" / "cmu"
PRIVATE = "private.bvh"
"""A motion beside the zip, which is none of its own."""

STRANGE = [
    str(CLIPS / "39_14.amc"), "../private.bvh", "../../private.bvh", "a/../../private.bvh", "./private.bvh", "//x.bvh",
    "/private.bvh", "C:/private.bvh", "..\\private.bvh", "a\0.bvh", "a\n.bvh", ".a.bvh", "a/.b/c.bvh", "__MACOSX/a.bvh",
    "a.bvh/", "a.bvh", "a.bvh/b.bvh", "a.bvh#x.bvh", "b.zip/a.bvh", "x" * 300 + ".bvh", "http://localhost:9/a.bvh", "",
    "\u202e.bvh", "con.bvh", "a b/c.amc",
]  # fmt: skip
"""What stands in the place of a name."""

ENTRY = {6: "H", 8: "H", 10: "H", 16: "L", 20: "L", 24: "L", 28: "H", 30: "H", 32: "H", 38: "L", 42: "L"}
LOCAL = {6: "H", 8: "H", 14: "L", 18: "L", 22: "L", 26: "H", 28: "H"}
END = {4: "H", 6: "H", 8: "H", 10: "H", 12: "L", 16: "L", 20: "H"}
FIELDS = {b"PK\x01\x02": ENTRY, b"PK\x03\x04": LOCAL, b"PK\x05\x06": END}
"""Of the records of a zip the places and sizes of their numbers."""

HEAD = {"verb": "Count", "files": 6, "shard": "1/2", "answers": 4}


def mutate(rng: Generator) -> Mutant:
    """A mutant of either kind; the file that is opened first."""
    return _zip(rng) if rng.random() < 0.5 else _parts(rng)


def _zip(rng: Generator) -> Mutant:
    members, kind = list(motions()), str(rng.choice(["bytes", "names", "fields", "motions", "bomb", "links"]))
    place = int(rng.integers(len(members)))
    name, content = members[place]
    mode = stat.S_IFREG | 0o644
    if kind == "names":
        members += [(STRANGE[int(rng.integers(len(STRANGE)))], content) for _ in range(3)]
    elif kind == "motions":
        members[place] = name, damaged(rng, content)
    elif kind == "bomb":
        members[place] = name, content + bytes(int(rng.integers(1 << 25)))
    elif kind == "links":
        members[place] = name, rng.choice(STRANGE).encode()
        mode = int(rng.choice([stat.S_IFLNK, stat.S_IFDIR, stat.S_IFIFO, stat.S_IFCHR])) | 0o777
    data = _packed(members, mode)
    if kind == "bytes":
        data = damaged(rng, data)
    elif kind in ("fields", "bomb"):
        data = _with_other_fields(rng, data)
    return f"zip, {kind}", {"c.zip": data, PRIVATE: private()}


@cache
def motions() -> tuple[tuple[str, bytes], ...]:
    """Files of a corpus, by name."""
    motion, found = motet.read(CLIPS / "39_14.amc")[:5], []
    for kind in ("bvh", "npz", "amc"):
        buffer = io.BytesIO()
        if kind != "amc":
            motet.write(buffer, motion, format=kind)
            found.append((f"walks/a.{kind}", buffer.getvalue()))
    amc = (CLIPS / "39_14.amc").read_bytes().replace(b"\r\n", b"\n")
    amc = amc[: amc.index(b"\n6\n") + 1]
    return (*found, ("amc/39_14.amc", amc), ("amc/39.asf", (CLIPS / "39_14.asf").read_bytes()), ("a.txt", b"-"))


@cache
def private() -> bytes:
    """The motion beside the zip."""
    buffer = io.BytesIO()
    motet.write(buffer, motet.read(CLIPS / "39_14.amc")[7:10], format="bvh")
    return buffer.getvalue()


def _packed(members: Sequence[tuple[str, bytes]], mode: int) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        warnings.simplefilter("ignore")  # of names that are there twice
        for name, content in members:
            info = zipfile.ZipInfo("x")
            info.filename = name  # as it is, where the constructor would mend it
            info.external_attr = mode << 16
            info.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(info, content)
    return buffer.getvalue()


def _with_other_fields(rng: Generator, data: bytes) -> bytes:
    """A zip with one to three numbers of its records replaced."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 4))):
        signature = list(FIELDS)[int(rng.integers(len(FIELDS)))]
        places = [place for place in range(len(data)) if data.startswith(signature, place)]
        offset, size = list(FIELDS[signature].items())[int(rng.integers(len(FIELDS[signature])))]
        place = places[int(rng.integers(len(places)))] + offset
        largest = 0xFFFF if size == "H" else 0xFFFFFFFF
        values = [0, 1, 8, 9, 12, 99, 1000, 0x06054B50, largest - 1, largest, int(rng.integers(1 << 32))]
        value = int(rng.choice(values))
        struct.pack_into(f"<{size}", found, place, value & largest)
    return bytes(found)


def _parts(rng: Generator) -> Mutant:
    names = "count.1-of-2.jsonl", "count.2-of-2.jsonl"
    files: Files = {name: "".join(lines_of(number)).encode() for number, name in enumerate(names)}
    name, kind = str(rng.choice(names)), str(rng.choice(["bytes", "lines", "values", "names"]))
    lines = lines_of(names.index(name))
    place, other = (int(number) for number in rng.integers(len(lines), size=2))
    if kind == "bytes":
        files[name] = damaged(rng, files[name])
    elif kind == "names":
        called = str(rng.choice(["count.1-of-2.jsonl.partial", "count.3-of-2.jsonl", "a.jsonl", "count.2-of-2.jsonl"]))
        files[called] = files.pop(name)
    elif kind == "values":
        document = json.loads(lines[place])
        altered(rng, document)
        lines[place] = json.dumps(document) + "\n"
        files[name] = "".join(lines).encode()
    else:
        changed = [*lines]
        how = int(rng.integers(5))
        if how == 0:
            del changed[place]
        elif how == 1:
            changed.insert(place, lines[other])
        elif how == 2:
            changed[place], changed[other] = lines[other], lines[place]
        elif how == 3:
            changed[place] = lines[place][: int(rng.integers(len(lines[place])))]
        else:
            changed[place] = str(NASTY[int(rng.integers(len(NASTY)))])[:200] + "\n"
        files[name] = "".join(changed).encode("utf-8", "replace")
    return f"parts, {kind}", dict(sorted(files.items()))


def lines_of(number: int) -> list[str]:
    """Those of a part: its head, and an answer of each file of every second, two of one that has two clips."""
    head = {**HEAD, "shard": f"{number + 1}/2", "answers": 4 if number == 0 else 3}
    found = [json.dumps(head) + "\n"]
    for source in sources_of(number):
        rows = [{"vector": [0.5, source.number]}]
        answer = {"file": source.number, "input": str(source), "hash": "", "error": "", "rows": rows}
        found.append(json.dumps(answer) + "\n")
    return found


def sources_of(number: int) -> list[Source]:
    """What a part has answers of."""
    found = [Source(Path(f"{file}.glb"), number=file) for file in range(number, 6, 2)]
    return [*found, Source(Path("4.glb"), "Walk", number=4)] if number == 0 else found


def steps(path: Path) -> Iterator[Callable[[], object]]:
    """What is tried with a mutant."""
    return _of_zip(path) if path.suffix == ".zip" else _of_parts(path.parent)


def _of_zip(path: Path) -> Iterator[Callable[[], object]]:
    files: list[Path] = []
    yield lambda: files.extend(files_of([path]))
    for file in files[:8]:
        yield partial(_unpack, path, file)
        yield Source(file).read
        yield partial(size_of, file)
    yield partial(_train, path)


def _unpack(archive: Path, file: Path) -> None:
    """Unpack a file; AssertionError where that reads or leaves something outside of the zip."""
    before = sorted(archive.parent.iterdir())
    with opened(file) as place:
        content = place.read_bytes()
        assert "motet-" in str(place), "the file is not in a folder of its own"
        assert content not in (private(), (CLIPS / "39_14.amc").read_bytes()), "a file of the host was read"
    assert not place.exists(), "something is left"
    assert sorted(archive.parent.iterdir()) == before, "something was written beside the zip"


def _train(path: Path) -> None:
    with Archive(path) as archive:
        for name in archive.names[:8]:
            with suppress(motet.MotetError), archive.opened(name) as place:
                assert place.read_bytes() != private(), "a file of the host was read"


def _of_parts(folder: Path) -> Iterator[Callable[[], object]]:
    out = folder / "out"
    for path in sorted(folder.iterdir()):
        yield partial(failures, path)
    out.mkdir()
    yield partial(_merge, [folder], out / "all.jsonl")
    yield partial(merge, [folder], out / "all.npy")
    yield partial(_go_on, folder)


def _merge(parts: Sequence[Path], out: Path) -> None:
    """Merge; AssertionError where something is lost, doubled or out of order."""
    merge(parts, out)
    head, *answers = (json.loads(line) for line in out.read_text(encoding="utf-8").splitlines())
    files = [answer["file"] for answer in answers]
    assert files == sorted(files), "out of order"
    assert set(files) == set(range(head["files"])), "lost"
    assert len({(answer["file"], answer["input"]) for answer in answers}) == head["answers"] == len(answers), "doubled"


def _go_on(folder: Path) -> None:
    """Complete the first part as if its writer had been stopped, and merge it with the second as it was."""
    again = folder / "again"
    again.mkdir()
    mutant = next(path for path in sorted(folder.iterdir()) if path.is_file())
    os.link(mutant, again / "count.1-of-2.jsonl.partial")
    about = {name: value for name, value in HEAD.items() if name != "answers"}
    sources = sources_of(0)
    part = Part(again, about)
    part.write(sources, lambda rest: (Answer(source, [{"vector": [0.5, source.number]}]) for source in rest))
    (again / "count.2-of-2.jsonl").write_text("".join(lines_of(1)))
    _merge([again], folder / "out" / "again.jsonl")


if __name__ == "__main__":
    sys.exit(fuzz(options(__doc__).parse_args(), mutate, steps))
