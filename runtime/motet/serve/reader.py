"""A separate program that reads uploaded files, so that a costly one can be ended with its request.

    python -P -m motet.serve.reader MEMORY

Requests come on standard input and answers go to standard output, as messages: a line of JSON, whose "sizes" are those
of the bytes that follow. It ends with its input. MEMORY: bytes that it may take beyond what it starts with.
"""

import json
import logging
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

import numpy as np

from motet.errors import FormatError, MotetError
from motet.files import Json
from motet.formats import read_character
from motet.motion.motion import Motion
from motet.motion.skeleton import Skeleton
from motet.serve.content import Order, content_of
from motet.serve.uploads import Bounds, Upload, read_upload

Head = Json
Answer = tuple[Head, bytes]


class MessageError(Exception):
    """A message that is cut off, or larger than it may be."""


def send(stream: IO[bytes], head: Head, *parts: bytes | memoryview) -> None:
    """Write a message."""
    sizes = [len(part) for part in parts]
    stream.write(json.dumps({**head, "sizes": sizes}).encode() + b"\n")
    for part in parts:
        stream.write(part)
    stream.flush()


def receive(stream: IO[bytes], most: int) -> tuple[Head, list[bytes]]:
    """A message and its parts; MessageError where it is cut off, or its parts have more than ``most`` bytes."""
    # a message's JSON has the names of channels, a skeleton, captions
    line = stream.readline(2**26)
    if not line.endswith(b"\n"):
        raise MessageError
    head: Head = json.loads(line)
    sizes = head.pop("sizes")
    if sum(sizes) > most:
        raise MessageError
    parts = [stream.read(size) for size in sizes]
    if [len(part) for part in parts] != sizes:
        raise MessageError
    return head, parts


def packed(motion: Motion) -> Answer:
    """A motion as JSON and the bytes of its values."""
    skeleton = None if motion.skeleton is None else motion.skeleton.to_json()
    head = {"channels": motion.channels, "units": motion.units, "fps": motion.fps, "skeleton": skeleton}
    return head, motion.values.tobytes()


def unpacked(head: Head, values: bytes) -> Motion:
    """The motion that was packed; one of many types of errors for what was not."""
    skeleton = None if head["skeleton"] is None else Skeleton.from_json(head["skeleton"])
    channels = tuple(head["channels"])
    rows = np.frombuffer(values).reshape(-1, len(channels)) if channels else np.zeros((0, 0))
    return Motion(rows, channels, tuple(head["units"]), head["fps"], skeleton)


def read(head: Head, parts: Sequence[bytes]) -> Answer:
    """The motion of a file."""
    return packed(read_upload(Upload(parts[0], head["name"]), Bounds(**head["bounds"]), head["options"]))


def put(head: Head, parts: Sequence[bytes]) -> Answer:
    """The content of an answer: a motion, the first part, put onto the character of a file, the second."""
    motion = unpacked(head["motion"], parts[0])
    file = Upload(parts[1], head["name"])
    return {}, content_of(motion, Order(**head["order"]), read_character(file))


TASKS: dict[str, Callable[[Head, Sequence[bytes]], Answer]] = {"read": read, "put": put}


def answer(head: Head, parts: Sequence[bytes]) -> Answer:
    """The answer to a request, or the error, by what it says."""
    try:
        return TASKS[head["task"]](head, parts)
    except FormatError as error:
        place = {"path": str(error.path), "line": error.line}
        return {"error": "FormatError", "said": error.reason, **place}, b""
    except MotetError as error:
        return {"error": type(error).__name__, "said": str(error)}, b""
    except MemoryError:
        return {"error": "MemoryError"}, b""
    except Exception:
        traceback.print_exc()
        return {"error": "Exception"}, b""


def limit_memory(most: int) -> None:
    """Refuse this process more than some bytes beyond what it has, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limit = pages * resource.getpagesize() + most
        resource.setrlimit(resource.RLIMIT_AS, (limit, resource.getrlimit(resource.RLIMIT_AS)[1]))


def limit_time(seconds: float) -> None:
    """End this process after some more seconds of processor time, where the system can."""
    with suppress(ImportError, ValueError, OSError):
        import resource

        used = sum(os.times()[:2])
        hard = resource.getrlimit(resource.RLIMIT_CPU)[1]
        resource.setrlimit(resource.RLIMIT_CPU, (int(used + seconds) + 1, hard))


def is_used() -> bool:
    """Whether this process has taken so much memory that another should follow."""
    with suppress(OSError):
        import resource

        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() > 2**28
    return True


def main() -> None:
    """Answer requests until the input ends."""
    logging.disable()
    requests = sys.stdin.buffer
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever prints does not break into a message
    with suppress(AttributeError, OSError):
        os.nice(5)  # models go first
    memory = int(sys.argv[1])
    limit_memory(memory)
    with suppress(MessageError):
        while True:
            head, parts = receive(requests, memory)
            limit_time(head["seconds"])
            reply, content = answer(head, parts)
            del parts
            failed = reply.get("error") in {"MemoryError", "Exception"}
            send(answers, {**reply, "last": failed or is_used()}, content)


if __name__ == "__main__":
    main()
