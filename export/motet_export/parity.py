"""The parity ladder: ONNX Runtime computes what torch does, from the contract up to complete runs.

An error is the largest |a - b| of an output, over the root mean square of b or over |b| itself where those are above 1
(frames in degrees, cells of an LSTM): float32 rounds in proportion to what it rounds.
Both sides are built by themselves: torch's from the run, with the run's manifest, ONNX Runtime's from the bundle. So
the words, channels, rate and statistics that the bundle declares are compared, too.
Inputs are random numbers that keep a graph's contract, and frames as likely as the training data's; and, on a rung of
their own, some that are not likely at all: zeros, ones, negatives, and single numbers far from all data, as a glitch of
a recording gives.
Every rung raises ExportError where its bound is exceeded, so a bundle that differs is never written.
"""

import json
import math
import pickle
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, partial
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Json
from motet.bundle.golden import difference
from motet.bundle.graph import Arrays, Floats, Graph, GraphSpec
from motet.bundle.manifest import Manifest
from motet.decode.loop import State, advance
from motet.errors import BundleError
from motet.models.base import BundleModel
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.placed import placed_by_way
from motet_export.exporter import ExportError

ONE_STEP_TOLERANCE = 1e-5
"""Bound on the error of one call."""

AMPLIFIED_TOLERANCE = 1e-3
"""The same where torch itself differs as much when the last bits of its inputs change."""

CARRIED_TOLERANCE = 1e-4
"""Bound on the error after many carried steps or a whole run."""

CARRIED_STEPS = 200
"""Steps whose state is carried."""

FAR_DEVIATIONS = (10.0, 1000.0)
"""Standard deviations from the mean, between which numbers far from all data lie: nets clip at 50."""

FRAME_INPUTS = ("frames", "frame", "history")
"""Inputs that are frames, or codes of frames: they are drawn like the training data's."""

RANGED = ("noise", "variety", "temperature", "past", "plain", "after")
"""Inputs that zeros, ones or negatives are no numbers for: noise in [0, 1), variety in [0, 1], temperatures above 0;
and frames beside a gap, with rotations by two columns, which must not be parallel."""

MEANING_FIELDS = ("verb", "model", "loop", "motion", "text", "vocabulary", "common", "control", "defaults", "config")
"""What a manifest says of a model's numbers."""

Examples = Callable[[np.random.Generator, int], Arrays]
"""Draws all inputs of a graph for so many rows."""


def error(computed: Arrays, expected: Arrays) -> float:
    """The largest |a - b| / max(1, RMS of b, |b|) over arrays of equal names.

    ExportError where shapes or dtypes differ, or a value is not finite.
    """
    try:
        return difference(computed, expected)
    except BundleError as fault:
        raise ExportError(str(fault)) from fault


def check_meaning(onnx: BundleModel, torch: BundleModel) -> None:
    """Rung 0: the bundle says of its numbers what the run says; ExportError names what differs."""
    # as JSON, in which a tuple is a list
    declared, trained = (json.loads(json.dumps(model.manifest.source)) for model in (onnx, torch))
    for part in MEANING_FIELDS:
        if declared.get(part) != trained.get(part):
            raise ExportError(f"parity: the bundle's {_difference(part, declared, trained)} is not the run's")
    for kind in onnx.SETTINGS:
        if kind.FEATURE in trained.get("settings", {}) and onnx.settings(kind) != torch.settings(kind):
            raise ExportError(f"parity: the bundle's settings.{kind.FEATURE} is not the run's")


def _difference(part: str, declared: Json, trained: Json) -> str:
    """The name of a part of two manifests, with the first key whose values differ where it is an object."""
    in_bundle = declared.get(part)
    in_run = trained.get(part)
    if not isinstance(in_bundle, Mapping) or not isinstance(in_run, Mapping):
        return part
    keys = {**in_bundle, **in_run}
    return next(f"{part}.{key}" for key in keys if in_bundle.get(key) != in_run.get(key))


