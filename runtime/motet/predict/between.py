"""The loop ``between``: what fills a gap, in one call of the graph."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Loop
from motet.settings import Range, Settings

Frames = Annotated[int, Range(1, 1000, "frames")]


@dataclass(frozen=True)
class BetweenSettings(Settings):
    """context: the most frames seen before and after a gap; least: the fewest; longest: the longest gap."""

    context: Frames
    least: Frames
    longest: Frames


def between(graph: Graph, past: Floats, plain: Floats, after: Floats) -> Floats:
    """What fills gaps (B, N, E), from the frames before (B, P, E), a plain way through (B, N, E) and those after them
    (B, A, E), all placed and seen from the last frame before the gap."""
    filled: Floats = graph({"past": past, "plain": plain, "after": after})["filled"]
    return filled


LOOPS: Mapping[str, Loop] = {"between": Loop(between, {}, {}, BetweenSettings)}
