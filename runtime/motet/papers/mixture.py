"""Beam search over frames drawn from a mixture of Gaussians. Section 4.3.3 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.decode.loop import Flags, Ids, Loop, Noise, Sample, Scores, advance, two_rows, zero_state
from motet.settings import Range, Settings

SMALLEST_PROBABILITY = 2.0**-24
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

        # the graph: one step of what goes on
        hypotheses = self.shape[1]
        inputs = {"frame": self.frame[alive], "context": self.context[alive // hypotheses]}
        state = {name: array[alive] for name, array in self.state.items()}
        outputs, state = advance(self.step, state, inputs)

        # candidates of each hypothesis, and the best of each row
        normal, uniform = self._noise_of(noise, alive)
        frames, flags, gains = draw(outputs, normal, uniform, temperature, self._forced(max_frames))
        parents, candidates = self._rank(alive, flags, gains)

        # a parent that has ended gets the place of some other: what it takes there is never used
        first_of_row = np.arange(len(parents))[:, None] * hypotheses
        places = np.searchsorted(alive, parents + first_of_row) % len(alive)
        self._follow(frames[places, candidates], parents)
        self.state = {name: np.take(array, places.ravel(), axis=0) for name, array in state.items()}
        return True

    def _noise_of(self, noise: Sequence[Noise], alive: Ids) -> tuple[Floats, Floats]:
        """Of each hypothesis in ``alive`` (n,), from its row's noise: normal (n, C, D) and uniform (n, C, 2)."""
        hypotheses = self.shape[1]
        size = (hypotheses, self.candidates)
        channels = self.frame.shape[1] - 1
        running, place = np.unique(alive // hypotheses, return_inverse=True)
        normal = np.stack([noise[row].standard_normal((*size, channels), np.float32) for row in running])
        uniform = np.stack([noise[row].random((*size, 2), np.float32) for row in running])
        slot = alive % hypotheses
        return normal[place, slot], uniform[place, slot]

    def _forced(self, max_frames: int) -> bool | None:
        """The flag where there is no choice: no motion is empty, and none is longer than ``max_frames``."""
        length = len(self.history)
        if length == max_frames:
            return False
        return True if length == 0 else None

    def _follow(self, frames: Floats, parents: Ids) -> None:
        """What has been drawn, frames (B, W, D) of parents (B, W), is the next step's input."""
        self.history.append((frames, parents))
        flags = np.ones((*self.shape, 1), dtype=np.float32)
        self.frame = np.concatenate([frames, flags], axis=2).reshape(self.frame.shape)

    def _rank(self, alive: Ids, flags: Flags, gains: Scores) -> tuple[Ids, Ids]:
        """Keep the best of each row's candidates: the parent and the candidate of each, (B, W)."""
        rows, hypotheses = self.shape

        # what has ended goes on as it is, as its first candidate
        scores = np.full((rows * hypotheses, self.candidates), -np.inf)
        scores[:, 0] = self.scores.ravel()
        scores[alive] = self.scores.ravel()[alive, None] + gains
        lengths = np.repeat(self.lengths.reshape(-1, 1), self.candidates, axis=1)
        lengths[alive] += flags
        ended = np.ones_like(lengths, dtype=np.bool_)
        ended[alive] = ~flags

        # the order of a row's candidates: log-likelihoods per frame
        flat_scores = scores.reshape(rows, -1)
        flat_lengths = lengths.reshape(rows, -1)
        score_per_frame = flat_scores / np.maximum(flat_lengths, 1)
        best = np.argsort(-score_per_frame, axis=1, kind="stable")[:, :hypotheses]
        self.scores = np.take_along_axis(flat_scores, best, 1)
        self.lengths = np.take_along_axis(flat_lengths, best, 1)
        self.ended = np.take_along_axis(ended.reshape(rows, -1), best, 1)
        return best // self.candidates, best % self.candidates

    def samples(self) -> list[list[Sample]]:
        """Follow each hypothesis back through its parents."""
        slot = np.tile(np.arange(self.shape[1]), (self.shape[0], 1))
        backward = []
        for frames, parents in reversed(self.history):
            backward.append(np.take_along_axis(frames, slot[:, :, None], 1))
            slot = np.take_along_axis(parents, slot, 1)
        frames = np.stack(backward[::-1], axis=2)
        samples = []
        for row_frames, lengths, scores in zip(frames, self.lengths, self.scores, strict=True):
            row = zip(row_frames, lengths, scores, strict=True)
            samples.append([Sample(drawn[:length].copy(), float(score)) for drawn, length, score in row])
        return samples


def draw(
    outputs: Arrays, normal: Floats, uniform: Floats, temperature: float, forced: bool | None
) -> tuple[Floats, Flags, Scores]:
    """What noise, normal (n, C, D) and uniform (n, C, 2), draws from a step's distributions for n hypotheses.

    forced: the flag where there is no choice. Frames (n, C, D), flags (n, C) and the log-likelihoods of both (n, C).
    """
    log_weights = outputs["log_weights"]
    means = outputs["means"]
    stds = outputs["stds"]
    active = outputs["active"][:, None]
    component = _components(log_weights, uniform[:, :, 0])
    row = np.arange(len(means))[:, None]
    scale = np.float32(np.sqrt(temperature))
    frames = means[row, component] + scale * stds[row, component] * normal

    flags = uniform[:, :, 1] < active if forced is None else np.full(uniform.shape[:2], forced)
    probability = np.where(flags, active, 1 - active)
    gains = np.log(np.maximum(probability, SMALLEST_PROBABILITY), dtype=np.float64)
    gains[flags] += log_density(frames, log_weights, means, stds)[flags]
    # a second end would be the same motion again
    ends_before = np.cumsum(~flags, axis=1) > 1
    gains[~flags & ends_before] = -np.inf
    return frames, flags, gains


def _components(log_weights: Floats, uniform: Floats) -> Ids:
    """The component (n, C) of each draw in ``uniform`` (n, C), by weights (n, K)."""
    weights = np.exp(log_weights - log_weights.max(axis=1, keepdims=True), dtype=np.float64)
    bounds = np.cumsum(weights, axis=1)[:, None]
    threshold = uniform[:, :, None] * bounds[:, :, -1:]
    below: Ids = (threshold >= bounds).sum(axis=2)
    components: Ids = np.minimum(below, weights.shape[1] - 1)
    return components


def log_density(frames: Floats, log_weights: Floats, means: Floats, stds: Floats) -> Scores:
    """Log of equation 8, by log-sum-exp: frames (n, C, D) under mixtures (n, K), (n, K, D), (n, K, D) -> (n, C)."""
    # a dead channel, of deviation 0, is at its mean: with this one it adds nothing
    stds = np.where(stds > 0, stds, np.float32(1 / np.sqrt(2 * np.pi)))
    size = means.shape[2]
    constant = log_weights - np.log(stds).sum(axis=2) - 0.5 * size * np.log(2 * np.pi)
    inverse = 1 / stds
    densities = np.empty(frames.shape[:2])
    for candidate in range(frames.shape[1]):  # one at a time, so that memory stays that of the step's own output
        off = (frames[:, candidate, None] - means) * inverse
        log_terms = constant - 0.5 * np.einsum("nkd,nkd->nk", off, off)
        top = log_terms.max(axis=1, keepdims=True)
        densities[:, candidate] = (top + np.log(np.exp(log_terms - top).sum(axis=1, keepdims=True)))[:, 0]
    return densities


def score_frames(step: Graph, context: Floats, frames: Floats) -> float:
    """Log-likelihood of normalised frames (T, D) float32 and of their end, under a context (C,).

    step: as :func:`mixture_search`.
    """
    contexts = np.stack([context, context])
    state = zero_state(step, 2)
    steps = []
    frame_and_flag = np.ones((2, frames.shape[1] + 1), dtype=np.float32)
    for step_index in range(len(frames) + 1):
        frame_and_flag[:, :-1] = frames[step_index - 1] if step_index else 1
        outputs, state = advance(step, state, {"frame": frame_and_flag, "context": contexts})
        steps.append({name: outputs[name][0] for name in ("active", "log_weights", "means", "stds")})
    active = np.stack([output["active"] for output in steps])
    probabilities = np.maximum(np.append(active[:-1], 1 - active[-1]), SMALLEST_PROBABILITY)

    # after the last frame only the flag counts
    log_weights = np.stack([output["log_weights"] for output in steps[:-1]])
    means = np.stack([output["means"] for output in steps[:-1]])
    stds = np.stack([output["stds"] for output in steps[:-1]])
    densities = log_density(frames[:, None], log_weights, means, stds)
    return float(np.log(probabilities, dtype=np.float64).sum() + densities.sum())


LOOPS: Mapping[str, Loop] = {
    "mixture": Loop(
        mixture_search,
        {"frame": "batch F", "context": "batch C"},
        {"log_weights": "batch K", "means": "batch K D", "stds": "batch K D", "active": "batch"},
        MixtureSettings,
    ),
}