def check_one_step(name: str, onnx: Graph, torch: Graph, draw: Examples | None = None) -> Json:
    """Rung 1: equal contracts, and one call at batch sizes 1, 1,000 and three random ones, of inputs drawn.

    A graph that amplifies the last bits of its inputs, as one that aims bones at points does, is held to ten times what
    torch makes of their change ("rounding").
    """
    if onnx.spec != torch.spec:
        raise ExportError(f"{name}: the contracts differ: {onnx.spec} and {torch.spec}")
    draw = draw or partial(example, torch.spec)
    rng = np.random.default_rng(1)
    batches = [1, 1000, *(int(batch) for batch in rng.integers(2, 100, 3))]
    largest = 0.0
    rounding = 0.0
    for batch in batches:
        feeds = draw(rng, batch)
        expected = torch(feeds)
        apart = error(onnx(feeds), expected)
        largest = max(largest, apart)
        if apart > ONE_STEP_TOLERANCE:
            rounding = max(rounding, error(torch(nudged(feeds, np.random.default_rng(8))), expected))
    bound = min(max(ONE_STEP_TOLERANCE, 10 * rounding), AMPLIFIED_TOLERANCE)
    details = {"rounding": rounding} if rounding else {}
    return _bounded(f"{name}.one_step", largest, bound, batches=batches, **details)


def check_far(name: str, onnx: Graph, torch: Graph, draw: Examples) -> Json:
    """Rung 2: calls with inputs that are far from all data. "rounding" is how far torch comes from itself when their
    last bits change, and zeros by a millionth; a graph that amplifies this, as divisions by small numbers and the
    logarithm of a still figure's movement do, is held to ten times its own."""
    rng = np.random.default_rng(7)
    batches = [4, 100]
    largest = 0.0
    rounding = 0.0
    for batch in batches:
        feeds = draw(rng, batch)
        expected = torch(feeds)
        largest = max(largest, error(onnx(feeds), expected))
        rounding = max(rounding, error(torch(nudged(feeds, np.random.default_rng(8), of_zero=1e-6)), expected))
    bound = min(max(1e-5, 10 * rounding), 1e-2)
    return _bounded(f"{name}.far", largest, bound, rounding=rounding, batches=batches)


def check_carried(
    onnx: Graph, torch: Graph, draw: Examples | None = None, horizon: int | None = None, batch: int = 16
) -> Json:
    """Rung 3: 200 steps, the state carried by each on its own, under the same inputs.

    draw: gives the first state, and the other inputs anew for every step. horizon: after so many steps all begins
    anew, and until then other inputs stay the same: so a predictor is used, whose encoder is asked again. "rounding" in
    the report is how far torch comes from itself when the last bits of the states change at every step.
    """
    draw = draw or partial(example, torch.spec)
    rng = np.random.default_rng(2)
    largest = 0.0
    rounding = 0.0
    for n in range(CARRIED_STEPS):
        if n % (horizon or 1) == 0:
            inputs = draw(rng, batch)
        if n % (horizon or CARRIED_STEPS) == 0:
            states = [{name: inputs[name] for name in torch.spec.feedback}] * 3

        # three runs: ONNX Runtime's, torch's, and torch's with other last bits
        others = {name: value for name, value in inputs.items() if name not in torch.spec.feedback}
        states[2] = nudged(states[2], rng)
        computed, states[0] = advance(onnx, states[0], others)
        expected, states[1] = advance(torch, states[1], others)
        moved, states[2] = advance(torch, states[2], others)
        largest = max(largest, error(computed, expected))
        rounding = max(rounding, error(moved, expected))

    # a net that amplifies rounding is held to ten times its own; one that does so more cannot be compared
    bound = min(max(CARRIED_TOLERANCE, 10 * rounding), 1e-2)
    return _bounded(
        "step.carried", largest, bound, rounding=rounding, steps=CARRIED_STEPS, horizon=horizon, batch=batch
    )


