"""Random inputs of a graph that keep its contract: ids within the vocabulary, lengths within the sequence."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.graph import GraphSpec

LONGEST = 12
"""Of an axis other than the batch."""


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
