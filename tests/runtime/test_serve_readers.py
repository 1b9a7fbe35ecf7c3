"""Uploaded files are read in processes: what they give is the library's, and they end with those who wait for them."""

import asyncio
import io
import os
import signal
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from figures import walker
from small_character import character as small_character

import motet
from motet.errors import FormatError, MotetError
from motet.formats import read_character, write_motion
from motet.motion.motion import Motion
from motet.serve import readers, uploads
from motet.serve.content import Order, content_of
from motet.serve.readers import Readers
from motet.serve.uploads import Bounds, Upload, read_upload

BOUNDS = Bounds(seconds=60, unpacked=10**6)

HANGS = """
import subprocess, sys
stays = '''
import sys, time
file = open(sys.argv[1], "w")
print("begun", file=file, flush=True)
time.sleep(100)
print("left alone", file=file)
'''
subprocess.run([sys.executable, "-c", stays, {pipe!r}])
"""
"""A process that starts another, which says so in a pipe and holds it open, until it says that nobody ended it."""

linux = pytest.mark.skipif(sys.platform != "linux", reason="limits of memory are Linux's")
posix = pytest.mark.skipif(not hasattr(os, "killpg"), reason="processes have no groups")


def file_of(motion: Motion, kind: str) -> bytes:
    content = io.BytesIO()
    write_motion(content, motion, format=kind)
    return content.getvalue()


@asynccontextmanager
async def opened(count: int = 2, body_bytes: int = 1 << 20) -> AsyncIterator[Readers]:
    found = Readers(body_bytes, 60, count)
    try:
        yield found
    finally:
        found.close()


