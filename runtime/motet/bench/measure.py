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
    def of(seconds: "Taken") -> "Times":
        """Of the seconds that calls took."""
        wall = 1e3 * seconds.wall
        p95, p99 = np.percentile(wall, (95, 99)).tolist()
        return Times(float(np.median(wall)), float(wall.mean()), p95, p99, 1e3 * seconds.processor / len(wall))


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
    names = dict.fromkeys(case.name for case in next(iter(cases.values())))
    return [
        _row({rival: [case for case in of if case.name == name] for rival, of in cases.items()}, seconds)
        for name in names
    ]


def _row(cases: Mapping[str, Sequence[Case]], seconds: float) -> Row:
    us = next(iter(cases))
    chosen = {rival: case for rival, of in cases.items() if (case := _fastest(rival, of, seconds, must=rival == us))}
    rounds = [{rival: taken(case.call, seconds / ROUNDS) for rival, case in chosen.items()} for _ in range(ROUNDS)]
    middle = [{rival: np.median(calls.wall) / chosen[rival].count for rival, calls in of.items()} for of in rounds]
    times = {rival: Times.of(_joined([of[rival] for of in rounds])) for rival in chosen}
    worked = {rival: times[rival].processor / case.count for rival, case in chosen.items()}
    beside = {
        rival: Beside(
            case.value(times[rival].median / 1e3),
            float(np.median([of[rival] / of[us] for of in middle])),
            worked[rival] / max(worked[us], 1e-9),  # its clock may be a coarse one
            times[rival].p99,
        )
        for rival, case in chosen.items()
        if rival != us
    }
    case = chosen[us]
    return Row(case.name, case.value(times[us].median / 1e3), case.unit, case.count, times[us], beside)


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


def _joined(parts: Sequence[Taken]) -> Taken:
    return Taken(np.concatenate([part.wall for part in parts]), sum(part.processor for part in parts))
