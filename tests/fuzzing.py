"""What the fuzzers of bundles and of motion files share: damage, processes that try what was damaged, and the count.

A mutant is what became of some files: how it was made, and its files by name, the first of which is opened. What is
tried with it runs in a worker process whose memory is limited; one that dies or hangs counts as a failure, too.
"""

import argparse
import copy
import json
import multiprocessing
import os
import re
import resource
import shutil
import struct
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Container, Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motet.errors import MotetError

Generator = np.random.Generator
Files = dict[str, bytes]
Mutant = tuple[str, Files]
YARDSTICK_REPEATS = 8
YARDSTICK_SECONDS = 0.5
"""Processor time of the yardstick, which parses 2 MB of JSON several times, on the processor that limits are meant for:
an AMD EPYC of family 25."""

Steps = Callable[[Path], Iterator[Callable[[], object]]]
"""What is tried with a file: calls, each of which may raise motet's errors."""

NASTY: list[Any] = [
    None, True, False, 0, 1, -1, 2, 255, 1 << 31, 1 << 63, 10**30, 0.5, -0.5, 1e9, 1e30, 1e308, 1e-320, "", "x", "0",
    "batch", "../x", "\x00", "\ud800", "x" * 5000, [], {}, [None], [[]], {"x": 1}, [1e9] * 3, ["batch", 1], [0] * 1000,
]  # fmt: skip
"""What stands in the place of a value. 10**400 and NaN are in tests/runtime/test_bundle.py."""

NUMBERS = [struct.pack(kind, value) for kind, values in (
    ("<f", (float("nan"), float("inf"), 3e38, -1.0, 0.0, 1e-40)), ("<d", (float("nan"), 1e308, -1.0)),
    ("<i", (-1, 0, 2**31 - 1, 2**16)), ("<q", (-1, 2**62)),
) for value in values]  # fmt: skip


class Found(NamedTuple):
    """What became of a mutant: "runs", the name of motet's first error, or what is a failure; the seconds of processor
    time that its slowest call would take on a processor that runs at the pace of the ``YARDSTICK``, and the peak of
    megabytes beyond what the worker held before."""

    outcome: str
    seconds: float
    megabytes: float
    detail: str = ""


