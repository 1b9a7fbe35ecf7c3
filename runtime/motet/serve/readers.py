"""Processes that read uploaded files: few at once, with bounded memory, each ended with the request it works for."""

import asyncio
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import asdict
from threading import Lock
from typing import Any

from motet.errors import FormatError, MotetError, MotionError, OutputError, SettingError, UnitError
from motet.motion.motion import Motion
from motet.serve.content import Order
from motet.serve.reader import Head, MessageError, packed, receive, send, unpacked
from motet.serve.uploads import Bounds, RequestError, Upload

READER_PROGRAM = ("-P", "-m", "motet.serve.reader")

READERS = 2
"""Files that are read at once; the others wait."""

MEMORY = 2**30
MEMORY_OF_BODY = 8
"""Bytes that a process may take, and how many more for each byte that a request may have."""

ERRORS: dict[str, type[MotetError]] = {
    kind.__name__: kind for kind in (MotionError, UnitError, SettingError, OutputError, RequestError)
}


class _Reader:
    """A process. It leads a group of its own, to which processes that it starts belong."""

    def __init__(self, memory: int) -> None:
        command = [sys.executable, "-W", "ignore", *READER_PROGRAM, str(memory)]
        try:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        except OSError as error:
            raise OutputError(f"cannot start a process to read files: {error.strerror}") from error

    def ask(self, head: Head, parts: list[bytes | memoryview], most: int) -> tuple[Head, list[bytes]]:
        """What it answers; MessageError where it has ended."""
        assert self.process.stdin
        assert self.process.stdout
        try:
            send(self.process.stdin, head, *parts)
            return receive(self.process.stdout, most)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise MessageError from error

    def kill(self) -> None:
        """End it and what it has started, whatever they do."""
        with suppress(OSError):
            if hasattr(os, "killpg"):
                os.killpg(self.process.pid, signal.SIGKILL)
            else:
                self.process.kill()

    def close(self) -> None:
        """End it, and wait for that."""
        self.kill()
        for pipe in (self.process.stdin, self.process.stdout):
            assert pipe
            with suppress(OSError):
                pipe.close()
        self.process.wait()


class _Work:
    """What is done for one request, by a process as long as it is being done."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._reader: _Reader | None = None
        self._cancelled = False

    def begin(self, reader: _Reader) -> bool:
        """Give it to a process; False where nobody waits for it any more."""
        with self._lock:
            self._reader = None if self._cancelled else reader
            return not self._cancelled

    def end(self) -> bool:
        """The process is free for others; False where it has been ended."""
        with self._lock:
            self._reader = None
            return not self._cancelled

    def cancel(self) -> None:
        """Nobody waits for it: end the process that works on it."""
        with self._lock:
            self._cancelled = True
            if self._reader is not None:
                self._reader.kill()


class Readers:
    """Reads files of requests. Errors are those of the library; FormatError for a file that takes too much memory.

    Who stops waiting ends the process that reads for him, and another takes its place.

    body_bytes: of a request. seconds: of processor time for one file; the request's own time ends sooner.
    """

    def __init__(self, body_bytes: int, seconds: float, count: int = READERS) -> None:
        self._memory = MEMORY + MEMORY_OF_BODY * body_bytes
        self._seconds = seconds
        self._threads = ThreadPoolExecutor(count, "readers")
        self._idle: list[_Reader] = []
        self._works: set[_Work] = set()

    def close(self) -> None:
        """End all processes."""
        for work in list(self._works):
            work.cancel()
        self._threads.shutdown(cancel_futures=True)
        while self._idle:
            self._idle.pop().close()

    async def motion(self, file: Upload, bounds: Bounds, options: Mapping[str, Any]) -> Motion:
        """The motion of a file, like :func:`motet.serve.uploads.read_upload`."""
        head = {"task": "read", "bounds": asdict(bounds), "options": dict(options)}
        reply, values = await self._answered(file, head, [file.getbuffer()])
        return unpacked(reply, values)

    async def content(self, motion: Motion, order: Order, file: Upload) -> bytes:
        """The content of an answer on a file's character, like :func:`motet.serve.content.content_of`."""
        described, values = packed(motion)
        head = {"task": "put", "motion": described, "order": asdict(order)}
        return (await self._answered(file, head, [values, file.getbuffer()]))[1]

    async def _answered(self, file: Upload, head: Head, parts: list[bytes | memoryview]) -> tuple[Head, bytes]:
        work = _Work()
        self._works.add(work)
        try:
            head = {**head, "name": file.name, "seconds": self._seconds}
            loop = asyncio.get_running_loop()
            return await loop.run_in_executor(self._threads, self._done, work, head, parts)
        finally:
            work.cancel()  # nothing where it is done
            self._works.discard(work)

    def _done(self, work: _Work, head: Head, parts: list[bytes | memoryview]) -> tuple[Head, bytes]:
        reader = self._free()
        try:
            if not work.begin(reader):
                raise MessageError
            reply, content = reader.ask(head, parts, self._memory)
        except MessageError:
            work.end()
            reader.close()
            raise self._too_costly(head["name"]) from None
        is_free = work.end()
        if is_free and not reply.pop("last"):
            self._idle.append(reader)
        else:
            reader.close()
        self._check(head["name"], reply)
        return reply, content[0]

    def _free(self) -> _Reader:
        """A process that waits, or another."""
        with suppress(IndexError):
            while True:
                reader = self._idle.pop()
                if reader.process.poll() is None:
                    return reader
                reader.close()
        return _Reader(self._memory)

    def _check(self, name: str, reply: Head) -> None:
        """Raise the error that a process answered with."""
        kind = reply.get("error")
        if kind is None:
            return
        if kind == "MemoryError":
            raise self._too_costly(name)
        if kind == "FormatError":
            raise FormatError(reply["path"], reply["said"], reply["line"])
        raise ERRORS[kind](reply["said"]) if kind in ERRORS else RuntimeError(f"{name}: reading it failed")

    def _too_costly(self, name: str) -> FormatError:
        megabytes = self._memory >> 20
        return FormatError(name, f"it cannot be read in {self._seconds:g} s and {megabytes} MiB of memory")
