"""How a command over many files scales: by one process and by several, what docs/results/speed.md says of it.

    python tests/scale_figures.py describe motions --json
    python tests/scale_figures.py --workers 1 2 -- describe motions --engine ray --parts {}

Each run's ``--jobs`` is added, and ``{}`` is a new folder. On a busy machine the clock tells nothing, so it also prints
what Linux tells of each process: the processor time of all, of the longest way through them (the first process and
the busiest other), which is what free cores would take, and the greatest memory of one (VmHWM).
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


@dataclass
class Seen:
    """What was seen of the processes of a run: by their ids the processor time in seconds, and memory in MB."""

    wall: float = 0.0
    times: dict[int, float] = field(default_factory=dict)
    memory: dict[int, float] = field(default_factory=dict)

    def way(self, actors: bool) -> float:
        """Processor time of the first process and the busiest other one; of actors, of the busiest."""
        first, *others = self.times.values()
        return max(self.times.values()) if actors else first + max(others, default=0.0)


def children() -> dict[int, list[int]]:
    """All processes by their parents."""
    found: dict[int, list[int]] = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            parent = int((place / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        found.setdefault(parent, []).append(int(place.name))
    return found


def look(process: int, seen: Seen, below: dict[int, list[int]], name: str) -> None:
    """See a process and all below it; of those with the name in their command lines also times."""
    try:
        place = Path(f"/proc/{process}")
        stat = (place / "stat").read_text().rpartition(")")[2].split()
        status = (place / "status").read_text()
        if name in (place / "cmdline").read_text():
            seen.times[process] = (int(stat[11]) + int(stat[12])) / TICKS
            seen.memory[process] = int(status.partition("VmHWM:")[2].split()[0]) / 1024
    except (OSError, IndexError, ValueError):
        return
    for one in below.get(process, ()):
        look(one, seen, below, name)


def watched(command: list[str], name: str) -> Seen:
    """Run a command and watch it, twenty times a second."""
    seen, start = Seen(), time.perf_counter()
    with tempfile.TemporaryFile() as said:
        running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=said)
        while running.poll() is None:
            look(running.pid, seen, children(), name)
            time.sleep(0.05)
        seen.wall = time.perf_counter() - start
        if running.returncode not in (0, 1):  # 1: all was answered, and some motions cannot be used
            said.seek(0)
            sys.exit(said.read().decode())
    return seen


def main() -> None:
    """Run the command with each number of processes, and print a line of each."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2])
    parser.add_argument("command", nargs=argparse.REMAINDER)
    asked = parser.parse_args()
    given = asked.command[1:] if asked.command[0] == "--" else asked.command
    name = "MapWorker" if "ray" in given else ""
    first = 0.0
    for count in asked.workers:
        with tempfile.TemporaryDirectory() as folder:
            words = [folder if word == "{}" else word for word in given]
            seen = watched([sys.executable, "-m", "motet", *words, "--jobs", str(count)], name)
        way = seen.way(bool(name))
        first = first or way
        print(
            f"{count}: {seen.wall:.1f} s by the clock; processor time {sum(seen.times.values()):.1f} s in all, "
            f"{way:.1f} s the longest way, {first / way:.2f} times as fast as the first; "
            f"at most {max(seen.memory.values()):.0f} MB a process"
        )


if __name__ == "__main__":
    main()