def program(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(readers, "READER_PROGRAM", ("-c", text))


def hanging(monkeypatch: pytest.MonkeyPatch, folder: Path) -> Path:
    """The pipe of processes that hang."""
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    program(monkeypatch, HANGS.format(pipe=str(pipe)))
    return pipe


@pytest.mark.parametrize("kind", ["bvh", "npz", "csv", "glb"])
def test_motions_come_back_to_the_bit(kind: str) -> None:
    content = file_of(walker(), kind)
    expected = motet.read(io.BytesIO(content), format=kind)

    async def scenario() -> list[Motion]:
        async with opened() as own:
            return [await own.motion(Upload(content, f"a.{kind}"), BOUNDS, {}) for _ in range(2)]

    for motion in asyncio.run(scenario()):
        assert np.array_equal(motion.values, expected.values)
        assert (motion.channels, motion.units, motion.fps) == (expected.channels, expected.units, expected.fps)
        assert motion.skeleton == expected.skeleton


def test_errors_are_the_librarys() -> None:
    cut = file_of(walker(), "bvh")[:-40]
    cases: list[tuple[str, bytes, dict[str, Any]]] = [
        ("a.bvh", b"no motion", {}),
        ("dir/a.bvh", cut, {}),
        ("a.csv", b"time,a.rx [deg]\n0,1\n0,x\n", {}),
        ("a.npz", b"PK", {}),
        ("a.glb", b"", {}),
        ("a.amc", b"", {}),
        ("a.bvh", file_of(walker(), "bvh"), {"unit": "furlong"}),
        ("a.csv", file_of(walker(), "csv"), {"clip": "x"}),
    ]

    async def error_of(call: Awaitable[Motion]) -> MotetError:
        with pytest.raises(MotetError) as caught:
            await call
        return caught.value

    async def scenario() -> list[MotetError]:
        async with opened() as own:
            return [await error_of(own.motion(Upload(data, name), BOUNDS, how)) for name, data, how in cases]

    for (name, data, how), error in zip(cases, asyncio.run(scenario()), strict=True):
        with pytest.raises(MotetError) as caught:
            read_upload(Upload(data, name), BOUNDS, how)
        assert (type(error), str(error)) == (type(caught.value), str(caught.value))
        assert vars(error) == vars(caught.value)


@pytest.mark.parametrize(
    "order",
    [
        Order("bvh", "a walk", fps=20),
        Order("glb", "a walk", onto=True, in_place=True),
        Order("json", "", details={"understood": [{"confidence": 0.1}]}),
        Order("html", "a walk", captions=[(0.0, "first"), (0.25, "then")]),
    ],
    ids=lambda order: order.form,
)
def test_a_motion_on_a_files_character_is_what_it_is_here(order: Order, clips: Path, tmp_path: Path) -> None:
    motion = motet.read(clips / "39_14.amc")[:24]
    character = file_of(motion, "glb") if order.form == "json" else small_character(tmp_path / "a.glb").read_bytes()

    async def scenario() -> bytes:
        async with opened() as own:
            return await own.content(motion, order, Upload(character, "a.glb"))

    assert asyncio.run(scenario()) == content_of(motion, order, read_character(Upload(character, "a.glb")))


def test_a_file_that_unpacks_to_much_more_is_refused_before_it_is_unpacked() -> None:
    content = io.BytesIO()
    np.savez_compressed(content, values=np.zeros(10**5), fps=30.0)
    assert len(content.getvalue()) < 5_000
    file = Upload(content.getvalue(), "a.npz")
    with pytest.raises(FormatError, match=r"a.npz: it unpacks to more than 800000 bytes"):
        read_upload(file, Bounds(seconds=60, unpacked=800_000), {})
    with pytest.raises(FormatError, match=r"not an .npz motion written by motet"):
        read_upload(file, Bounds(seconds=60, unpacked=900_000), {})


def test_long_and_wide_motions_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    motion = walker()
    file = Upload(file_of(motion, "npz"), "a.npz")
    with pytest.raises(FormatError, match=r"it lasts \d+ s: expected at most 0.01 s"):
        read_upload(file, Bounds(seconds=0.01, unpacked=10**6), {})
    monkeypatch.setattr(uploads, "MAX_VALUES", motion.values.size)
    assert len(read_upload(file, BOUNDS, {})) == len(motion)
    monkeypatch.setattr(uploads, "MAX_VALUES", motion.values.size - 1)
    with pytest.raises(FormatError, match=f"{len(motion)} frames of .* expected at most {motion.values.size - 1}"):
        read_upload(file, BOUNDS, {})


@posix
def test_who_leaves_ends_the_process_and_what_it_started(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    content = file_of(walker(), "bvh")

    async def scenario() -> Motion:
        async with opened(count=1) as own:
            with monkeypatch.context() as patch:
                pipe = hanging(patch, tmp_path)
                first = asyncio.create_task(own.motion(Upload(content, "a.bvh"), BOUNDS, {}))
                file = await asyncio.to_thread(pipe.open)
                assert await asyncio.to_thread(file.readline) == "begun\n"
                waits = asyncio.create_task(own.motion(Upload(content, "a.bvh"), BOUNDS, {}))
                await asyncio.sleep(0)
                waits.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await waits
                assert not first.done()
                first.cancel()
            with file:
                assert await asyncio.to_thread(file.read) == ""  # nobody holds the pipe: both are gone
            return await own.motion(Upload(content, "a.bvh"), BOUNDS, {})

    assert len(asyncio.run(scenario())) == len(walker())


@posix
def test_the_end_of_the_server_ends_the_processes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pipe = hanging(monkeypatch, tmp_path)

    async def scenario() -> str:
        async with opened() as own:
            reading = asyncio.create_task(own.motion(Upload(b"", "a.bvh"), BOUNDS, {}))
            file = await asyncio.to_thread(pipe.open)
            await asyncio.to_thread(file.readline)
        with pytest.raises(FormatError):
            await reading
        with file:
            return await asyncio.to_thread(file.read)

    assert asyncio.run(scenario()) == ""


@linux
def test_a_file_that_takes_too_much_memory_is_refused_and_the_next_one_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(readers, "MEMORY", 2**25)
    head = b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\nEnd Site\n{\nOFFSET 0 1 0\n}\n}\nMOTION\n"
    large = head + b"Frames: 3000000\nFrame Time: 0.00001\n" + b"0\n" * 3_000_000
    small = head + b"Frames: 2\nFrame Time: 0.01\n0\n1\n"

    async def scenario() -> list[Motion]:
        async with opened(body_bytes=0) as own:
            before = await own.motion(Upload(small, "a.bvh"), BOUNDS, {})
            with pytest.raises(FormatError, match=r"a.bvh: it cannot be read in 60 s and 32 MiB of memory"):
                await own.motion(Upload(large, "a.bvh"), BOUNDS, {})
            return [before, await own.motion(Upload(small, "a.bvh"), BOUNDS, {})]

    assert [motion.values.tolist() for motion in asyncio.run(scenario())] == [[[0.0], [1.0]]] * 2


@linux
def test_processor_time_is_bounded() -> None:
    spins = "from motet.serve.reader import limit_time\nlimit_time(0)\nwhile True:\n    pass"
    assert subprocess.run([sys.executable, "-c", spins], check=False).returncode == -signal.SIGXCPU


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("", FormatError, "cannot be read in 60 s"),
        ("print('{}')", FormatError, "cannot be read in 60 s"),
        ("print('no JSON')", FormatError, "cannot be read in 60 s"),
        ("print('{\"sizes\": [99999999999999]}')", FormatError, "cannot be read in 60 s"),
        ('print(\'{"sizes": [5], "last": true}\\nabc\')', FormatError, "cannot be read in 60 s"),
        ('print(\'{"sizes": [0], "last": true, "error": "KeyboardInterrupt"}\')', RuntimeError, "a.bvh: reading"),
        ('print(\'{"sizes": [0], "last": true, "error": "UnitError", "said": "why"}\')', motet.UnitError, "why"),
    ],
)
def test_what_a_broken_process_says(
    monkeypatch: pytest.MonkeyPatch, text: str, kind: type[Exception], said: str
) -> None:
    program(monkeypatch, f"import sys; sys.stdin.buffer.readline()\n{text}")

    async def scenario() -> None:
        async with opened() as own:
            await own.motion(Upload(b"", "a.bvh"), BOUNDS, {})

    with pytest.raises(kind, match=said):
        asyncio.run(scenario())