def damaged(rng: Generator, data: bytes) -> bytes:
    """Bytes with a few of them flipped, overwritten, cut out, doubled or cut off; near the start and end more often."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        spread = len(found) if rng.random() < 0.5 else min(len(found), 400)
        place = int(rng.integers(max(1, spread)))
        place = max(0, len(found) - 1 - place) if rng.random() < 0.5 else place
        kind, size = rng.integers(6), int(rng.integers(1, 40))
        if kind == 0 and found:
            found[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            found[place : place + size] = rng.bytes(size)
        elif kind == 2:
            del found[place : place + size]
        elif kind == 3:
            found[place:place] = found[place : place + size]
        elif kind == 4:
            number = NUMBERS[int(rng.integers(len(NUMBERS)))]
            found[place & ~3 : (place & ~3) + len(number)] = number
        elif rng.random() < 0.2:
            del found[place:]
    return bytes(found)


def altered(rng: Generator, top: Any, seldom: Container[str] = ()) -> str:
    """One to three values of a JSON document replaced, removed, doubled or scaled, wherever they are; their paths."""
    said = []
    for _ in range(int(rng.integers(1, 4))):
        places = _places(top, rng, seldom)
        if not places:
            break
        holder, key, path = places[int(rng.integers(len(places)))]
        kind = rng.integers(5)
        if kind <= 1:
            holder[key] = copy.deepcopy(NASTY[int(rng.integers(len(NASTY)))])
        elif kind == 2:
            del holder[key]
        elif kind == 3 and isinstance(holder, list):
            holder.insert(key, copy.deepcopy(holder[key]))
        elif isinstance(holder[key], int | float) and not isinstance(holder[key], bool):
            holder[key] = holder[key] * float(rng.choice([-1, 1e-6, 3, 1e4])) if rng.random() < 0.5 else holder[key] + 1
        else:
            holder[key] = str(holder[key])[:100] if rng.random() < 0.5 else [holder[key]]
        said.append(path)
    return ", ".join(said)


def _places(top: Any, rng: Generator, seldom: Container[str]) -> list[tuple[Any, Any, str]]:
    """All places of a document, of long lists three, and of its keys that matter ``seldom`` few."""
    found: list[tuple[Any, Any, str]] = []
    waiting: list[tuple[Any, str]] = [(top, "")]
    while waiting:
        value, path = waiting.pop()
        keys: list[Any] = list(value) if isinstance(value, dict) else list(range(len(value)))
        if isinstance(value, list) and len(keys) > 3:
            keys = sorted(int(i) for i in rng.choice(keys, 3, replace=False))
        for key in keys:
            if path == "" and key in seldom and rng.random() < 0.9:
                continue
            found.append((value, key, f"{path}.{key}"))
            if isinstance(value[key], dict | list):
                waiting.append((value[key], f"{path}.{key}"))
    return found


def tried(steps: Steps, path: Path) -> Found:
    """Take all steps with a file; what came of it, in how long, and at what peak of memory."""
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before, slowest, outcome, detail = _megabytes("VmRSS"), 0.0, "runs", ""
    for step in steps(path):
        started = _seconds()
        try:
            step()
        except MotetError as error:
            outcome, detail = (type(error).__name__, ascii(str(error))) if outcome == "runs" else (outcome, detail)
        except BaseException:
            outcome, detail = "FOREIGN", ascii(traceback.format_exc()).replace("\\n", "\n")
        slowest = max(slowest, _seconds() - started)
        if outcome == "FOREIGN":
            break
    megabytes = _megabytes("VmHWM") - before
    if slowest > YARDSTICK_SECONDS:
        slowest /= _slowness()
    return Found(outcome, slowest, megabytes, detail)


def _slowness() -> float:
    """How many times longer than ``YARDSTICK_SECONDS`` this process takes just now for the yardstick; at least 1.

    A slow or a busy processor slows the yardstick as it slows the mutant, so a verdict depends on neither.
    """
    document = json.dumps([{"name": str(number), "values": [number, number / 8]} for number in range(50_000)])
    started = _seconds()
    for _ in range(YARDSTICK_REPEATS):
        json.loads(document)
    return max(1.0, (_seconds() - started) / YARDSTICK_SECONDS)


def _seconds() -> float:
    """Processor time of this process and of those that it has waited for."""
    return sum(os.times()[:4])


def _megabytes(kind: str) -> float:
    """What this process holds ("VmRSS"), or has held at most ("VmHWM")."""
    status = Path("/proc/self/status").read_text()
    return int(re.search(rf"{kind}:\s+(\d+) kB", status)[1]) / 1024  # type: ignore[index]


def _work(pipe: Connection, steps: Steps, limit: int) -> None:
    """A worker: paths in, what was found out."""
    resource.setrlimit(resource.RLIMIT_AS, (limit << 20, limit << 20))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    warnings.simplefilter("ignore")
    pipe.send(None)
    while True:
        pipe.send(tried(steps, pipe.recv()))


class Worker:
    """A process that tries files, one after the other, and is replaced when it dies or takes too long."""

    def __init__(self, steps: Steps, address_space: int, patience: float) -> None:
        self._steps, self._limit, self._patience = steps, address_space, patience
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_work, args=(other, self._steps, self._limit), daemon=True)
        self._process.start()
        other.close()
        self._pipe.recv()  # it is there, however busy the machine

    def run(self, path: Path) -> Found:
        """What becomes of a file; "DIED" or "HANGS" where the worker did not live to say so."""
        self._pipe.send(path)
        try:
            if self._pipe.poll(self._patience):
                found: Found = self._pipe.recv()
                return found
            outcome = Found("HANGS", self._patience, 0)
        except EOFError:
            self._process.join()
            outcome = Found("DIED", 0, 0, f"exit code {self._process.exitcode}")
        self.close()
        self._start()
        return outcome

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()


def put(folder: Path, files: Files) -> Path:
    """The files of a mutant in a folder, and nothing else there; the path of the one that is opened."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, data in files.items():
        (folder / name).write_bytes(data)
    return folder / next(iter(files))


def failure(found: Found, seconds: float, megabytes: float) -> str | None:
    """Why a mutant's end is a failure; None where it is none."""
    if found.outcome in {"FOREIGN", "DIED", "HANGS"}:
        return found.outcome
    if found.seconds > seconds:
        return f"{found.seconds:.1f} s"
    return f"{found.megabytes:.0f} MB" if found.megabytes > megabytes else None


def options(description: str | None) -> argparse.ArgumentParser:
    """The options of a fuzzer."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant")
    parser.add_argument("--seconds", type=float, default=2.0, help="longest processor time of one call")
    parser.add_argument("--megabytes", type=float, default=500.0, help="largest peak of memory of one mutant")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "motet-fuzz", help="of failures")
    return parser


def fuzz(given: argparse.Namespace, mutate: Callable[[Generator], Mutant], steps: Steps) -> int:
    """Try mutants and say what came of them; the exit code, which is 1 where one failed."""
    outcomes: Counter[str] = Counter()
    failures, slowest, largest, started = 0, 0.0, 0.0, time.perf_counter()
    worker = Worker(steps, address_space=4096, patience=100 * given.seconds)
    with tempfile.TemporaryDirectory() as folder:
        for number in range(given.first, given.first + given.count):
            how, files = mutate(np.random.default_rng([given.seed, number]))
            found = worker.run(put(Path(folder) / "mutant", files))
            outcomes[found.outcome] += 1
            slowest, largest = max(slowest, found.seconds), max(largest, found.megabytes)
            if (reason := failure(found, given.seconds, given.megabytes)) is not None:
                failures += 1
                put(given.keep / f"{given.seed}-{number}", files)
                print(f"FAILED {given.seed}-{number} ({how}): {reason}\n{found.detail}", flush=True)
    worker.close()
    print(f"{given.count} mutants in {time.perf_counter() - started:.0f} s: {dict(outcomes.most_common())}")
    print(f"slowest {slowest:.2f} s, largest {largest:.0f} MB, failures {failures}")
    return 1 if failures else 0
