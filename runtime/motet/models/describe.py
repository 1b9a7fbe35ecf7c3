"""Describe: ranked sentences for a motion. Section 4.2 of Plappert et al. 2017."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.decode.ancestral import Limits, draw_sequences
from motet.decode.beam import Hypothesis, beam_search
from motet.decode.consensus import by_consensus
from motet.models.language import LanguageModel
from motet.models.text import EOS, MAX_WORDS, PAD, SOS, UNK
from motet.motion.motion import Motion

BATCH, DRAWN_BATCH = 128, 16
"""Motions that are decoded at once, by beam search and by draws; more bring no speed and take memory."""


@dataclass(frozen=True)
class Description:
    """A sentence, normalised, and the natural logarithm of its probability given the motion."""

    text: str
    log_probability: float


class DescribeModel(LanguageModel):
    """A model that puts motions into words.

    graphs: "encoder" (frames, lengths -> context), "step" (word, context, state -> log_probabilities, next_state) and
        "score" (context, words -> log_probabilities).
    """

    def describe(
        self, motions: Motion | Sequence[Motion], beams: int | None = None, draws: int | None = None
    ) -> list[list[Description]]:
        """For each motion up to ``beams`` descriptions, the best first.

        draws: 0 for beam search, whose best is the most probable sentence. More: so many sentences are drawn, and the
            best is the one that has most in common with all of them (:mod:`motet.decode.consensus`), which need not be
            probable itself. By default the bundle's, or 0.

        A motion at another frame rate is resampled. Each motion gets what it would get alone, and the same every time.
        MotionError as :meth:`frames`; DecodingError where ``beams`` (the bundle's by default) is not between 1 and 100,
        or ``draws`` not between 0 and 1,000.
        """
        width = int(self.setting("beams", beams, 1, 100))
        count = int(self.setting("draws", self.defaults.get("draws", 0) if draws is None else draws, 0, 1000))
        contexts, found = self.embed(motions), []
        for place in range(0, len(contexts), size := DRAWN_BATCH if count else BATCH):
            batch = contexts[place : place + size]
            found += self._agreed(batch, count) if count else self._searched(batch, width)
        return [[Description(self.vocabulary.decode(ids), score) for ids, score in row[:width]] for row in found]

    def embed(self, motions: Motion | Sequence[Motion]) -> NDArray[np.float32]:
        """Context vectors (N, C) float32 of motions; MotionError as :meth:`frames`."""
        return self.contexts(
            [self.frames(motion) for motion in ([motions] if isinstance(motions, Motion) else motions)]
        )

    def score(self, motion: Motion, sentence: str) -> float:
        """Log-probability of a sentence given a motion; unknown words count as UNK, and a TextWarning names them."""
        ids = self.vocabulary.ids
        words = np.concatenate([[ids[SOS]], self.ids(sentence), [ids[EOS]]])[None]
        feeds = {"context": self.embed(motion), "words": words}
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
