"""Beam search over frames drawn from a mixture of Gaussians. Section 4.3.3 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode.loop import Flags, Ids, Loop, Noise, Sample, Scores, advance, two_rows, zero_state
from motet.settings import Range, Settings

SMALLEST = 2.0**-24
"""A probability of the flag below this counts as this, where a logarithm is taken."""


@dataclass(frozen=True)
class MixtureSettings(Settings):
    """hypotheses: motions that are given. candidates: frames that are drawn for each."""

    hypotheses: Annotated[int, Range(1, 100)]
    candidates: Annotated[int, Range(1, 100)]
    temperature: Annotated[float, Range(0.01, 100)]
    max_seconds: Annotated[float, Range(0.01, 600, "s")]


def mixture_search(
    step: Graph,
    context: Floats,
    noise: Sequence[Noise],
    max_frames: int,
    hypotheses: int,
    candidates: int,
    temperature: float,
) -> list[list[Sample]]:
    """For each row of ``context`` (B, C) ``hypotheses`` samples of 1 to ``max_frames`` frames.

    step: frame (N, D + 1), context (N, C) and fed back states -> log_weights (N, K), means, stds (N, K, D) and active
    (N,), the probability that there is a further frame. A channel of std 0 stays at its mean and counts for nothing.

    At every step each hypothesis draws ``candidates`` frames from its mixture, each with its flag, and the best
    ``hypotheses`` of a row's candidates go on. Among those of equal length this is the order of their summed
    log-likelihoods. Sums of densities over different lengths cannot be compared (the order would change with the unit
    of a channel), so a hypothesis that has ended keeps its score and competes by its log-likelihood per frame, which
    is the order of the result, too. With one candidate all go on: independent samples.

    Temperature T multiplies the variances; likelihoods are those of the model itself (T = 1). Components are drawn as
    the model weighs them: they say what is done, while what is drawn about their centres, anew in every frame, makes a
    figure tremble. The flag is drawn as it is: 1 in the first step, so that no motion is empty, and 0 after
    ``max_frames``. A hypothesis that draws its end several times ends once.

    Row i draws from ``noise[i]``, and does not depend on the rows around it.
    """
    beam = _Beam(step, context, hypotheses, candidates)
    while beam.advance(noise, temperature, max_frames):
        pass
    return beam.samples()


class _Beam:
    """B rows of W hypotheses: where each stands, and what it went through."""

    def __init__(self, step: Graph, context: Floats, hypotheses: int, candidates: int) -> None:
        rows = len(context)
        self.step = step
        self.context = context
        self.candidates = candidates
        self.shape = (rows, hypotheses)
        self.scores = np.zeros(self.shape)
        self.lengths = np.zeros(self.shape, dtype=np.int64)
        self.ended = np.zeros(self.shape, dtype=np.bool_)
        self.frame = np.ones((rows * hypotheses, step.spec.input("frame").size(1)), dtype=np.float32)
        self.state = zero_state(step, rows * hypotheses)
        self.history: list[tuple[Floats, Ids]] = []  # of each step the frames (B, W, D) and parents (B, W)

    def advance(self, noise: Sequence[Noise], temperature: float, max_frames: int) -> bool:
        """One step of all hypotheses that have not ended; whether there were any."""
        alive = two_rows(np.flatnonzero(~self.ended))
        if not len(alive):
            return False
        (rows, hypotheses), length = self.shape, len(self.history)
        inputs = {"frame": self.frame[alive], "context": self.context[alive // hypotheses]}
        outputs, state = advance(self.step, {name: array[alive] for name, array in self.state.items()}, inputs)
        running, place = np.unique(alive // hypotheses, return_inverse=True)
        size = (hypotheses, self.candidates)
        slot = alive % hypotheses
        normal = [noise[row].standard_normal((*size, self.frame.shape[1] - 1), np.float32) for row in running]
        uniform = [noise[row].random((*size, 2), np.float32) for row in running]
        forced = False if length == max_frames else True if length == 0 else None
        drawn = draw(outputs, np.stack(normal)[place, slot], np.stack(uniform)[place, slot], temperature, forced)
        parents, chosen = self._rank(alive, *drawn[1:])
        # a parent that has ended finds the place of some other: what it takes there is never used
        places = np.searchsorted(alive, parents + np.arange(rows)[:, None] * hypotheses) % len(alive)
        frames = drawn[0][places, chosen]
        self.history.append((frames, parents))
        ones = np.ones((*self.shape, 1), dtype=np.float32)
        self.frame = np.concatenate([frames, ones], axis=2).reshape(self.frame.shape)
        self.state = {name: np.take(array, places.ravel(), axis=0) for name, array in state.items()}
        return True

    def _rank(self, alive: Ids, flags: Flags, gains: Scores) -> tuple[Ids, Ids]:
        """Keep the best of each row's candidates: the parent and the candidate of each, (B, W)."""
        rows, hypotheses = self.shape
        scores = np.full((rows * hypotheses, self.candidates), -np.inf)
        scores[:, 0] = self.scores.ravel()  # what has ended goes on as it is
        scores[alive] = self.scores.ravel()[alive, None] + gains
        lengths = np.repeat(self.lengths.reshape(-1, 1), self.candidates, axis=1)
        lengths[alive] += flags
        ended = np.ones_like(lengths, dtype=np.bool_)
        ended[alive] = ~flags
        flat_scores = scores.reshape(rows, -1)
        flat_lengths = lengths.reshape(rows, -1)
        order = np.argsort(-flat_scores / np.maximum(flat_lengths, 1), axis=1, kind="stable")[:, :hypotheses]
        self.scores = np.take_along_axis(flat_scores, order, 1)
        self.lengths = np.take_along_axis(flat_lengths, order, 1)
        self.ended = np.take_along_axis(ended.reshape(rows, -1), order, 1)
        return order // self.candidates, order % self.candidates

    def samples(self) -> list[list[Sample]]:
        """Follow each hypothesis back through its parents."""
        slot = np.tile(np.arange(self.shape[1]), (self.shape[0], 1))
        backward = []
        for frames, parents in reversed(self.history):
            backward.append(np.take_along_axis(frames, slot[:, :, None], 1))
            slot = np.take_along_axis(parents, slot, 1)
        frames = np.stack(backward[::-1], axis=2)
        return [
            [Sample(f[:n].copy(), float(s)) for f, n, s in zip(*row, strict=True)]
            for row in zip(frames, self.lengths, self.scores, strict=True)
        ]