@posix
def test_sentences_are_answered_while_files_are_read(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    pytest.importorskip("starlette", reason="the extra serve is not installed")
    from motet.generate.model import CodesModel
    from motet.models.describe import DescribeModel
    from motet.models.load import load_as
    from motet.predict.model import PredictModel
    from motet.serve.answers import Answers
    from motet.serve.limits import Limits
    from motet.serve.request import RequestData

    pipe = hanging(monkeypatch, tmp_path)
    writer, describer = load_as(CodesModel, "generate"), load_as(DescribeModel, "describe")
    answers = Answers(writer, describer, load_as(PredictModel, "predict"), Limits())

    async def scenario() -> bytes:
        files = [Upload(file_of(walker(), "bvh"), "a.bvh") for _ in range(readers.READERS + 2)]
        waiting = [asyncio.create_task(answers.describe(RequestData({}, {"file": file}))) for file in files]
        file = await asyncio.to_thread(pipe.open)
        for _ in range(readers.READERS):
            assert await asyncio.to_thread(file.readline) == "begun\n"
        answer = await answers.generate(RequestData({"text": ["a person walks"], "seconds": 1.0}), "csv")
        assert not any(task.done() for task in waiting)
        for task in waiting:
            task.cancel()
        with file:
            assert await asyncio.to_thread(file.read) == ""
        return answer.content

    try:
        assert asyncio.run(scenario()).startswith(b"# motet motion")
    finally:
        answers.close()
