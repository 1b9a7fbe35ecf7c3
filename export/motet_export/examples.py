"""Random inputs of graphs: numbers that keep a graph's contract, and frames as likely as the training data's."""

import math
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Arrays, Graph, GraphSpec
from motet.bundle.manifest import Manifest
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.representation.placed import placed_by_way

Examples = Callable[[np.random.Generator, int], Arrays]
"""Draws all inputs of a graph for so many rows."""


def examples(manifest: Manifest, torch: Mapping[str, Graph]) -> dict[str, Examples]:
    """What draws the inputs of each graph, by role: :func:`example`, with frames as likely as the training data's.

    A history of codes is what the encoder makes of such frames in torch; and a predictor's other graphs get what its
    encoder gives: from numbers far from any frames a net that feeds its frames back can make much of a rounding.
    """
    contract, like_data = manifest.motion, ("frames", "frame", "history")

    def draw(spec: GraphSpec, rng: np.random.Generator, rows: int) -> Arrays:
        found = example(spec, rng, rows, _below(manifest))
        return {**found, **{name: _like(value, name, rng) for name, value in found.items() if name in like_data}}

    def _like(value: NDArray[Any], name: str, rng: np.random.Generator) -> NDArray[Any]:
        if name == "history":
            frames = walks(contract, rng, *value.shape[:2])
            return torch["encoder"]({"frames": frames.reshape(-1, frames.shape[2])})["codes"].reshape(value.shape)
        frames = walks(contract, rng, len(value), math.prod(value.shape[1:-1])).reshape(*value.shape[:-1], -1)
        if value.shape[-1] == frames.shape[-1]:
            return frames
        flags = np.ones((*value.shape[:-1], 1), dtype=np.float32)  # of frames as generators take them
        return np.concatenate([contract.normalised(frames).astype(np.float32), flags], axis=-1)

    def from_encoder(spec: GraphSpec, rng: np.random.Generator, rows: int) -> Arrays:
        given = draw(torch["encoder"].spec, rng, rows)
        return {name: value for name, value in {**given, **torch["encoder"](given)}.items() if spec.takes(name)}

    draws: dict[str, Examples] = {role: partial(draw, graph.spec) for role, graph in torch.items()}
    if manifest.verb == "predict":
        for role in draws.keys() - {"encoder"}:
            draws[role] = partial(from_encoder, torch[role].spec)
    return draws


def example(
    spec: GraphSpec, rng: np.random.Generator, batch: int, below: Mapping[str, int] | None = None
) -> dict[str, NDArray[Any]]:
    """All inputs of ``spec`` for ``batch`` rows: numbers uniform in [0.05, 1), ids 0, or ``below`` a limit by name.

    Every dynamic axis but "batch" gets a random size of up to 12, the same for all inputs.
    """
    axes = [axis for tensor in spec.inputs for axis in tensor.shape[1:] if isinstance(axis, str)]
    sizes = {axis: int(rng.integers(1, 13)) for axis in dict.fromkeys(axes)}
    sizes["batch"] = batch
    found: dict[str, NDArray[Any]] = {}
    for tensor in spec.inputs:
        shape = [sizes[axis] if isinstance(axis, str) else axis for axis in tensor.shape]
        if tensor.dtype == "float32":
            found[tensor.name] = rng.uniform(0.05, 1.0, shape).astype(np.float32)
        elif tensor.name == "lengths":
            found[tensor.name] = rng.integers(1, sizes[axes[0]] + 1, shape)
        else:
            found[tensor.name] = rng.integers(0, (below or {}).get(tensor.name, 1), shape)
    return found


def _below(manifest: Manifest) -> dict[str, int]:
    """How many different whole numbers an input may have, by its name."""
    words = max(1, len(manifest.vocabulary))
    below = {"words": words, "word": words}
    if manifest.loop == "codes":
        sizes = manifest.config
        codes = min(sizes["codec"]["moves"], math.prod(sizes["codec"]["levels"]))
        below |= {"codes": codes, "action": sizes["text"]["actions"] + 1, "age": sizes["writer"]["ages"]}
    return below


def walks(contract: MotionContract, rng: np.random.Generator, rows: int, frames: int) -> NDArray[np.float32]:
    """Random walks (rows, frames, C) float32 from near the mean of the training data, in the contract's units."""
    steps = 0.1 * rng.normal(size=(rows, frames, len(contract.mean)))
    found: Array = contract.mean + contract.std * steps.cumsum(axis=1)
    return found.astype(np.float32)


def sides(
    contract: MotionContract, rng: np.random.Generator, frames: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Placed frames (frames, E) before a gap, and as many after it: both ends of a random walk in ``root_sixd``."""
    walk = walks(contract, rng, 1, 2 * frames)[0].astype(np.float64)
    past, after = np.split(placed_by_way(walk, contract.fps).astype(np.float32), 2)
    return past, after