def draw(
    outputs: Arrays, normal: Floats, uniform: Floats, temperature: float, forced: bool | None
) -> tuple[Floats, Flags, Scores]:
    """What noise, normal (n, C, D) and uniform (n, C, 2), draws from a step's distributions for n hypotheses.

    forced: the flag where there is no choice. Frames (n, C, D), flags (n, C) and the log-likelihoods of both (n, C).
    """
    log_weights, means, stds, active = (outputs[name] for name in ("log_weights", "means", "stds", "active"))
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True), dtype=np.float64)
    bounds = np.cumsum(weights, axis=1)
    threshold = uniform[:, :, :1] * bounds[:, None, -1:]
    component = np.minimum((threshold >= bounds[:, None]).sum(axis=2), weights.shape[1] - 1)
    row = np.arange(len(means))[:, None]
    frames = means[row, component] + np.float32(np.sqrt(temperature)) * stds[row, component] * normal
    flags = uniform[:, :, 1] < active[:, None] if forced is None else np.full(uniform.shape[:2], forced)
    chance = np.where(flags, active[:, None], 1 - active[:, None])
    gains = np.log(np.maximum(chance, SMALLEST), dtype=np.float64)
    gains[flags] += log_density(frames, log_weights, means, stds)[flags]
    gains[~flags & (np.cumsum(~flags, axis=1) > 1)] = -np.inf  # a second end would be the same motion again
    return frames, flags, gains


def log_density(frames: Floats, log_weights: Floats, means: Floats, stds: Floats) -> Scores:
    """Log of equation 8, by log-sum-exp: frames (n, C, D) under mixtures (n, K), (n, K, D), (n, K, D) -> (n, C)."""
    # a dead channel, of deviation 0, is at its mean: with this one it adds nothing
    stds = np.where(stds > 0, stds, np.float32(1 / np.sqrt(2 * np.pi)))
    size = means.shape[2]
    constant = log_weights - np.log(stds).sum(axis=2) - 0.5 * size * np.log(2 * np.pi)
    inverse = 1 / stds
    found = np.empty(frames.shape[:2])
    for candidate in range(frames.shape[1]):  # one at a time, so that memory stays that of the step's own output
        off = (frames[:, candidate, None] - means) * inverse
        log_terms = constant - 0.5 * np.einsum("nkd,nkd->nk", off, off)
        top = log_terms.max(axis=1, keepdims=True)
        found[:, candidate] = (top + np.log(np.exp(log_terms - top).sum(axis=1, keepdims=True)))[:, 0]
    return found


def score_frames(step: Graph, context: Floats, frames: Floats) -> float:
    """Log-likelihood of normalised frames (T, D) float32 and of their end, under a context (C,).

    step: as :func:`mixture_search`.
    """
    contexts = np.stack([context, context])
    state = zero_state(step, 2)
    steps = []
    given = np.ones((2, frames.shape[1] + 1), dtype=np.float32)
    for n in range(len(frames) + 1):
        given[:, :-1] = frames[n - 1] if n else 1
        outputs, state = advance(step, state, {"frame": given, "context": contexts})
        steps.append([outputs[name][0] for name in ("active", "log_weights", "means", "stds")])
    active, *mixtures = map(np.stack, zip(*steps, strict=True))
    chances = np.maximum(np.append(active[:-1], 1 - active[-1]), SMALLEST)
    densities = log_density(frames[:, None], *(part[:-1] for part in mixtures))
    return float(np.log(chances, dtype=np.float64).sum() + densities.sum())


LOOPS: Mapping[str, Loop] = {
    "mixture": Loop(
        mixture_search,
        {"frame": "batch F", "context": "batch C"},
        {"log_weights": "batch K", "means": "batch K D", "stds": "batch K D", "active": "batch"},
        MixtureSettings,
    ),
}
