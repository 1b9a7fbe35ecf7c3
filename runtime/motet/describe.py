"""Describe: ranked sentences for a motion. Section 4.2 of Plappert et al. 2017."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from motet.decode.beam import beam_search
from motet.language import LanguageModel
from motet.motion import Motion
from motet.text import EOS, MAX_WORDS, PAD, SOS, UNK

BATCH = 128
"""Motions that are decoded at once; more bring no speed and take memory."""


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

    def describe(self, motions: Motion | Sequence[Motion], beams: int | None = None) -> list[list[Description]]:
        """For each motion up to ``beams`` descriptions, the most probable first.

        A motion at another frame rate is resampled. Each motion gets what it would get alone. MotionError as
        :meth:`frames`; DecodingError where ``beams`` (the bundle's by default) is not between 1 and 100.
        """
        width = int(self.setting("beams", beams, 1, 100))
        longest = int(self.defaults.get("max_words", MAX_WORDS))
        start, end, *banned = (self.vocabulary.ids[word] for word in (SOS, EOS, PAD, UNK))
        contexts = self.embed(motions)
        found = []
        for place in range(0, len(contexts), BATCH):
            batch = contexts[place : place + BATCH]
            found += beam_search(self.graphs["step"], batch, width, start, end, longest, [start, *banned])
        return [[Description(self.vocabulary.decode(ids), score) for ids, score in row] for row in found]

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
