"""The loop ``session``: the next frame of figures that the thesis' net moves, after a chain of Gibbs iterations."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode.loop import Loop
from motet.settings import Range, Settings


@dataclass(frozen=True)
class TickSettings(Settings):
    """temperature: divides what goes into the sigmoids. iterations: Gibbs iterations of a tick."""

    temperature: Annotated[float, Range(0.01, 100)]
    iterations: Annotated[int, Range(1, 100)] = 1


def tick(step: Graph, history: Floats, inputs: Callable[[], Arrays], iterations: int) -> tuple[Floats, Floats]:
    """The next frame (B, D) and history (B, K, H) of figures under control, both float32.

    inputs: gives all other inputs of the step, with new noise each time. A step that takes ``codes`` is asked
    ``iterations`` times: a Gibbs chain that starts at the codes of the last frame.
    """
    chain = {"codes": history[:, -1]} if step.spec.takes("codes") else {}
    for _ in range(iterations - 1):
        chain = {"codes": step({**inputs(), "history": history, **chain})["next_codes"]}
    outputs = step({**inputs(), "history": history, **chain})
    return outputs["frame"], outputs[step.spec.feedback["history"]]


LOOPS: Mapping[str, Loop] = {
    "session": Loop(
        tick,
        {
            "history": "batch K H",
            "control": "batch L",
            "noise": "batch N",
            "variety": "batch 1",
            "temperature": "batch 1",
        },
        {"next_codes": "batch H", "frame": "batch D"},
        TickSettings,
    ),
}