def nudged(state: Arrays, rng: np.random.Generator, of_zero: float = 0.0) -> State:
    """A state whose numbers have moved to one of their two neighbours in float32, and zeros by ``of_zero``."""
    ends = np.array([-np.inf, np.inf], dtype=np.float32)
    moved = dict(state)
    for name, values in state.items():
        if values.dtype == np.float32:
            towards = rng.choice(ends, values.shape)
            from_zero = np.copysign(np.float32(of_zero), towards)
            moved[name] = np.where(values == 0, from_zero, np.nextafter(values, towards))
    return moved


def check_runs(runs: Mapping[str, Callable[[], tuple[Arrays, Arrays]]]) -> Json:
    """Rung 4: whole decoded runs with the same seeds; each callable gives what ONNX and what torch decoded."""
    errors = {name: error(*run()) for name, run in runs.items()}
    return _bounded("runs", max(errors.values()), CARRIED_TOLERANCE, **errors)


def _bounded(name: str, largest: float, bound: float, **details: Any) -> Json:
    if not largest <= bound:
        raise ExportError(f"parity {name}: the error is {largest:.2e}, the bound {bound:.0e} ({details})")
    return {"error": largest, "bound": bound, **details}


def examples(manifest: Manifest, torch: Mapping[str, Graph], far: bool = False) -> dict[str, Examples]:
    """What draws the inputs of each graph, by role: :func:`example`, with frames as likely as the training data's.

    far: of frames some numbers are :func:`strained`, and there are :func:`extremes` among four rows or more.
    A history of codes is what the encoder makes of such frames in torch; and a predictor's other graphs get what its
    encoder gives: from numbers far from any frames a net that feeds its frames back can make much of a rounding.
    """
    inputs = _Inputs(manifest, torch, far)
    draws: dict[str, Examples] = {}
    for role, graph in torch.items():
        predicted = manifest.verb == "predict" and role != "encoder"
        draws[role] = partial(inputs.from_encoder if predicted else inputs.draw, graph.spec)
    return draws


class Once:
    """A graph that computes equal calls once: a predictor's encoder is called to be compared, and then again for the
    inputs of its step. What it gives is not to be changed."""

    def __init__(self, graph: Graph) -> None:
        self.spec = graph.spec
        self._kept = cache(lambda feeds: graph(pickle.loads(feeds)))

    def __call__(self, feeds: Arrays) -> State:
        """As the graph."""
        return self._kept(pickle.dumps(feeds))


