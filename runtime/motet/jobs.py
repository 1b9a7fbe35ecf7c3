"""Many things on all cores: a function of each, in processes, with results in the order of what was given; and shards,
which are shared out to several machines."""

import os
import pickle
import re
import signal
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from itertools import chain, islice
from typing import Any, TypeVar

from motet.errors import MotetError, SettingError

T = TypeVar("T")
R = TypeVar("R")

FEW = 8
"""Fewer things are done before other processes have started."""

_sent = b""
"""In a process of its own: what it does with each thing, pickled."""


def in_order(function: Callable[[T], R], items: Iterable[T], jobs: int | None, few: int = FEW) -> Iterator[R]:
    """The results of a function, in the order of what is given, each as soon as those before it are there.

    jobs: processes; 1: this one, None: one for each core that may be used. few: fewer things are done in this one. At
    most four results for each process wait, so memory does not grow. What the function raises ends all; what is
    interrupted starts no more. MotetError where a process was killed.
    """
    # few things are done sooner than a process starts
    first = list(islice(rest := iter(items), few))
    jobs = cores() if jobs is None else jobs
    if jobs < 2 or len(first) < few:
        yield from map(function, chain(first, rest))
        return
    with ProcessPoolExecutor(jobs, initializer=_begin, initargs=(pickle.dumps(function),)) as pool:
        waiting: deque[Future[R]] = deque()
        try:
            # a queue of results in order: the oldest is waited for when enough are under way
            for item in chain(first, rest):
                waiting.append(pool.submit(_do, item))
                if len(waiting) > 4 * jobs:
                    yield waiting.popleft().result()
            while waiting:
                yield waiting.popleft().result()
        except BrokenProcessPool as error:
            reason = "a process was killed, as where memory is short: give fewer --jobs"
            raise MotetError(reason) from error
        finally:
            pool.shutdown(cancel_futures=True)


def in_batches(
    function: Callable[[Sequence[T]], Sequence[R]], items: Sequence[T], jobs: int | None, most: int
) -> Iterator[R]:
    """The results of a function of batches, of at most ``most`` things each, one for each thing; else as
    :func:`in_order`."""
    jobs = 1 if len(items) < FEW else cores() if jobs is None else jobs
    yield from chain.from_iterable(in_order(function, batches(items, jobs, most), jobs, few=1))


def batches(items: Sequence[T], jobs: int, most: int) -> Iterator[Sequence[T]]:
    """Things in batches of at most ``most``, and for several processes of a quarter of each one's share of the rest,
    so that all end at once."""
    start = 0
    while start < len(items):
        share = most if jobs == 1 else (len(items) - start) // (4 * jobs)
        stop = start + max(1, min(most, share))
        yield items[start:stop]
        start = stop


@dataclass(frozen=True)
class Shard:
    """One of several parts of many things, such as files: every ``count``-th from the ``number``-th."""

    number: int = 1
    count: int = 1

    @staticmethod
    def parse(text: str) -> "Shard":
        """Read "3/16"; SettingError for anything else."""
        match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise SettingError(f"a shard is a number and how many there are, such as 3/16, not {text!r}")
        return Shard(int(match[1]), int(match[2]))

    def of(self, things: Sequence[T]) -> Sequence[T]:
        """Those of this shard."""
        return things[self.number - 1 :: self.count]

    def __str__(self) -> str:
        return f"{self.number}/{self.count}"


def cores() -> int:
    """How many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _begin(function: bytes) -> None:
    global _sent  # noqa: PLW0603  sent once, not with each thing
    _sent = function
    _function.cache_clear()
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # an interrupt is for the first process, which then ends the others


@cache
def _function() -> Callable[[Any], Any]:
    function: Callable[[Any], Any] = pickle.loads(_sent)
    return function


def _do(item: Any) -> Any:
    return _function()(item)
