"""Parts of a corpus's answers: whatever stops or disturbs them, what is merged is what one process writes."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

import motet
from motet.cli.many import Many
from motet.cli.reading import Read
from motet.corpus.answers import Answer, Verb
from motet.corpus.parts import Part, failures, merge
from motet.corpus.sources import Source
from motet.jobs import Shard


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory, clips: Path) -> Path:
    """Seven motions, one of them broken."""
    place = tmp_path_factory.mktemp("corpus")
    walk = motet.to_humanoid(motet.read(clips / "39_14.amc")).motion
    for number in range(7):
        motet.write(place / f"{number}.npz", walk[10 * number : 150 + 5 * number])
    (place / "3.npz").write_text("hello")
    return place


@pytest.fixture(scope="module")
def whole(corpus: Path, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """What one process writes of it."""
    place = tmp_path_factory.mktemp("whole")
    assert run("embed", corpus, "--parts", place).exit_code == 1
    return (place / "embed.1-of-1.jsonl").read_bytes()


def shards(corpus: Path, parts: Path, count: int = 3) -> None:
    for number in range(1, count + 1):
        run("embed", corpus, "--parts", parts, "--shard", f"{number}/{count}")


def test_merged_shards_are_the_bytes_of_one_part(corpus: Path, whole: bytes, tmp_path: Path) -> None:
    shards(corpus, tmp_path / "parts")
    result = run("merge", tmp_path / "parts", "-o", tmp_path / "all.jsonl")
    assert result.stdout == f"{tmp_path / 'all.jsonl'}: 7 answers\n"
    assert (tmp_path / "all.jsonl").read_bytes() == whole
    _, *answers = map(json.loads, whole.splitlines())
    files = sorted(corpus.iterdir())
    assert [answer["input"] for answer in answers] == list(map(str, files))
    assert [answer["hash"] for answer in answers] == [sha256(file.read_bytes()).hexdigest() for file in files]
    assert [bool(answer["error"]) for answer in answers] == [file.stem == "3" for file in files]


def test_merged_vectors_are_those_that_embed_writes(corpus: Path, tmp_path: Path) -> None:
    shards(corpus, tmp_path / "parts")
    run("merge", tmp_path / "parts", "-o", tmp_path / "merged.npy")
    run("embed", corpus, "-o", tmp_path / "all.npy")
    np.testing.assert_array_equal(np.load(tmp_path / "merged.npy"), np.load(tmp_path / "all.npy"))


def test_a_second_call_skips_what_is_done(corpus: Path, tmp_path: Path) -> None:
    first = run("embed", corpus, "--parts", tmp_path, "--shard", "1/2")
    path = tmp_path / "embed.1-of-2.jsonl"
    changed = path.stat().st_mtime_ns
    second = run("embed", corpus, "--parts", tmp_path, "--shard", "1/2")
    assert first.stdout == f"{path}: 4 motions, 0 failed\n"
    assert second.stdout == f"{path}: was complete already: 4 motions, 0 failed\n"
    assert path.stat().st_mtime_ns == changed


@pytest.mark.parametrize("kept", [0, 40, 1000, 1007, -9, -1])
def test_what_was_stopped_anywhere_goes_on_to_the_same_bytes(
    corpus: Path, whole: bytes, kept: int, tmp_path: Path
) -> None:
    (tmp_path / "embed.1-of-1.jsonl.partial").write_bytes(whole[:kept])
    run("embed", corpus, "--parts", tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["embed.1-of-1.jsonl"]
    assert (tmp_path / "embed.1-of-1.jsonl").read_bytes() == whole


@dataclass(frozen=True)
class Count(Verb):
    """Says which motions were asked for, after a while."""

    seconds: float = 0.0

    def rows(self, answer: Answer) -> list[Any]:
        time.sleep(self.seconds)
        return [{"name": answer.source.name}]


def part(folder: Path, files: int = 6, shard: str = "1/1") -> Part:
    return Part(folder, {"verb": "Count", "files": files, "shard": shard})


def test_only_what_is_missing_is_done_again(tmp_path: Path) -> None:
    sources, asked = [Source(Path(f"{number}.bvh"), number=number) for number in range(6)], list[int]()

    def some(rest: Sequence[Source]) -> Iterator[Answer]:
        asked.append(len(rest))
        yield from Count({})(rest[:4])
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        part(tmp_path).write(sources, some)

    def others(rest: Sequence[Source]) -> Iterator[Answer]:
        asked.append(len(rest))
        yield from Count({})(rest)

    part(tmp_path).write(sources, others)
    assert asked == [6, 2]
    assert failures(tmp_path / "count.1-of-1.jsonl") == (6, 0)


def test_two_jobs_do_not_write_one_part(tmp_path: Path) -> None:
    def both(rest: Sequence[Source]) -> Iterator[Answer]:
        with pytest.raises(motet.OutputError, match="another process is writing it"):
            part(tmp_path, 1).write(sources, both)
        yield from Count({})(rest)

    sources = [Source(Path("a.bvh"))]
    part(tmp_path, 1).write(sources, both)
    assert part(tmp_path, 1).complete()


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of files there")
def test_a_full_disk_keeps_what_was_answered(corpus: Path, tmp_path: Path) -> None:
    run("check", corpus, "--parts", tmp_path / "whole")
    whole = (tmp_path / "whole" / "check.1-of-1.jsonl").read_bytes()
    limit = len(whole) // 2
    limited = f"import resource; resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))"
    code = f"{limited}\nfrom motet.cli import main; main()"
    command = [sys.executable, "-c", code, "check", str(corpus), "--parts", str(tmp_path), "--jobs", "1"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    said = done.stderr.splitlines()[-1]
    assert said.startswith(f"motet: cannot write {tmp_path / 'check.1-of-1.jsonl.partial'}: ")
    assert said.endswith("; the answers before are kept, and the same command goes on after them")
    assert 0 < (tmp_path / "check.1-of-1.jsonl.partial").stat().st_size <= limit
    run("check", corpus, "--parts", tmp_path)
    assert (tmp_path / "check.1-of-1.jsonl").read_bytes() == whole


def test_a_killed_command_leaves_a_part_that_goes_on(corpus: Path, whole: bytes, tmp_path: Path) -> None:
    partial = tmp_path / "embed.1-of-1.jsonl.partial"
    command = [sys.executable, "-m", "motet", "embed", str(corpus), "--parts", str(tmp_path), "--jobs", "1"]
    started = subprocess.Popen(command, stderr=subprocess.DEVNULL, env={**os.environ})
    while started.poll() is None and not (partial.exists() and partial.stat().st_size):
        time.sleep(0.01)
    started.kill()
    started.wait()
    run("embed", corpus, "--parts", tmp_path)
    assert (tmp_path / "embed.1-of-1.jsonl").read_bytes() == whole


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda parts: (parts / "embed.2-of-3.jsonl").unlink(), "missing or of another count: 2/3"),
        (
            lambda parts: (parts / "embed.2-of-3.jsonl").rename(parts / "embed.2-of-3.jsonl.partial"),
            "it is not complete: run the command with --shard 2/3 again",
        ),
        (
            lambda parts: (parts / "embed.2-of-3.jsonl").write_text(
                (parts / "embed.2-of-3.jsonl").read_text().replace('"motet": "', '"motet": "9.', 1)
            ),
            "made with another motet than",
        ),
        (lambda parts: (parts / "embed.2-of-3.jsonl").write_text("hello"), "not a part of a corpus's answers"),
        (
            lambda parts: (parts / "embed.4-of-4.jsonl").write_text(
                (parts / "embed.2-of-3.jsonl").read_text().replace("2/3", "4/4", 1)
            ),
            "missing or of another count",
        ),
    ],
)
def test_parts_that_do_not_fit_are_named(spoil: Any, said: str, corpus: Path, tmp_path: Path) -> None:
    shards(corpus, tmp_path / "parts")
    spoil(tmp_path / "parts")
    (tmp_path / "out").mkdir()
    result = run("merge", tmp_path / "parts", "-o", tmp_path / "out" / "all.jsonl")
    assert result.exit_code == 1
    assert said in result.stderr
    assert list((tmp_path / "out").iterdir()) == []


def test_a_part_begun_by_something_else_is_not_gone_on_with(corpus: Path, tmp_path: Path) -> None:
    run("embed", corpus, "--parts", tmp_path)
    result = run("embed", corpus, "--parts", tmp_path, "--unit-in", "cm")
    assert result.exit_code == 2
    assert "it was begun with another reading: remove it, or name another folder" in result.stderr


@dataclass(frozen=True)
class Changing(Verb):
    """Adds a file to a folder while it is at work."""

    folder: str = ""

    def rows(self, answer: Answer) -> list[Any]:
        (Path(self.folder) / "new.bvh").write_text("hello")
        return []


def test_a_corpus_that_changes_under_way_completes_no_part(tmp_path: Path) -> None:
    place, parts = tmp_path / "corpus", tmp_path / "parts"
    place.mkdir()
    (place / "a.bvh").write_text("hello")
    many, verb = Many(Read({}, None), jobs=1, parts=parts), Changing({}, str(place))
    with pytest.raises(motet.OutputError, match=r"changing\.1-of-1\.jsonl: the files that it is of changed") as caught:
        many.write_part(verb, many.sources([place]), [place], "changing")
    assert "remove it, and run the same command again" in str(caught.value)
    assert [path.name for path in parts.iterdir()] == ["changing.1-of-1.jsonl.partial"]
    with pytest.raises(motet.OutputError, match=r"changing.1-of-1.jsonl.partial: it was begun with another corpus"):
        many.write_part(verb, many.sources([place]), [place], "changing")


@pytest.mark.parametrize("text", ["0/3", "4/3", "3", "a/b", "1/0", "-1/3", "1/2/3"])
def test_a_wrong_shard_is_refused(text: str, tmp_path: Path) -> None:
    result = run("check", tmp_path, "--parts", tmp_path, "--shard", text)
    assert result.exit_code == 2
    assert "such as 3/16" in result.stderr


def test_every_file_is_in_one_shard() -> None:
    for count in (1, 2, 3, 7, 12):
        found = [thing for number in range(1, count + 1) for thing in Shard(number, count).of(range(10))]
        assert sorted(found) == list(range(10))


def test_every_verb_writes_parts(corpus: Path, tmp_path: Path) -> None:
    for verb, *options in (("describe",), ("describe", "--timeline"), ("check",), ("convert", "-o", "{name}.bvh")):
        parts = tmp_path / "".join((verb, *options)).replace("{name}.bvh", "")
        given = [str(tmp_path / one) if "{" in one else one for one in options]
        for number in (1, 2):
            assert run(verb, corpus, *given, "--parts", parts, "--shard", f"{number}/2").exit_code == number - 1
        assert merge([parts], tmp_path / "all.jsonl") == 7
    assert len(list(tmp_path.glob("*.bvh"))) == 6


def test_shards_of_convert_need_names_that_differ(corpus: Path, tmp_path: Path) -> None:
    result = run("convert", corpus, "-o", tmp_path / "out.bvh", "--parts", tmp_path, "--shard", "1/2")
    assert (result.exit_code, list(tmp_path.iterdir())) == (2, [])
    assert "{name}" in result.stderr


def test_what_does_not_go_together_is_refused(corpus: Path, tmp_path: Path) -> None:
    assert "give --parts" in run("check", corpus, "--shard", "1/2").stderr
    assert "give --engine ray" in run("check", corpus, "--address", "auto").stderr
    assert ".jsonl .parquet .npy" in run("merge", corpus, "-o", tmp_path / "a.txt").stderr
    assert "no parts" in run("merge", tmp_path, "-o", tmp_path / "a.jsonl").stderr


def answer(file: int, **other: Any) -> str:
    return json.dumps({"file": file, "input": f"{file}.bvh", "hash": "", "error": "", "rows": []} | other) + "\n"


HEAD = '{"verb": "Count", "files": 6, "shard": "1/2", "answers": 3}\n'
FIRST = [HEAD, answer(0), answer(2), answer(4)]
ODD = answer(0, input="\u00e9.bvh").replace("\\u00e9", "\u00e9").encode("utf-16-be").decode(errors="surrogateescape")
"""An answer in another encoding, which ends with a line feed, too."""

TAMPERED = {
    "a line is cut": ([*FIRST[:3], answer(4)[:30]], "line 4: .*the line is cut"),
    "the last line is cut off": (FIRST[:3], "line 4: the answer of file 4 is missing"),
    "a line is missing": ([HEAD, answer(0), answer(4)], "line 3: expected the answer of file 2, not of 4"),
    "a line is doubled": ([*FIRST, answer(4)], "line 5: the answer of 4.bvh is there twice"),
    "lines are in another order": ([HEAD, answer(2), answer(0), answer(4)], "line 2: expected the answer of file 0"),
    "a file of the other shard": ([HEAD, answer(0), answer(1), answer(2), answer(4)], "expected the answer of file 2"),
    "one more file": ([*FIRST, answer(6)], "line 5: expected the answer of file no more, not of 6"),
    "a clip is lost": ([HEAD.replace("3}", "4}"), *FIRST[1:]], "it has 3 answers instead of 4"),
    "the head is a list": (["[]\n", *FIRST[1:]], "line 1: .*expected a JSON object"),
    "the head is a number": (["5\n", *FIRST[1:]], "line 1: .*expected a JSON object"),
    "the head has no counts": ([HEAD.replace("6", '"6"'), *FIRST[1:]], "line 1: .*how many files"),
    "the head has a wild shard": ([HEAD.replace("1/2", "3/2"), *FIRST[1:]], "line 1: .*a shard is a number"),
    "a line is no JSON": ([*FIRST, "garbage\n"], "line 5: not a part"),
    "a line is empty": ([*FIRST, "\n"], "line 5: not a part"),
    "a line is no text": ([*FIRST, "\udcff\udcfe\n"], "line 5: not a part"),
    "a line is nested without end": ([*FIRST, '{"file": 9, "x": ' + "[" * 100_000 + "\n"], "line 5: not a part"),
    "a number is a word": ([HEAD, answer(0).replace("0", "true", 1), *FIRST[2:]], "line 2: expected an answer"),
    "a number has 5,000 digits": ([HEAD, answer(0).replace("0", "9" * 5000, 1), *FIRST[2:]], "line 2: not a part"),
    "a line is in another encoding": ([HEAD, ODD, *FIRST[2:]], "line 2: not a part"),
    "rows are a number": ([HEAD, answer(0, rows=5), *FIRST[2:]], "line 2: expected an answer"),
    "rows are missing": ([HEAD, '{"file": 0, "input": "0.bvh"}\n', *FIRST[2:]], "line 2: expected an answer"),
    "the error is missing": ([HEAD, answer(0).replace("error", "err"), *FIRST[2:]], "line 2: expected an answer"),
}


@pytest.mark.parametrize(("lines", "reason"), TAMPERED.values(), ids=TAMPERED)
def test_what_is_cut_doubled_or_missing_is_named(tmp_path: Path, lines: list[str], reason: str) -> None:
    parts = tmp_path / "parts"
    parts.mkdir()
    second = [HEAD.replace("1/2", "2/2"), answer(1), answer(3), answer(5)]
    (parts / "count.1-of-2.jsonl").write_text("".join(FIRST))
    (parts / "count.2-of-2.jsonl").write_text("".join(second))
    assert merge([parts], tmp_path / "whole.jsonl") == 6
    (parts / "count.1-of-2.jsonl").write_text("".join(lines), errors="surrogateescape")
    result = run("merge", parts, "-o", tmp_path / "all.jsonl")
    assert result.exit_code == 1
    with pytest.raises(motet.FormatError, match=reason) as caught:
        merge([parts], tmp_path / "all.jsonl")
    assert caught.value.path == parts / "count.1-of-2.jsonl"
    assert not (tmp_path / "all.jsonl").exists()


def test_a_shard_that_is_there_twice_is_named(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.jsonl").write_text("".join([HEAD.replace("1/2", "1/1"), *map(answer, range(6))]))
    with pytest.raises(motet.FormatError, match=r"the same shard as .*a\.jsonl: remove one"):
        merge([tmp_path / "a.jsonl", tmp_path / "b.jsonl"], tmp_path / "all.jsonl")


@pytest.mark.parametrize("vector", [[1.0], ["x", "y"], 5, [], [1e39, 1.0], [None, 1.0]])
def test_vectors_of_other_lengths_are_not_merged(tmp_path: Path, vector: Any) -> None:
    rows = [{"vector": [1.0, 2.0]}, {"vector": vector}]
    head = '{"verb": "Embed", "files": 1, "shard": "1/1", "answers": 1}\n'
    (tmp_path / "embed.1-of-1.jsonl").write_text(head + answer(0, rows=rows))
    with pytest.raises(motet.FormatError, match="its vector is not of 2 numbers"):
        merge([tmp_path], tmp_path / "all.npy")
    assert not (tmp_path / "all.npy").exists()


@pytest.mark.parametrize("content", ["garbage\n", "[]\n", HEAD, HEAD + answer(1), HEAD + answer(0) * 7])
def test_a_partial_part_of_something_else_is_not_gone_on_with(tmp_path: Path, content: str) -> None:
    (tmp_path / "count.1-of-1.jsonl.partial").write_text(content)
    sources = [Source(Path(f"{number}.bvh"), number=number) for number in range(6)]
    with pytest.raises((motet.FormatError, motet.OutputError), match=r"not a part|cannot go on with"):
        part(tmp_path).write(sources, lambda rest: iter(Count({})(rest)))
    assert (tmp_path / "count.1-of-1.jsonl.partial").read_text() == content


def test_parts_of_clips_keep_their_order(tmp_path: Path, corpus: Path) -> None:
    sources = [Source(Path("a.glb"), clip, number=0) for clip in "ab"] + [Source(Path("b.glb"), number=1)]
    for number in (1, 2):
        own = [one for one in sources if one.number % 2 == number - 1]
        part(tmp_path, 2, f"{number}/2").write(own, lambda rest: iter(Count({})(rest)))
    merge([tmp_path], tmp_path / "all.jsonl")
    _, *answers = map(json.loads, (tmp_path / "all.jsonl").read_text().splitlines())
    assert [answer["input"] for answer in answers] == list(map(str, sources))


@pytest.fixture
def command_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """``motet`` on the path of scripts."""
    program = tmp_path / "bin" / "motet"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m motet "$@"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")


SCALE = Path(__file__).parents[2] / "examples" / "scale"


@pytest.mark.skipif(sys.platform == "win32", reason="scripts of a shell")
@pytest.mark.usefixtures("command_line")
def test_schedulers_start_the_shard_of_their_number(
    corpus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    args = (SCALE / "kubernetes.yaml").read_text().partition("args:\n            - ")[2].partition("\n")[0]
    monkeypatch.setenv("SLURM_ARRAY_TASK_ID", "4")
    monkeypatch.setenv("JOB_COMPLETION_INDEX", "4")
    slurm = subprocess.run(["sh", SCALE / "slurm.sh", corpus, tmp_path / "slurm"], check=False)
    (tmp_path / "motions").symlink_to(corpus)
    pod = subprocess.run(["sh", "-c", args], cwd=tmp_path, check=False)
    assert (slurm.returncode, pod.returncode) == (1, 0)  # the fourth motion is broken; the pod has done its part
    assert failures(tmp_path / "slurm" / "describe.4-of-16.jsonl") == (1, 1)
    assert failures(tmp_path / "parts" / "describe.5-of-16.jsonl") == (1, 0)