@dataclass(frozen=True)
class _Inputs:
    """Draws the inputs of the graphs of a model, see :func:`examples`."""

    manifest: Manifest
    graphs: Mapping[str, Graph]
    far: bool

    def draw(self, spec: GraphSpec, rng: np.random.Generator, rows: int) -> Arrays:
        """The inputs of a graph."""
        inputs = example(spec, rng, rows, _below(self.manifest))
        for name, value in inputs.items():
            if name == "history":
                inputs[name] = self._history(value.shape, rng)
            elif name in FRAME_INPUTS:
                inputs[name] = self._frames(value.shape, rng)
            if self.far and value.dtype == np.float32 and name not in RANGED:
                inputs[name] = extremes(inputs[name])
        return inputs

    def _history(self, shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[Any]:
        """Codes as the encoder makes them of frames."""
        frames = walks(self.manifest.motion, rng, *shape[:2])
        feeds = {"frames": frames.reshape(-1, frames.shape[2])}
        return self.graphs["encoder"](feeds)["codes"].reshape(shape)

    def _frames(self, shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[Any]:
        """Frames of a shape; normalised and with a flag each, as generators take them, if the shape has one more."""
        contract = self.manifest.motion
        walk = walks(contract, rng, shape[0], math.prod(shape[1:-1]))
        frames = (strained(walk, contract, rng) if self.far else walk).reshape(*shape[:-1], -1)
        if frames.shape == shape:
            return frames
        flags = np.ones((*shape[:-1], 1), dtype=np.float32)
        return np.concatenate([contract.normalised(frames).astype(np.float32), flags], axis=-1)

    def from_encoder(self, spec: GraphSpec, rng: np.random.Generator, rows: int) -> Arrays:
        """The inputs of a graph that takes those of the encoder, and what this gives."""
        encoder = self.graphs["encoder"]
        inputs = self.draw(encoder.spec, rng, rows)
        tensors = {**inputs, **encoder(inputs)}
        return {name: value for name, value in tensors.items() if spec.takes(name)}


def example(spec: GraphSpec, rng: np.random.Generator, batch: int, below: Mapping[str, int] | None = None) -> State:
    """All inputs of ``spec`` for ``batch`` rows: numbers uniform in [0.05, 1), ids 0, or ``below`` a limit by name.

    Every dynamic axis but "batch" gets a random size of up to 12, the same for all inputs.
    """
    # the sizes of dynamic axes
    axes = chain.from_iterable(tensor.shape[1:] for tensor in spec.inputs)
    dynamic = list(dict.fromkeys(axis for axis in axes if isinstance(axis, str)))
    sizes = {axis: int(rng.integers(1, 13)) for axis in dynamic}
    sizes["batch"] = batch

    # numbers, lengths of the first of these axes, and ids
    inputs: State = {}
    for tensor in spec.inputs:
        shape = [sizes[axis] if isinstance(axis, str) else axis for axis in tensor.shape]
        if tensor.dtype == "float32":
            inputs[tensor.name] = rng.uniform(0.05, 1.0, shape).astype(np.float32)
        elif tensor.name == "lengths":
            inputs[tensor.name] = rng.integers(1, sizes[dynamic[0]] + 1, shape)
        else:
            inputs[tensor.name] = rng.integers(0, (below or {}).get(tensor.name, 1), shape)
    return inputs


def _below(manifest: Manifest) -> dict[str, int]:
    """How many different whole numbers an input may have, by its name."""
    words = max(1, len(manifest.vocabulary))
    below = {"words": words, "word": words}
    if manifest.loop == "codes":
        sizes = manifest.config
        codes = min(sizes["codec"]["moves"], math.prod(sizes["codec"]["levels"]))
        below |= {"codes": codes, "action": sizes["text"]["actions"] + 1, "age": sizes["writer"]["ages"]}
    return below


def walks(contract: MotionContract, rng: np.random.Generator, rows: int, frames: int) -> Floats:
    """Random walks (rows, frames, C) float32 from near the mean of the training data, in the contract's units."""
    steps = 0.1 * rng.normal(size=(rows, frames, len(contract.mean)))
    walk: Array = contract.mean + contract.std * steps.cumsum(axis=1)
    return walk.astype(np.float32)


def strained(frames: Floats, contract: MotionContract, rng: np.random.Generator) -> Floats:
    """Frames (..., C) of which single numbers, but one at least, are at ``FAR_DEVIATIONS`` standard deviations from the
    mean."""
    # which numbers: one in a hundred, at least one of them
    far = rng.random(frames.shape) < 0.01
    far.flat[rng.integers(far.size)] = True

    # to either side, and as often near as very far
    low, high = np.log10(FAR_DEVIATIONS)
    off = 10 ** rng.uniform(low, high, frames.shape) * rng.choice([-1.0, 1.0], frames.shape)
    std = np.where(contract.std > 0, contract.std, 1.0)
    return np.where(far, contract.mean + std * off, frames).astype(np.float32)


def extremes(values: NDArray[Any]) -> NDArray[Any]:
    """Rows (B, ...), of four or more of which the first is all zeros, the second all ones, the third negative."""
    if len(values) < 4:
        return values
    rows = values.copy()
    rows[0] = 0
    rows[1] = 1
    rows[2] = -np.abs(values[2])
    return rows


def sides(contract: MotionContract, rng: np.random.Generator, frames: int) -> tuple[Floats, Floats]:
    """Placed frames (frames, E) before a gap, and as many after it: both ends of a random walk in ``root_sixd``."""
    walk = walks(contract, rng, 1, 2 * frames)[0].astype(np.float64)
    past, after = np.split(placed_by_way(walk, contract.fps).astype(np.float32), 2)
    return past, after
