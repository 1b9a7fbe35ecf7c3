"""All decoding loops, by the names that manifests use, and those of a few lines. A new one is a line in ``LOOPS``."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode import codes, mixture, steering, words
from motet.decode.loop import Ids, Loop, advance, zero_state
from motet.settings import Range, Settings

Frames = Annotated[int, Range(1, 1000, "frames")]


@dataclass(frozen=True)
class FreeRunSettings(Settings):
    """horizon: frames between runs of the encoder."""

    horizon: Annotated[int, Range(1, 10_000)]


@dataclass(frozen=True)
class TickSettings(Settings):
    """temperature: divides what goes into the sigmoids. iterations: Gibbs iterations of a tick."""

    temperature: Annotated[float, Range(0.01, 100)]
    iterations: Annotated[int, Range(1, 100)] = 1


@dataclass(frozen=True)
class BetweenSettings(Settings):
    """context: the most frames seen before and after a gap; least: the fewest; longest: the longest gap."""

    context: Frames
    least: Frames
    longest: Frames


@dataclass(frozen=True)
class NearestSettings(Settings):
    """count: motions that are found."""

    count: Annotated[int, Range(1, 1000)] = 5


def free_run(encoder: Graph, step: Graph, seed: Floats, count: int, horizon: int) -> Floats:
    """The ``count`` frames (B, count, C) float32 that a predictor continues seed frames (B, L, C) float32 with.

    Inputs of the step are taken from what the encoder gives, by name: those that are fed back begin there, others stay;
    a fed back input that the encoder does not give begins as zeros. After every ``horizon`` frames the encoder is asked
    again, about the L frames before. Where it gives them all as ``trajectory``, they are taken at once: the step would
    only hand them out.
    """
    given = seed.shape[1]
    frames = np.concatenate([seed, np.empty((len(seed), count, seed.shape[2]), dtype=np.float32)], axis=1)
    for n in range(0, count, horizon):
        found = encoder({"frames": np.ascontiguousarray(frames[:, n : n + given])})
        coming = frames[:, n + given : n + given + horizon]
        whole = found.get("trajectory", seed[:, :0])[:, : coming.shape[1]]
        if whole.shape == coming.shape:
            coming[:] = whole
            continue
        state = zero_state(step, len(seed), found) | {k: v for k, v in found.items() if k in step.spec.feedback}
        constant = {k: v for k, v in found.items() if k not in state and step.spec.takes(k)}
        for frame in np.moveaxis(coming, 1, 0):
            outputs, state = advance(step, state, constant)
            frame[:] = outputs["frame"]
    return frames[:, given:]


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


def between(graph: Graph, past: Floats, plain: Floats, after: Floats) -> Floats:
    """What fills gaps (B, N, E), from the frames before (B, P, E), a plain way through (B, N, E) and those after them
    (B, A, E), all placed and seen from the last frame before the gap."""
    filled: Floats = graph({"past": past, "plain": plain, "after": after})["filled"]
    return filled


def nearest(scores: Floats, count: int) -> Ids:
    """The columns (..., count) of the greatest of scores (..., N), best first, of equal ones the first."""
    falling = -scores.reshape(-1, scores.shape[-1])
    count = min(count, falling.shape[1])
    found = np.zeros((len(falling), count), dtype=np.int64)
    for row, chosen in zip(falling, found, strict=True):
        last = np.partition(row, count - 1)[count - 1]
        near = np.flatnonzero(~(row > last))  # all that are as great as the last one wanted, of which the first count
        chosen[:] = near[np.argsort(row[near], kind="stable")][:count]
    return found.reshape(*scores.shape[:-1], count)


_WORDS = {"word": "*batch", "context": "batch C"}, {"log_probabilities": "batch V"}

LOOPS: Mapping[str, Loop] = {
    "beam": Loop(words.beam_search, *_WORDS, words.BeamSettings, batch=128),
    "consensus": Loop(words.consensus, *_WORDS, words.ConsensusSettings, batch=16),
    "mixture": Loop(
        mixture.mixture_search,
        {"frame": "batch F", "context": "batch C"},
        {"log_weights": "batch K", "means": "batch K D", "stds": "batch K D", "active": "batch"},
        mixture.MixtureSettings,
    ),
    "codes": Loop(
        codes.draw_codes,
        {"codes": "*batch P", "action": "*batch", "age": "*batch"},
        {"known": "batch H", "numbers": "batch L"},
        codes.CodesSettings,
    ),
    "free_run": Loop(free_run, {}, {"frame": "batch D"}, FreeRunSettings, batch=4096),
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
    "matching": Loop(steering.tick, {}, {}),
    "nearest": Loop(nearest, {}, {}, NearestSettings),
    "between": Loop(between, {}, {}, BetweenSettings),
}
