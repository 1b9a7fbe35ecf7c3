"""Figures of docs/results/speed.md: python tests/serve_load.py [REQUESTS] [CLIENTS] [SECONDS of each motion].

Clients ask a server at once, each for one motion after the other; every answer has to be the bytes that Python gives
for it alone. Beside it the same motions by Python, one after the other and all at once, without a server.
"""

import http.client
import io
import os
import subprocess
import sys
import threading
from collections.abc import Callable, Sized
from pathlib import Path
from time import perf_counter
from typing import TypeVar
from urllib.parse import quote

import motet

T = TypeVar("T")

SENTENCES = [
    "a person walks",
    "someone jumps",
    "a man kicks with his right leg",
    "a person waves",
    "she runs in a circle",
]


def main(requests: int = 1000, clients: int = 16, length: float | None = None) -> None:
    """Print requests a second and processor time of each, and what was lost or differs."""
    asked = [(SENTENCES[i % len(SENTENCES)], i // len(SENTENCES)) for i in range(requests)]
    model = motet.load("generate")
    alone = measured(
        "direct, one by one", lambda: [written(model.generate(t, seed=s, seconds=length)[0]) for t, s in asked], asked
    )
    texts, seeds = map(list, zip(*asked, strict=True))
    measured(
        "direct, all at once",
        lambda: [written(row[0]) for row in model.generate(texts, seed=seeds, seconds=length)],
        asked,
    )
    command = [sys.executable, "-m", "motet", "serve", "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as server:
        assert server.stderr is not None
        port = int(server.stderr.readline().split(";")[0].rpartition(":")[2])
        ask(port, asked[:clients], clients, length)  # warms up
        answers = measured(f"served to {clients} clients", lambda: ask(port, asked, clients, length), asked, server.pid)
        server.terminate()
    lost = sum(answer is None for answer in answers)
    differ = sum(answer not in (None, own) for answer, own in zip(answers, alone, strict=True))
    print(f"{requests} requests: {lost} lost, {differ} differ from those alone")


def measured(name: str, call: Callable[[], T], asked: Sized, pid: int | None = None) -> T:
    """What a call gives; prints its time, and the processor time of a process, this one by default."""
    start, busy = perf_counter(), processor_time(pid or os.getpid())
    found = call()
    seconds, busy = perf_counter() - start, processor_time(pid or os.getpid()) - busy
    print(
        f"{name}: {len(asked) / seconds:.1f} a second, {1000 * busy / len(asked):.1f} ms of processor each", flush=True
    )
    return found


def written(one: motet.Generated) -> bytes:
    """The BVH file of a motion."""
    file = io.BytesIO()
    motet.write(file, one.motion, format="bvh")
    return file.getvalue()


def ask(port: int, asked: list[tuple[str, int]], clients: int, length: float | None) -> list[bytes | None]:
    """The answers to all requests, None for one that is lost; client i asks for every ``clients``-th."""
    answers: list[bytes | None] = [None] * len(asked)

    def client(first: int) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port)
        for place in range(first, len(asked), clients):
            text, seed = asked[place]
            connection.request("GET", f"/generate.bvh?text={quote(text)}&seed={seed}&seconds={length or ''}")
            answer = connection.getresponse()
            content = answer.read()
            answers[place] = content if answer.status == 200 else None

    threads = [threading.Thread(target=client, args=(first,)) for first in range(clients)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return answers


def processor_time(pid: int) -> float:
    """Seconds of processor time that a process has taken (Linux)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *map(float, sys.argv[3:]))
