"""What all decoding loops share: a step graph whose outputs become its next inputs."""

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Graph

State = dict[str, NDArray[Any]]
Scores = NDArray[np.float64]
Ids = NDArray[np.int64]


def advance(step: Graph, state: State, inputs: Arrays) -> tuple[dict[str, NDArray[Any]], State]:
    """One time step for a whole batch: the step's outputs, and the state for the next one.

    ``state`` holds the fed back inputs by name, ``inputs`` all others. Neither is changed.
    """
    outputs = step({**state, **inputs})
    return outputs, {name: outputs[source] for name, source in step.spec.feedback.items()}


def zero_state(step: Graph, rows: int, given: Collection[str] = ()) -> State:
    """The fed back inputs (rows, ...) of a step before the first one, but for those ``given``: zeros.

    A state that grows starts with the sizes that the contract says, 0 along the axis that it grows on.
    """
    names = [name for name in step.spec.feedback if name not in given]
    return {name: np.zeros((rows, *step.spec.start_shape(name)), dtype=step.spec.input(name).dtype) for name in names}


def two_rows(indices: Ids) -> Ids:
    """Indices of the rows to run, a single one twice.

    A matrix product rounds a single row differently from a row among others; so a row gives, to the bit and with one
    thread, what it gives in any batch.
    """
    return np.repeat(indices, 2) if len(indices) == 1 else indices
