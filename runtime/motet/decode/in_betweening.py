"""The loop of models that fill gaps: one call of the graph gives all frames of a gap."""

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Loop, Setting

MOST = 1000
"""Frames that settings may ask for."""


def between(graph: Graph, past: Floats, plain: Floats, after: Floats) -> Floats:
    """What fills gaps (B, N, E), from the frames before (B, P, E), a plain way through (B, N, E) and those after them
    (B, A, E), all placed and seen from the last frame before the gap."""
    filled: Floats = graph({"past": past, "plain": plain, "after": after})["filled"]
    return filled


LOOP = Loop(
    "fill",
    between,
    {},
    {},
    {
        "context": Setting(1, MOST, whole=True),
        "least": Setting(1, MOST, whole=True),
        "longest": Setting(1, MOST, whole=True),
    },
)
"""context: the most frames that are seen before and after a gap; least: the fewest; longest: of the gap itself."""
