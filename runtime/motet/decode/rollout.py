"""The free run: a step graph whose outputs become its next inputs."""

from typing import Any

from numpy.typing import NDArray

from motet.graph import Arrays, Graph

State = dict[str, NDArray[Any]]


def advance(step: Graph, state: State, inputs: Arrays) -> tuple[dict[str, NDArray[Any]], State]:
    """One time step for a whole batch: the step's outputs, and the state for the next one.

    ``state`` holds the fed back inputs by name, ``inputs`` all others. Neither is changed.
    """
    outputs = step({**state, **inputs})
    return outputs, {name: outputs[source] for name, source in step.spec.feedback.items()}
