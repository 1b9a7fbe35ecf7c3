"""The loop ``free_run``: the next frames of a motion, one after another."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Loop, advance, zero_state
from motet.settings import Range, Settings


@dataclass(frozen=True)
class FreeRunSettings(Settings):
    """horizon: frames between runs of the encoder."""

    horizon: Annotated[int, Range(1, 10_000)]


def free_run(encoder: Graph, step: Graph, seed: Floats, count: int, horizon: int) -> Floats:
    """The ``count`` frames (B, count, C) float32 that a predictor continues seed frames (B, L, C) float32 with.

    Inputs of the step are taken from what the encoder gives, by name: those that are fed back begin there, others stay;
    a fed back input that the encoder does not give begins as zeros. After every ``horizon`` frames the encoder is asked
    again, about the L frames before. Where it gives them all as ``trajectory``, they are taken at once: the step would
    only hand them out.
    """
    seed_count = seed.shape[1]
    frames = np.concatenate([seed, np.empty((len(seed), count, seed.shape[2]), dtype=np.float32)], axis=1)
    # one horizon after the other, each from the last seed_count frames
    for n in range(0, count, horizon):
        encoded = encoder({"frames": np.ascontiguousarray(frames[:, n : n + seed_count])})
        coming = frames[:, n + seed_count : n + seed_count + horizon]
        # predictors that give all frames at once need no steps
        whole = encoded.get("trajectory", seed[:, :0])[:, : coming.shape[1]]
        if whole.shape == coming.shape:
            coming[:] = whole
            continue
        # the others go on frame by frame from what the encoder gives
        state = zero_state(step, len(seed), encoded) | {k: v for k, v in encoded.items() if k in step.spec.feedback}
        constant = {k: v for k, v in encoded.items() if k not in state and step.spec.takes(k)}
        for frame in np.moveaxis(coming, 1, 0):
            outputs, state = advance(step, state, constant)
            frame[:] = outputs["frame"]
    return frames[:, seed_count:]


LOOPS: Mapping[str, Loop] = {"free_run": Loop(free_run, {}, {"frame": "batch D"}, FreeRunSettings, batch=4096)}
