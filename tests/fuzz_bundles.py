"""Mutated bundles: whatever is altered, only motet's own errors come out, soon and in little memory.

    python tests/fuzz_bundles.py --count 5000 [--seed N] [--seconds 2] [--megabytes 500]

The bundles that come with motet are altered in five ways: bytes of the zip, values and keys of the manifest, bytes of a
graph, its weights moved out of it, and bytes of golden vectors; in all but the first the manifest lists the hashes of
what is there, as who makes a bundle on purpose would. Each is loaded, verified, and one step of its model is run, in
worker processes whose memory is limited; a worker that dies counts as a failure, too. Failures are kept in a folder.
"""

import argparse
import copy
import hashlib
import io
import json
import multiprocessing
import os
import re
import resource
import sys
import tempfile
import time
import traceback
import zipfile
from collections import Counter
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from motet.bundle.bundle import Bundle, list_bundles
from motet.errors import MotetError
from motet.models.control import ControlModel
from motet.models.load import load
from motet.models.steer import SteerModel
from motet.models.verify import verify

Generator = np.random.Generator
Files = dict[str, bytes]

NASTY: list[Any] = [
    None, True, False, 0, 1, -1, 2, 255, 1 << 31, 1 << 63, 10**30, 0.5, -0.5, 1e9, 1e30, 1e308, 1e-320, "", "x", "0",
    "batch", "../x", "\x00", "x" * 5000, [], {}, [None], [[]], {"x": 1}, [1e9] * 3, ["batch", 1], [0] * 1000,
]  # fmt: skip
"""What stands in the place of a value of the manifest. 10**400 and NaN are in tests/runtime/test_bundle.py."""


class Found(NamedTuple):
    """What became of a bundle: "runs", the name of motet's error, or what is a failure; seconds, peak megabytes."""

    outcome: str
    seconds: float
    megabytes: float
    detail: str = ""


def mutate(rng: Generator, zips: dict[str, bytes]) -> tuple[str, bytes]:
    """A mutated bundle: how it was made, and its zip."""
    name = str(rng.choice(sorted(zips)))
    kind = str(rng.choice(list(_KINDS), p=[0.15, 0.5, 0.2, 0.05, 0.1]))
    if kind == "zip":
        return f"{name}, zip", _damaged(rng, zips[name])
    with zipfile.ZipFile(io.BytesIO(zips[name])) as archive:
        files = {member: archive.read(member) for member in archive.namelist()}
    manifest = json.loads(files.pop("manifest.json"))
    said = _KINDS[kind](rng, manifest, files)
    return f"{name}, {kind}: {said}", _zipped(manifest, files)


def _zipped(manifest: dict[str, Any], files: Files) -> bytes:
    """The zip with hashes made right, where the manifest still has a place for them."""
    listed = manifest.get("files")
    for name, data in files.items():
        if isinstance(listed, dict) and isinstance(listed.get(name), dict):
            listed[name].update(size=len(data), sha256=hashlib.sha256(data).hexdigest())
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        archive.writestr("manifest.json", json.dumps(manifest))
        for name, data in files.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def _damaged(rng: Generator, data: bytes) -> bytes:
    """Bytes with a few of them flipped, overwritten, cut out, doubled or cut off; near the start and end more often."""
    found = bytearray(data)
    for _ in range(int(rng.integers(1, 5))):
        spread = len(found) if rng.random() < 0.5 else min(len(found), 400)
        place = int(rng.integers(max(1, spread)))
        place = len(found) - 1 - place if rng.random() < 0.5 else place
        kind, size = rng.integers(5), int(rng.integers(1, 40))
        if kind == 0 and found:
            found[place] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            found[place : place + size] = rng.bytes(size)
        elif kind == 2:
            del found[place : place + size]
        elif kind == 3:
            found[place:place] = found[place : place + size]
        elif rng.random() < 0.2:
            del found[place:]
    return bytes(found)


