"""Many files on all cores: a function of each, in processes, with results in the order of what was given."""

import os
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from itertools import chain, islice
from typing import TypeVar

import click

T = TypeVar("T")
R = TypeVar("R")

FEW = 8
"""Fewer things are done before other processes have started."""

jobs_option = click.option(
    "--jobs", type=click.IntRange(1, 256), metavar="N", help="Processes for many files. [default: one for each core]"
)


def in_order(function: Callable[[T], R], given: Iterable[T], jobs: int | None) -> Iterator[R]:
    """The results of a function, in the order of what is given, each as soon as those before it are there.

    jobs: processes; 1: this one, None: one for each core that may be used. At most four results for each process wait,
    so memory does not grow. What the function raises ends all; what is interrupted starts no more.
    """
    first, jobs = list(islice(rest := iter(given), FEW)), cores() if jobs is None else jobs
    if jobs < 2 or len(first) < FEW:
        yield from map(function, chain(first, rest))
        return
    # an interrupt is for this process, which then ends the others
    with ProcessPoolExecutor(jobs, initializer=signal.signal, initargs=(signal.SIGINT, signal.SIG_IGN)) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            for one in chain(first, rest):
                waiting.append(pool.submit(function, one))
                if len(waiting) > 4 * jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        finally:
            pool.shutdown(cancel_futures=True)


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
