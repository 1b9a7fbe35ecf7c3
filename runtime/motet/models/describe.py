"""Describe: ranked sentences for a motion. Section 4.2 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.beam import Hypothesis, Limits
from motet.decode.loop import Loop
from motet.decode.loops import LOOPS
from motet.models.language import LanguageModel
from motet.models.progress import Progress, silent
from motet.models.text import EOS, PAD, SOS, UNK
from motet.motion.motion import Motion


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

    graphs: "encoder" (frames, lengths -> context), "step" (word, context, states -> log_probabilities, next states) and
        perhaps "score" (context, words -> log_probabilities).
    Its loops (:mod:`motet.decode.loops`) take the step, contexts (B, C), limits and their settings by name, and give up
    to ``beams`` hypotheses for each row, best first.
    """

    VERB = "describe"

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph]) -> None:
        super().__init__(manifest, graphs)
        context = {"context": "batch C"}
        self.bind("encoder", {"frames": "batch time D", "lengths": "*batch"}, context)
        self.bind("step", self.loop.inputs, self.loop.outputs)
        if "score" in graphs:
            self.bind("score", {**context, "words": "*batch words"}, {"log_probabilities": "batch words"})

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
            probable itself. By default the bundle's loop.
        progress: called with the number of motions done and of all.

        A motion at another frame rate is resampled. Each motion gets what it would get alone, and the same every time.
        MotionError as :meth:`frames`: longer motions go in :meth:`windows`. DecodingError where ``beams`` (the bundle's
        by default) is not between 1 and 100, or ``draws`` not between 0 and 1,000.
        """
        loop = self.loop if draws is None else LOOPS["consensus" if draws else "beam"]
        settings = loop.settled(loop.defaults(self.manifest.defaults), {"beams": beams, "draws": draws or None})
        contexts, found = self.embed([motions] if isinstance(motions, Motion) else motions), []
        for place in range(0, len(contexts), loop.batch):
            found += self._decoded(loop, contexts[place : place + loop.batch], settings)
            progress(len(found), len(contexts))
        rows = [[Description(self.vocabulary.decode(ids), *scores) for ids, *scores in row] for row in found]
        return rows[0] if isinstance(motions, Motion) else rows

    def _decoded(self, loop: Loop, contexts: Floats, settings: Mapping[str, Any]) -> list[list[Hypothesis]]:
        rest = {name: value for name, value in settings.items() if name != "max_words"}
        found: list[list[Hypothesis]] = loop.run(self.graphs["step"], contexts, self.limits(settings), **rest)
        return found

    def embed(self, motions: Motion | Sequence[Motion]) -> Floats:
        """The context vector (C,) float32 of a motion, or vectors (N, C) of several; MotionError as :meth:`frames`."""
        if isinstance(motions, Motion):
            context: Floats = self.contexts([self.frames(motions)])[0]
            return context
        return self.contexts([self.frames(motion) for motion in motions])

    def score(self, motion: Motion, sentence: str) -> float:
        """Log-probability of a sentence given a motion; unknown words count as UNK, and a TextWarning names them."""
        ids = self.vocabulary.ids
        words = np.concatenate([[ids[SOS]], self.ids(sentence), [ids[EOS]]])[None]
        feeds = {"context": self.embed([motion]), "words": words}
        return float(self.score_graph()(feeds)["log_probabilities"].sum(dtype=np.float64))

    def limits(self, settings: Mapping[str, Any]) -> Limits:
        """What bounds a sentence in ids of the vocabulary, with "max_words" of the settings."""
        start, end, *banned = (self.vocabulary.ids[word] for word in (SOS, EOS, PAD, UNK))
        return Limits(start, end, int(settings["max_words"]), [start, *banned])

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """Frames (T, D), and noise where the loop draws, to ids (W, words) int64 and log-probabilities (W,)."""
        extra = {"noise": given["noise"]} if "noise" in given else {}
        chosen = self.loop.settled(self.defaults, settings)
        (row,) = self._decoded(self.loop, self.contexts([given["frames"]]), {**chosen, **extra})
        ids = np.zeros((len(row), max(len(found.ids) for found in row)), dtype=np.int64)
        for place, found in zip(ids, row, strict=True):
            place[: len(found.ids)] = found.ids
        return {"ids": ids, "log_probabilities": np.array([found.log_probability for found in row])}
