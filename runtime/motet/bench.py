"""How fast a model runs here: whole calls as a user makes them, Python included."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from motet.control import ControlModel

BATCHES = (64, 256, 512, 1024, 2048, 4096)
"""Numbers of characters among which the best is looked for."""


@dataclass(frozen=True)
class Row:
    """One figure; ``baseline`` is the same figure of torch eager where torch is present, ``ratio`` how much better."""

    name: str
    value: float
    unit: str
    baseline: float | None = None
    ratio: float | None = None

    def to_json(self) -> dict[str, Any]:
        """A JSON object with the fields as keys."""
        return asdict(self)


def durations(call: Callable[[], object], seconds: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Seconds of each call, over about ``seconds`` (at least ten calls) after a warm-up of a tenth of that."""
    _until(call, seconds / 10)
    return np.array(_until(call, seconds))


def _until(call: Callable[[], object], seconds: float) -> list[float]:
    taken: list[float] = []
    end = time.perf_counter() + seconds
    while len(taken) < 10 or time.perf_counter() < end:
        start = time.perf_counter()
        call()
        taken.append(time.perf_counter() - start)
    return taken


def control_figures(model: ControlModel, seconds: float) -> dict[str, tuple[float, str]]:
    """One character's tick (median and 99th percentile) and the frame rate at the best batch, plain and sampled."""
    tick = durations(model.start().step, seconds) * 1e6
    figures = {
        "control.tick": (float(np.median(tick)), "us"),
        "control.tick_p99": (float(np.percentile(tick, 99)), "us"),
    }
    for name, variety in (("control.frames", 0.0), ("control.frames_sampled", 1.0)):
        rates = {batch: _rate(model, batch, variety, seconds / 3) for batch in BATCHES}
        best = max(rates, key=rates.__getitem__)
        figures[name] = (rates[best], "frames/s")
        figures[f"{name}_batch"] = (float(best), "characters")
    return figures


def _rate(model: ControlModel, batch: int, variety: float, seconds: float) -> float:
    session = model.start(characters=batch, variety=variety)
    return batch / float(np.median(durations(session.step, seconds)))


def rows(figures: dict[str, tuple[float, str]], baseline: dict[str, tuple[float, str]] | None) -> list[Row]:
    """Figures beside those of the baseline; a ratio above 1 is in favour of the figure, for times as for rates."""
    result = []
    for name, (value, unit) in figures.items():
        other = baseline[name][0] if baseline else None
        ratio = None if other is None or unit == "characters" else (other / value if unit == "us" else value / other)
        result.append(Row(name, value, unit, other, ratio))
    return result
