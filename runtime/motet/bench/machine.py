"""Where figures are measured: the machine, its ceilings, and a process of its own for what one process starts with."""

import json
import os
import platform
import re
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np

from motet.bench.measure import Row, taken
from motet.bundle.graph import SessionOptions
from motet.jobs import cores

POOLS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
"""Variables that say how many threads numpy's products take; read when numpy is imported."""


STATE = Path("/proc/stat")
"""Where Linux says how many processes run at the moment."""

LOOKS = 25
"""How often that is read."""


@dataclass(frozen=True)
class Machine:
    """Where figures were measured, and its ceilings in the same run, both by numpy in processes of their own.

    gflops: of a float32 product of 768 x 768, in 1e9 operations a second, by the number of threads, "1" and the cores.
    gigabytes: copied a second by one thread, read and written. load: processes that wanted a core when it began, beside
        this one; None where the system does not tell.
    """

    processor: str
    cores: int
    versions: dict[str, str]
    load: float | None
    gflops: dict[str, float]
    gigabytes: float

    @property
    def busy(self) -> bool:
        """Whether others work here, so that figures may be too low; times of the processor are disturbed least."""
        return self.load is not None and self.load > 0.3

    @property
    def overloaded(self) -> bool:
        """Whether others alone want more cores than there are, so that figures mean little."""
        return self.load is not None and self.load > self.cores

    def peak(self, threads: int) -> float:
        """The ceiling of so many threads, in GFLOP/s."""
        return self.gflops["1" if threads == 1 else max(self.gflops, key=int)]

    @staticmethod
    def here() -> "Machine":
        """This one, measured for a second or two."""
        load = wanted_by_others()
        versions = {name: version(name) for name in ("motet", "onnxruntime", "numpy")}
        ceilings_of = {str(count): fresh("ceilings", threads=count) for count in sorted({1, cores()})}
        gflops = {count: ceilings["gflops"] for count, ceilings in ceilings_of.items()}
        return Machine(processor(), cores(), versions, load, gflops, ceilings_of["1"]["gigabytes"])


def wanted_by_others() -> float | None:
    """Processes that want a core, beside this one: the mean of half a second on Linux, elsewhere of the last minute,
    which also counts what this one did; None where the system does not tell."""
    counts = []
    with suppress(OSError):
        for _ in range(LOOKS):
            counts += [
                int(count) - 1 for count in re.findall(r"^procs_running (\d+)$", STATE.read_text(), re.MULTILINE)
            ]
            time.sleep(0.5 / LOOKS)
    if counts:
        return round(sum(counts) / len(counts), 1)
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def processor() -> str:
    """The processor's name, as far as the system tells it."""
    with suppress(OSError):
        entry = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text(encoding="utf-8"))
        if entry:
            return entry[1]
    return platform.processor() or platform.machine()


def ceilings(seconds: float = 0.3) -> dict[str, float]:
    """GFLOP/s of a float32 product and GB/s of a copy by numpy here: the best of calls over ``seconds``."""
    square = np.ones((768, 768), np.float32)
    much = np.ones(16_000_000, np.float32)
    product = taken(lambda: square @ square, seconds).wall.min()
    copy = taken(much.copy, seconds).wall.min()
    return {"gflops": 2 * 768**3 / float(product) / 1e9, "gigabytes": 2 * much.nbytes / float(copy) / 1e9}


def peak_memory() -> float | None:
    """The most memory that this process has held so far, in MB; None where the system does not tell."""
    with suppress(OSError):  # not getrusage: it counts what the process was before it began another program
        entry = re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text(encoding="utf-8"))
        if entry:
            return int(entry[1]) / 1e3
    return None


def fresh(what: str, *arguments: str, threads: int = 1) -> dict[str, float]:
    """What :mod:`motet.bench.fresh` finds in a new process, whose numpy takes so many threads."""
    begin = "import sys, time; now = time.perf_counter(); from motet.bench import fresh; fresh.main(now, *sys.argv[1:])"
    command = [sys.executable, "-c", begin, what, *arguments]
    environment = os.environ | dict.fromkeys(POOLS, str(threads))
    environment.pop("OPENBLAS_CORETYPE", None)  # it would have numpy take another processor's products
    done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, text=True, check=True)
    figures: dict[str, float] = json.loads(done.stdout)
    return figures


def begun(bundle: str, options: SessionOptions) -> list[Row]:
    """What a process takes that starts with a model: import and load, and its memory then and after all calls."""
    entry = fresh("model", bundle, str(options.threads), *options.providers)
    units = {"import": "ms", "load": "ms", "memory": "MB", "memory_peak": "MB"}
    return [Row(f"process.{name}", value, units[name]) for name, value in entry.items()]
