"""Random inputs of graphs: numbers that keep a graph's contract, and frames as likely as the training data's."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Graph, GraphSpec
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract

LONGEST = 12
"""Of an axis other than the batch."""

PACE = 0.1
"""Of a random walk from frame to frame, in standard deviations of the training data."""

Examples = Callable[[np.random.Generator, int], Arrays]
"""Draws all inputs of a graph for so many rows."""


def examples(manifest: Mapping[str, Any], torch: Mapping[str, Graph]) -> dict[str, Examples]:
    """What draws the inputs of each graph, by role.

    :func:`example`, but for predictors: their encoder gets :func:`walks`, their step what the encoder makes of them in
    torch. They were trained on motions, and from numbers far from any a net that feeds its frames back can make much
    of a rounding.
    """
    if manifest["verb"] != "predict":
        words = len(manifest.get("vocabulary", "-"))
        return {role: partial(example, graph.spec, vocabulary=words) for role, graph in torch.items()}
    encoder, contract = torch["encoder"], MotionContract.from_json(manifest["motion"])
    frames = encoder.spec.input("frames").size(1)

    def seeds(rng: np.random.Generator, rows: int) -> Arrays:
        return {"frames": walks(contract, rng, rows, frames)}

    return {"encoder": seeds, "step": lambda rng, rows: encoder(seeds(rng, rows))}


def example(spec: GraphSpec, rng: np.random.Generator, batch: int, vocabulary: int = 1) -> dict[str, NDArray[Any]]:
    """All inputs of ``spec`` for ``batch`` rows: numbers uniform in [0.05, 1), ids below ``vocabulary``.

    Every dynamic axis but "batch" gets a random size of up to :data:`LONGEST`, the same for all inputs.
    """
    axes = [axis for tensor in spec.inputs for axis in tensor.shape[1:] if isinstance(axis, str)]
    sizes = {axis: int(rng.integers(1, LONGEST + 1)) for axis in dict.fromkeys(axes)}
    sizes["batch"] = batch
    found: dict[str, NDArray[Any]] = {}
    for tensor in spec.inputs:
        shape = [sizes[axis] if isinstance(axis, str) else axis for axis in tensor.shape]
        if tensor.dtype == "float32":
            found[tensor.name] = rng.uniform(0.05, 1.0, shape).astype(np.float32)
        elif tensor.name == "lengths":
            found[tensor.name] = rng.integers(1, sizes[axes[0]] + 1, shape)
        else:
            found[tensor.name] = rng.integers(0, vocabulary, shape)
    return found


def walks(contract: MotionContract, rng: np.random.Generator, rows: int, frames: int) -> NDArray[np.float32]:
    """Random walks (rows, frames, C) float32 from near the mean of the training data, in the contract's units."""
    steps = PACE * rng.normal(size=(rows, frames, len(contract.mean)))
    found: Array = contract.mean + contract.std * steps.cumsum(axis=1)
    return found.astype(np.float32)
