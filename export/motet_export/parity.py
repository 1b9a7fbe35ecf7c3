"""The parity ladder: ONNX Runtime computes what torch does, from the contract up to complete runs.

An error is the largest |a - b| of an output, over the root mean square of b or over |b| itself where those are above 1
(frames in degrees, cells of an LSTM): float32 rounds in proportion to what it rounds.
Every rung raises ExportError where its bound is exceeded, so a bundle that differs is never written.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.golden import difference
from motet.bundle.graph import Graph
from motet.decode.loop import advance
from motet.errors import BundleError
from motet_export.examples import Examples, example
from motet_export.exporter import ExportError

CARRIED = 1e-4
"""Bound on the error after many carried steps or a whole run."""

Arrays = Mapping[str, NDArray[Any]]


def error(found: Arrays, expected: Arrays) -> float:
    """The largest |a - b| / max(1, RMS of b, |b|) over arrays of equal names.

    ExportError where shapes or dtypes differ, or a value is not finite.
    """
    try:
        return difference(found, expected)
    except BundleError as fault:
        raise ExportError(str(fault)) from fault


def check_one_step(name: str, onnx: Graph, torch: Graph, draw: Examples | None = None) -> dict[str, Any]:
    """Rung 1 and 2: equal contracts, and one call at batch sizes 1, 1,000 and three random ones, of inputs drawn."""
    if onnx.spec != torch.spec:
        raise ExportError(f"{name}: the contracts differ: {onnx.spec} and {torch.spec}")
    draw = draw or partial(example, torch.spec)
    rng = np.random.default_rng(1)
    batches = [1, 1000, *(int(batch) for batch in rng.integers(2, 100, 3))]
    errors = [error(onnx(feeds), torch(feeds)) for feeds in (draw(rng, batch) for batch in batches)]
    return _bounded(f"{name}.one_step", max(errors), 1e-5, batches=batches)


def check_carried(
    onnx: Graph, torch: Graph, draw: Examples | None = None, horizon: int | None = None, batch: int = 16
) -> dict[str, Any]:
    """Rung 3: 200 steps, the state carried by each on its own, under the same inputs.

    draw: gives the first state, and the other inputs anew for every step. horizon: after so many steps all begins
    anew, and until then other inputs stay the same: so a predictor is used, whose encoder is asked again. "rounding" in
    the report is how far torch comes from itself when the last bits of the states change at every step.
    """
    steps, draw, feedback = 200, draw or partial(example, torch.spec), torch.spec.feedback
    rng, largest, rounding = np.random.default_rng(2), 0.0, 0.0
    for n in range(steps):
        if n % (horizon or 1) == 0:
            inputs = draw(rng, batch)
        if n % (horizon or steps) == 0:
            states = [{name: inputs[name] for name in feedback}] * 3
        given = {name: value for name, value in inputs.items() if name not in feedback}
        states[2] = _nudged(states[2], rng)
        (found, states[0]), (expected, states[1]), (nudged, states[2]) = (
            advance(graph, state, given) for graph, state in zip((onnx, torch, torch), states, strict=True)
        )
        largest, rounding = max(largest, error(found, expected)), max(rounding, error(nudged, expected))
    # a net that amplifies rounding is held to ten times its own; one that does so more cannot be compared
    bound = min(max(CARRIED, 10 * rounding), 1e-2)
    return _bounded("step.carried", largest, bound, rounding=rounding, steps=steps, horizon=horizon, batch=batch)


def _nudged(state: Arrays, rng: np.random.Generator) -> dict[str, NDArray[Any]]:
    """A state whose numbers have moved to one of their two neighbours in float32."""
    ends = np.array([-np.inf, np.inf], dtype=np.float32)
    return {
        name: np.nextafter(values, rng.choice(ends, values.shape)) if values.dtype == np.float32 else values
        for name, values in state.items()
    }


def check_runs(runs: Mapping[str, Callable[[], tuple[Arrays, Arrays]]]) -> dict[str, Any]:
    """Rung 4: whole decoded runs with the same seeds; each callable gives what ONNX and what torch decoded."""
    errors = {name: error(*run()) for name, run in runs.items()}
    return _bounded("runs", max(errors.values()), CARRIED, **errors)


def _bounded(name: str, largest: float, bound: float, **details: Any) -> dict[str, Any]:
    if not largest <= bound:
        raise ExportError(f"parity {name}: the error is {largest:.2e}, the bound {bound:.0e} ({details})")
    return {"error": largest, "bound": bound, **details}
