"""Calls measured: by the clock, by the processor, and in turn with those of others."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

log = logging.getLogger(__name__)

Call = Callable[[], object]

SCALE = {"s": 1.0, "ms": 1e3, "us": 1e6}
"""Of times of calls; all other units of calls are things a second."""

LESS = (*SCALE, "MB")
"""Units where less is better."""

ROUNDS = 3
"""How often each row is measured, in turn with torch's, so that what else runs disturbs all alike."""


@dataclass(frozen=True)
class Case:
    """A call to measure, which does ``count`` things; those of one name differ in that, and the fastest counts.

    unit: a time, of one call, or what it does a second.
    """

    name: str
    call: Call
    unit: str = "ms"
    count: int = 1

    def value(self, seconds: float) -> float:
        """In the case's unit, of the seconds of a call."""
        return seconds * SCALE[self.unit] if self.unit in SCALE else self.count / seconds


@dataclass(frozen=True)
class Times:
    """Milliseconds of a call: by the clock, and of all processors together (``processor``, the mean)."""

    median: float
    mean: float
    p95: float
    p99: float
    processor: float

    @staticmethod
    def of(rounds: "Sequence[Taken]") -> "Times":
        """Of the calls of all rounds."""
        wall = 1e3 * np.concatenate([calls.wall for calls in rounds])
        processor = 1e3 * sum(calls.processor for calls in rounds) / len(wall)
        p95, p99 = np.percentile(wall, (95, 99)).tolist()
        return Times(float(np.median(wall)), float(wall.mean()), p95, p99, processor)


@dataclass(frozen=True)
class Beside:
    """The same row of torch: its value, how much better ours is by the clock and by time of the processors, which other
    programs disturb least (above 1: ours), and its 99th percentile in ms."""

    value: float
    ratio: float
    processor_ratio: float
    p99: float


@dataclass(frozen=True)
class Row:
    """One figure: the median in its unit, with the batch it was found at; ``beside``: torch's, eager and compiled.

    gflop: operations of a call in the products of its graphs, in 1e9; share: of the machine's ceiling reached by them.
    parts: milliseconds of a call in each kind of kernel, in the rest of ONNX Runtime, and in Python with numpy.
    """

    name: str
    value: float
    unit: str
    batch: int = 1
    times: Times | None = None
    beside: Mapping[str, Beside] = field(default_factory=dict)
    gflop: float | None = None
    share: float | None = None
    parts: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Taken:
    """Seconds of each call by the clock, and of the processor for all of them."""

    wall: "np.ndarray[tuple[int], np.dtype[np.float64]]"
    processor: float


def taken(call: Call, seconds: float, least: int = 2) -> Taken:
    """What calls take, over about ``seconds`` (at least ``least`` calls) after a warm-up of a tenth of that."""
    for limit, count in ((seconds / 10, 1), (seconds, least)):
        wall = list[float]()
        end = time.perf_counter() + limit
        before = time.process_time()
        while len(wall) < count or time.perf_counter() < end:
            start = time.perf_counter()
            call()
            wall.append(time.perf_counter() - start)
    return Taken(np.array(wall), time.process_time() - before)


def compared(cases: Mapping[str, Sequence[Case]], seconds: float) -> list[Row]:
    """The rows of our cases, the first, beside those of others by the same names, measured in turn for about
    ``seconds`` each. A ratio is the median of those of the rounds. Who fails at a row is left out of it."""
    rows = []
    for name in dict.fromkeys(case.name for case in next(iter(cases.values()))):
        of_name = {}
        for rival, rival_cases in cases.items():
            of_name[rival] = [case for case in rival_cases if case.name == name]
        rows.append(_row(of_name, seconds))
    return rows


def _row(cases: Mapping[str, Sequence[Case]], seconds: float) -> Row:
    """The row of our cases of one name, the first, beside those of others."""
    us = next(iter(cases))
    chosen = {}
    for rival, rival_cases in cases.items():
        fastest = _fastest(rival, rival_cases, seconds, must=rival == us)
        if fastest is not None:
            chosen[rival] = fastest
    # all in turn, so that what else runs disturbs all alike
    rounds = {rival: list[Taken]() for rival in chosen}
    for _ in range(ROUNDS):
        for rival, case in chosen.items():
            rounds[rival].append(taken(case.call, seconds / ROUNDS))
    ours = chosen.pop(us)
    beside = {rival: _beside(case, rounds[rival], ours, rounds[us]) for rival, case in chosen.items()}
    times = Times.of(rounds[us])
    return Row(ours.name, ours.value(times.median / 1e3), ours.unit, ours.count, times, beside)


def _beside(case: Case, rounds: Sequence[Taken], ours: Case, our_rounds: Sequence[Taken]) -> Beside:
    """A case of torch's beside ours, each by its rounds."""
    ratios = []
    for calls, our_calls in zip(rounds, our_rounds, strict=True):
        ratios.append((np.median(calls.wall) / case.count) / (np.median(our_calls.wall) / ours.count))
    times = Times.of(rounds)
    worked = times.processor / case.count
    our_work = max(Times.of(our_rounds).processor / ours.count, 1e-9)  # its clock may be a coarse one
    return Beside(case.value(times.median / 1e3), float(np.median(ratios)), worked / our_work, times.p99)


def _fastest(rival: str, cases: Sequence[Case], seconds: float, must: bool) -> Case | None:
    """The case that does the most a second; None, with a word, where they fail and need not work."""
    try:
        speed = [case.count / float(taken(case.call, seconds / 10, 1).wall.min()) for case in cases]
    except Exception as error:  # torch.compile fails with classes of many packages, where there is no compiler
        if must:
            raise
        log.warning("%s: %s is left out: %s", cases[0].name, rival, str(error).strip().partition("\n")[0])
        return None
    return cases[int(np.argmax(speed))]
