"""Figures of docs/results/speed.md: python tests/ray_figures.py CLIPS [FILES]

Describes 10,000 files, one of a hundred broken, by one process and by Ray with two workers, one of which is killed, and
compares the bytes of both answers. CLIPS is a folder of motions, whose first 2 s are cut to a hundred short ones; the
others are links to these.
"""

import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from motet import MotetError, read, to_humanoid, write
from motet.corpus.sources import files_of

DIFFERENT, BROKEN = 99, 100


def corpus(clips: Path, folder: Path, count: int) -> None:
    """A folder of so many files, every 100th of them broken."""
    folder.mkdir()
    for number, place in enumerate(islice(short(clips, folder.parent), DIFFERENT)):
        for copy in range(number, count, BROKEN):
            os.link(place, folder / f"{copy:06}.npz")
    for copy in range(BROKEN - 1, count, BROKEN):
        (folder / f"{copy:06}.npz").write_bytes(b"PK")


def short(clips: Path, folder: Path) -> Iterator[Path]:
    """Files of the first two seconds of motions that can be used."""
    for file in files_of([clips])[::5]:
        try:
            motion = to_humanoid(read(file)).motion.resample(30)
        except MotetError:
            continue
        write(place := folder / f"{file.stem}.npz", motion[: 30 + hash_of(file) % 30])
        yield place


def hash_of(file: Path) -> int:
    """A number that depends on the name."""
    return hashlib.sha256(file.stem.encode()).digest()[0]


def workers() -> list[int]:
    """The processes of Ray that describe."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        try:
            if b"MapWorker" in (place / "cmdline").read_bytes():
                found.append(int(place.name))
        except OSError:
            continue
    return found


def described(folder: Path, parts: Path, *options: str, kill: bool = False) -> tuple[Path, float]:
    """The part that is written, and the seconds it took; of Ray's workers the first is killed when a third is done."""
    start, partial = time.perf_counter(), parts / "describe.1-of-1.jsonl.partial"
    command = [sys.executable, "-m", "motet", "describe", folder, "--parts", parts, *options]
    running, third = subprocess.Popen(command, stderr=subprocess.DEVNULL), len(list(folder.iterdir())) // 3
    while running.poll() is None:
        time.sleep(0.2)
        if kill and partial.exists() and partial.read_bytes().count(b"\n") > third:
            os.kill(min(workers()), signal.SIGKILL)
            print("a worker was killed", flush=True)
            kill = False
    assert not kill, "no worker was killed"
    return parts / "describe.1-of-1.jsonl", time.perf_counter() - start


def main() -> None:
    """Describe by one process and by Ray, and compare."""
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 10_000
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "motions"
        corpus(Path(sys.argv[1]), folder, count)
        one, seconds = described(folder, Path(place) / "one", "--jobs", "2")
        print(f"two processes: {seconds:.0f} s", flush=True)
        other, seconds = described(folder, Path(place) / "ray", "--engine", "ray", "--jobs", "2", kill=True)
        print(f"Ray, two workers: {seconds:.0f} s")
        answers = list(map(json.loads, other.read_text().splitlines()[1:]))
        names = [answer["input"] for answer in answers]
        print(
            f"{count} files, {len(names)} answers of {len(set(names))} different files, "
            f"{sum(bool(answer['error']) for answer in answers)} errors; equal bytes: "
            f"{one.read_bytes() == other.read_bytes()}"
        )


if __name__ == "__main__":
    main()
