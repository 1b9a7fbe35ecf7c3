"""The loop of predictors: a step graph continues seed frames."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.loop import Loop
from motet.decode.rollout import advance, zero_state
from motet.settings import Range, Settings


@dataclass(frozen=True)
class FreeRunSettings(Settings):
    """horizon: frames between runs of the encoder."""

    horizon: Annotated[int, Range(1, 10_000)]


def free_run(encoder: Graph, step: Graph, seed: Floats, count: int, horizon: int) -> Floats:
    """The ``count`` frames (B, count, C) float32 that follow the seed frames (B, L, C) float32.

    Inputs of the step are taken from what the encoder gives, by name: those that are fed back begin there, others stay;
    a fed back input that the encoder does not give begins as zeros. After every ``horizon`` frames the encoder is asked
    again, about the L frames before.
    """
    given = seed.shape[1]
    frames = np.concatenate([seed, np.empty((len(seed), count, seed.shape[2]), dtype=np.float32)], axis=1)
    for n in range(count):
        if n % horizon == 0:
            found = encoder({"frames": np.ascontiguousarray(frames[:, n : n + given])})
            state = {
                **zero_state(step, len(seed), found),
                **{k: v for k, v in found.items() if k in step.spec.feedback},
            }
            constant = {k: v for k, v in found.items() if k not in state and step.spec.takes(k)}
        outputs, state = advance(step, state, constant)
        frames[:, n + given] = outputs["frame"]
    return frames[:, given:]


LOOP = Loop(free_run, {}, {"frame": "batch D"}, FreeRunSettings, batch=4096)
