"""Describe: ranked sentences for a motion. Section 4.2 of Plappert et al. 2017."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import overload

import numpy as np
from numpy.typing import NDArray

from motet.decode.ancestral import Limits, draw_sequences
from motet.decode.beam import Hypothesis, beam_search
from motet.decode.consensus import by_consensus
from motet.models.language import MAX_SECONDS, LanguageModel
from motet.models.progress import Progress, silent
from motet.models.text import EOS, MAX_WORDS, PAD, SOS, UNK
from motet.motion.motion import Motion

BATCH, DRAWN_BATCH = 128, 16
"""Motions that are decoded at once, by beam search and by draws; more bring no speed and take memory."""


@dataclass(frozen=True)
class Description:
    """A sentence, normalised, and the natural logarithm of its probability given the motion.

    score: what the sentences of a motion are ranked by: the log-probability, or how well a sentence drawn agrees with
        all that were drawn, from 0 to 1.
    """

    text: str
    log_probability: float
    score: float


class DescribeModel(LanguageModel):
    """A model that puts motions into words.

    graphs: "encoder" (frames, lengths -> context), "step" (word, context, state -> log_probabilities, next_state) and
        "score" (context, words -> log_probabilities).
    """

    @overload
    def describe(
        self, motions: Motion, beams: int | None = None, draws: int | None = None, *, progress: Progress = ...
    ) -> list[Description]: ...
    @overload
    def describe(
        self, motions: Sequence[Motion], beams: int | None = None, draws: int | None = None, *, progress: Progress = ...
    ) -> list[list[Description]]: ...
    def describe(
        self,
        motions: Motion | Sequence[Motion],
        beams: int | None = None,
        draws: int | None = None,
        *,
        progress: Progress = silent,
    ) -> list[Description] | list[list[Description]]:
        """Up to ``beams`` descriptions of a motion, the best first; of several motions a list for each.

        draws: 0 for beam search, whose best is the most probable sentence. More: so many sentences are drawn, and the
            best is the one that has most in common with all of them (:mod:`motet.decode.consensus`), which need not be
            probable itself. By default the bundle's, or 0.
        progress: called with the number of motions done and of all.

        A motion at another frame rate is resampled. Each motion gets what it would get alone, and the same every time.
        MotionError as :meth:`frames`: longer motions go in :meth:`windows`. DecodingError where ``beams`` (the bundle's
        by default) is not between 1 and 100, or ``draws`` not between 0 and 1,000.
        """
        width = int(self.setting("beams", beams, 1, 100))
        count = int(self.setting("draws", self.defaults.get("draws", 0) if draws is None else draws, 0, 1000))
        given = [motions] if isinstance(motions, Motion) else motions
        contexts, found = self.embed(given), []
        for place in range(0, len(contexts), size := DRAWN_BATCH if count else BATCH):
            batch = contexts[place : place + size]
            found += self._agreed(batch, count) if count else self._searched(batch, width)
            progress(len(found), len(contexts))
        rows = [[Description(self.vocabulary.decode(ids), *rank) for ids, *rank in row[:width]] for row in found]
        return rows[0] if isinstance(motions, Motion) else rows

    def windows(self, motion: Motion) -> list[tuple[float, Motion]]:
        """A motion of any length in as few equal parts as the model takes, each with the second at which it starts."""
        count = max(1, math.ceil(motion.duration / MAX_SECONDS - 1e-9))
        edges = np.linspace(0, len(motion), count + 1).round().astype(int).tolist()
        return [(start / motion.fps, motion[start:stop]) for start, stop in pairwise(edges)]

    def embed(self, motions: Motion | Sequence[Motion]) -> NDArray[np.float32]:
        """The context vector (C,) float32 of a motion, or vectors (N, C) of several; MotionError as :meth:`frames`."""
        if isinstance(motions, Motion):
            context: NDArray[np.float32] = self.contexts([self.frames(motions)])[0]
            return context
        return self.contexts([self.frames(motion) for motion in motions])

    def score(self, motion: Motion, sentence: str) -> float:
        """Log-probability of a sentence given a motion; unknown words count as UNK, and a TextWarning names them."""
        ids = self.vocabulary.ids
        words = np.concatenate([[ids[SOS]], self.ids(sentence), [ids[EOS]]])[None]
        feeds = {"context": self.embed([motion]), "words": words}
        return float(self.graphs["score"](feeds)["log_probabilities"].sum(dtype=np.float64))

    def _searched(self, contexts: NDArray[np.float32], beams: int) -> list[list[Hypothesis]]:
        return beam_search(self.graphs["step"], contexts, beams, *self._limits())

    def _agreed(self, contexts: NDArray[np.float32], draws: int) -> list[list[Hypothesis]]:
        temperature = self.setting("temperature", self.defaults.get("temperature", 1.0), 0.01, 100)
        drawn = draw_sequences(self.graphs["step"], contexts, draws, temperature, self._limits())
        return [by_consensus(row) for row in drawn]

    def _limits(self) -> Limits:
        start, end, *banned = (self.vocabulary.ids[word] for word in (SOS, EOS, PAD, UNK))
        return Limits(start, end, int(self.defaults.get("max_words", MAX_WORDS)), [start, *banned])
