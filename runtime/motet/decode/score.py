"""How probable known sequences are: the step is fed known values instead of its own draws."""

import numpy as np

from motet.bundle.graph import Floats, Graph
from motet.decode.mixture import SMALLEST, log_density
from motet.decode.rollout import Ids, Scores, advance, two_rows, zero_state


def score_words(step: Graph, contexts: Floats, rows: Ids, words: Ids) -> Scores:
    """Log-probabilities (N,) of N sequences of words, each under the context of its row.

    step: as :func:`motet.decode.beam.beam_search`. contexts: (R, C). rows: (N,) of contexts. words: (N, W), the start,
    the words, the end, and 0 behind it. Sequences of one row share the steps of the words with which they all begin.
    """
    found, group = np.zeros(len(rows)), rows
    state, count = zero_state(step, len(contexts)), int(words.max()) + 1
    for given, coming in zip(words.T, words.T[1:], strict=False):
        alive = np.flatnonzero(coming)
        if not len(alive):
            break
        _, first, same = np.unique(group[alive] * count + given[alive], return_index=True, return_inverse=True)
        chosen = two_rows(alive[first])
        before = {name: array[group[chosen]] for name, array in state.items()}
        outputs, state = advance(step, before, {"word": given[chosen], "context": contexts[rows[chosen]]})
        group = np.zeros_like(rows)
        group[alive] = same
        found[alive] += outputs["log_probabilities"][same, coming[alive]]
    return found


def score_frames(step: Graph, context: Floats, frames: Floats) -> float:
    """Log-likelihood of normalised frames (T, D) float32 and of their end, under a context (C,).

    step: as :func:`motet.decode.mixture.mixture_search`.
    """
    contexts, state, steps = np.stack([context, context]), zero_state(step, 2), []
    given = np.ones((2, frames.shape[1] + 1), dtype=np.float32)
    for n in range(len(frames) + 1):
        given[:, :-1] = frames[n - 1] if n else 1
        outputs, state = advance(step, state, {"frame": given, "context": contexts})
        steps.append([outputs[name][0] for name in ("active", "log_weights", "means", "stds")])
    active, *mixtures = map(np.stack, zip(*steps, strict=True))
    chances = np.maximum(np.append(active[:-1], 1 - active[-1]), SMALLEST)
    densities = log_density(frames[:, None], *(part[:-1] for part in mixtures))
    return float(np.log(chances, dtype=np.float64).sum() + densities.sum())
