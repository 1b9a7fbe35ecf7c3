"""The free run: a step graph whose outputs become its next inputs."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Graph

State = dict[str, NDArray[Any]]


def advance(step: Graph, state: State, inputs: Arrays) -> tuple[dict[str, NDArray[Any]], State]:
    """One time step for a whole batch: the step's outputs, and the state for the next one.

    ``state`` holds the fed back inputs by name, ``inputs`` all others. Neither is changed.
    """
    outputs = step({**state, **inputs})
    return outputs, {name: outputs[source] for name, source in step.spec.feedback.items()}


def free_run(encoder: Graph, step: Graph, seed: NDArray[np.float32], count: int, horizon: int) -> NDArray[np.float32]:
    """The ``count`` frames (B, count, C) float32 that follow the seed frames (B, L, C) float32.

    What the encoder gives are the step's inputs, by name: those that are fed back begin there, others stay. After
    every ``horizon`` frames the encoder is asked again, about the L frames before.
    """
    given = seed.shape[1]
    frames = np.concatenate([seed, np.empty((len(seed), count, seed.shape[2]), dtype=np.float32)], axis=1)
    for n in range(count):
        if n % horizon == 0:
            found = encoder({"frames": np.ascontiguousarray(frames[:, n : n + given])})
            state = {name: found[name] for name in step.spec.feedback}
            constant = {name: value for name, value in found.items() if name not in state}
        outputs, state = advance(step, state, constant)
        frames[:, n + given] = outputs["frame"]
    return frames[:, given:]


def zero_state(step: Graph, rows: int) -> State:
    """The fed back inputs (rows, ...) float32 of a step before the first one: zeros."""
    specs = [step.spec.input(name) for name in step.spec.feedback]
    shapes = {spec.name: [spec.size(axis) for axis in range(1, len(spec.shape))] for spec in specs}
    return {name: np.zeros((rows, *shape), dtype=np.float32) for name, shape in shapes.items()}


def two_rows(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Indices of rows to run, a lone one twice.

    A matrix product rounds a lone row otherwise than a row among others; so a row gives, to the bit and with one
    thread, what it gives in any batch.
    """
    return np.repeat(indices, 2) if len(indices) == 1 else indices