def _in_manifest(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """One to three values replaced, removed, doubled or scaled, wherever they are in the manifest."""
    said = []
    for _ in range(int(rng.integers(1, 4))):
        places = _places(manifest, rng)
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


def _places(top: dict[str, Any], rng: Generator) -> list[tuple[Any, Any, str]]:
    """All places of an object that a reader looks at, and of long lists three."""
    found: list[tuple[Any, Any, str]] = []
    waiting: list[tuple[Any, str]] = [(top, "")]
    while waiting:
        value, path = waiting.pop()
        keys: list[Any] = list(value) if isinstance(value, dict) else list(range(len(value)))
        if isinstance(value, list) and len(keys) > 3:
            keys = sorted(int(i) for i in rng.choice(keys, 3, replace=False))
        for key in keys:
            if path == "" and key in {"training", "quality", "parity", "config"} and rng.random() < 0.9:
                continue
            found.append((value, key, f"{path}.{key}"))
            if isinstance(value[key], dict | list):
                waiting.append((value[key], f"{path}.{key}"))
    return found


def _in_graph(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    name = str(rng.choice([file for file in files if file.endswith(".onnx")]))
    files[name] = _damaged(rng, files[name])
    return name


def _outside(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """A graph with one tensor more, at its start or end, whose data is in some file of the machine."""
    name = str(rng.choice([file for file in files if file.endswith(".onnx")]))
    place = str(rng.choice(["/etc/passwd", "weights.bin", "../weights.bin", "manifest.json"]))
    entry = _field(13, _field(1, b"location") + _field(2, place.encode()))
    tensor = b"\x08\x01\x10\x01" + _field(8, b"w") + b"\x70\x01" + entry
    graph = _field(7, _field(5, tensor))
    files[name] = files[name] + graph if rng.random() < 0.5 else graph + files[name]
    return f"{name} reads {place}"


def _field(number: int, data: bytes) -> bytes:
    return bytes([number << 3 | 2, len(data)]) + data


def _in_golden(rng: Generator, manifest: dict[str, Any], files: Files) -> str:
    """Bytes of the .npz, or of one array with the zip around it made right."""
    if rng.random() < 0.3:
        files["golden.npz"] = _damaged(rng, files["golden.npz"])
        return "bytes"
    with zipfile.ZipFile(io.BytesIO(files["golden.npz"])) as archive:
        arrays = {name: archive.read(name) for name in archive.namelist()}
    name = str(rng.choice(sorted(arrays)))
    arrays[name] = _damaged(rng, arrays[name])
    if rng.random() < 0.2:
        del arrays[str(rng.choice(sorted(arrays)))]
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for member, data in arrays.items():
            archive.writestr(member, data)
    files["golden.npz"] = buffer.getvalue()
    return name


_KINDS: dict[str, Callable[[Generator, dict[str, Any], Files], str]] = {
    "zip": lambda rng, manifest, files: "",
    "manifest": _in_manifest,
    "graph": _in_graph,
    "outside": _outside,
    "golden": _in_golden,
}


def use(path: Path) -> None:
    """Load a bundle, run one step of its model, and verify it."""
    model = load(path)
    if isinstance(model, ControlModel):
        model.start(variety=0.5).step()
    elif isinstance(model, SteerModel):
        session = model.start(characters=2)
        session.control(speed=1.0, direction=[0, 90])
        session.tick()
    else:
        encoder, rng = model.graphs[model.ROLES[0]], np.random.default_rng(0)
        feeds = {tensor.name: tensor.example(rng, 2) for tensor in encoder.spec.inputs}
        encoder({**feeds, **({"lengths": np.ones(2, np.int64)} if "lengths" in feeds else {})})
    verify(Bundle.open(path))


def try_bundle(path: Path) -> Found:
    """Use a bundle; what came of it, in how long, and at what peak of memory."""
    started, detail = time.perf_counter(), ""
    try:
        use(path)
        outcome = "runs"
    except MotetError as error:
        outcome, detail = type(error).__name__, str(error)
    except BaseException:
        outcome, detail = "FOREIGN", traceback.format_exc()
    seconds = time.perf_counter() - started
    return Found(outcome, seconds, peak_megabytes(), detail)


def peak_megabytes() -> float:
    """The most memory that this process has held: not ``ru_maxrss``, which starts with that of the parent."""
    status = Path("/proc/self/status").read_text()
    return int(re.search(r"VmHWM:\s+(\d+) kB", status)[1]) / 1024  # type: ignore[index]


def _work(pipe: Connection, limit: int) -> None:
    """A worker: bundles' paths in, what was found out. Its own size counts, so what is found is above that of motet."""
    resource.setrlimit(resource.RLIMIT_AS, (limit << 20, limit << 20))
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    while True:
        pipe.send(try_bundle(pipe.recv()))


class Worker:
    """A process that tries bundles, one after the other, and is replaced when it dies or takes too long."""

    def __init__(self, address_space: int, patience: float) -> None:
        self._limit, self._patience = address_space, patience
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_work, args=(other, self._limit), daemon=True)
        self._process.start()
        other.close()

    def run(self, path: Path) -> Found:
        """What becomes of a bundle; "DIED" or "HANGS" where the worker did not live to say so."""
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


def failure(found: Found, seconds: float, megabytes: float) -> str | None:
    """Why a bundle's end is a failure; None where it is none."""
    if found.outcome in {"FOREIGN", "DIED", "HANGS"}:
        return found.outcome
    if found.seconds > seconds:
        return f"{found.seconds:.1f} s"
    return f"{found.megabytes:.0f} MB" if found.megabytes > megabytes else None


def main() -> int:
    """The command; its exit code is 1 where a bundle failed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=2.0, help="longest time of one bundle")
    parser.add_argument("--megabytes", type=float, default=500.0, help="largest peak of a worker's resident memory")
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "motet-fuzz", help="of failures")
    given = parser.parse_args()
    zips = {name: path.read_bytes() for name, path in list_bundles().items()}
    outcomes: Counter[str] = Counter()
    failures, slowest, largest, started = 0, 0.0, 0.0, time.perf_counter()
    worker = Worker(address_space=4096, patience=10 * given.seconds)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mutated.zip"
        for number in range(given.count):
            how, data = mutate(np.random.default_rng([given.seed, number]), zips)
            path.write_bytes(data)
            found = worker.run(path)
            outcomes[found.outcome] += 1
            slowest, largest = max(slowest, found.seconds), max(largest, found.megabytes)
            if (reason := failure(found, given.seconds, given.megabytes)) is not None:
                failures += 1
                given.keep.mkdir(parents=True, exist_ok=True)
                (given.keep / f"{given.seed}-{number}.zip").write_bytes(data)
                print(f"FAILED {given.seed}-{number} ({how}): {reason}\n{found.detail}", flush=True)
    worker.close()
    print(f"{given.count} bundles in {time.perf_counter() - started:.0f} s: {dict(outcomes.most_common())}")
    print(f"slowest {slowest:.2f} s, largest {largest:.0f} MB, failures {failures}")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
