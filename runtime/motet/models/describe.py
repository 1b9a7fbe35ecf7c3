"""Describe: ranked sentences for a motion. Section 4.2 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal, SupportsIndex, overload

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.ancestral import noise_of
from motet.decode.beam import Hypothesis, Limits
from motet.decode.loop import Loop
from motet.decode.loops import LOOPS
from motet.decode.score import score_words
from motet.errors import DecodingError
from motet.models.language import EOS, MAX_SECONDS, PAD, SOS, UNK, LanguageModel
from motet.models.timeline import TimelineSettings, best_path, edges, near_scores, windows
from motet.motion.motion import Motion
from motet.settings import Progress, Range, Settings, seeds_of, silent

Decoding = Literal["beam", "consensus"]
"""How descriptions are found."""


@dataclass(frozen=True)
class ConfidenceSettings(Settings):
    """log_probability: least of a confident description. Training finds it (docs/language.md)."""

    FEATURE: ClassVar[str] = "confidence"
    log_probability: Annotated[float, Range(-1000, 0, "nats")] = -5.5


@dataclass(frozen=True)
class Description:
    """A sentence, normalised, and the natural logarithm of its probability given the motion.

    score: by which the sentences of a motion are ranked: the log-probability, or the agreement of a sampled sentence
        with all samples, from 0 to 1. confident: whether it is as probable as correct descriptions are.
    """

    text: str
    log_probability: float
    score: float
    confident: bool

    def to_json(self) -> dict[str, Any]:
        """All fields as a JSON object."""
        return asdict(self)


@dataclass(frozen=True)
class Part(Description):
    """A description of a part of a motion, from ``start`` to ``stop`` in seconds."""

    start: float
    stop: float


class DescribeModel(LanguageModel):
    """A motion captioning model.

    graphs: "encoder" (frames, lengths -> context) and "step" (word, context, states -> log_probabilities, next states).
    Its loops (:mod:`motet.decode.loops`) take the step, contexts (B, C), limits and their settings by name, and return
    up to ``beams`` hypotheses for each row, best first.
    """

    VERB = "describe"
    SETTINGS = (ConfidenceSettings, TimelineSettings)
    LOOPS = ("beam", "consensus")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.bind("encoder", {"frames": "batch time D", "lengths": "*batch"}, {"context": "batch C"})
        self.bind("step", self.loop.inputs, self.loop.outputs)

    @overload
    def describe(
        self,
        motions: Motion,
        beams: int | None = None,
        draws: int | None = None,
        *,
        decoding: Decoding | None = None,
        seed: SupportsIndex = 0,
        progress: Progress = ...,
    ) -> list[Description]: ...
    @overload
    def describe(
        self,
        motions: Sequence[Motion],
        beams: int | None = None,
        draws: int | None = None,
        *,
        decoding: Decoding | None = None,
        seed: SupportsIndex = 0,
        progress: Progress = ...,
    ) -> list[list[Description]]: ...
    def describe(
        self,
        motions: Motion | Sequence[Motion],
        beams: int | None = None,
        draws: int | None = None,
        *,
        decoding: Decoding | None = None,
        seed: SupportsIndex = 0,
        progress: Progress = silent,
    ) -> list[Description] | list[list[Description]]:
        """Up to ``beams`` descriptions of a motion, the best first; for several motions, a list for each.

        decoding: "beam" for beam search, whose best is the most probable sentence; "consensus" for sampling ``draws``
            sentences, the best being the one that agrees most with all (:mod:`motet.decode.consensus`), not necessarily
            a probable one. By default consensus where ``draws`` is given, and otherwise the bundle's loop.
        seed: of sampling; each motion gets the same samples as alone.
        progress: called with the number of motions done and in total.

        A motion at another frame rate is resampled. MotionError like :meth:`frames`; cut longer motions with
        :meth:`windows`. DecodingError where ``beams`` (the bundle's by default) is not between 1 and 100, ``draws`` not
        between 1 and 1,000 or given for beam search, or the seed negative.
        """
        if decoding not in (None, *self.LOOPS):
            raise DecodingError(f"decoding must be one of {', '.join(self.LOOPS)}, not {decoding!r}")
        name = decoding or (None if draws is None else "consensus")
        loop, (first,) = LOOPS[name] if name else self.loop, seeds_of(seed, 1, DecodingError)
        given = {"beams": beams, "draws": draws}
        settings: dict[str, Any] = {**loop.settled(loop.defaults(self.manifest.defaults), given)}
        if "draws" in settings:
            settings["noise"] = noise_of(self.limits(settings), settings["draws"], first)
        contexts = self.embed([motions] if isinstance(motions, Motion) else motions)
        found = self._hypotheses(loop, contexts, settings, progress)
        rows = [[self._description(hypothesis) for hypothesis in row] for row in found]
        return rows[0] if isinstance(motions, Motion) else rows

    def _description(self, found: Hypothesis) -> Description:
        sure = found.log_probability >= self.settings(ConfidenceSettings).log_probability
        return Description(self.vocabulary.decode(found.ids), found.log_probability, found.score, sure)

    def timeline(self, motion: Motion, *, progress: Progress = silent) -> list[Part]:
        """What happens in a motion of any length: consecutive parts, each with its best description.

        Short windows are described, each sentence is scored for all nearby windows, and the motion is cut where
        switching to another sentence pays (:mod:`motet.models.timeline`). Each part is then described like in
        :meth:`describe`, one of more than 30 s by its middle; neighbours with the same description are merged.

        progress: called with the number of windows done and in total.
        MotionError like :meth:`frames`, except for long motions.
        """
        motion = self.contract.on_figure(motion).resample(self.fps)
        settings = self.settings(TimelineSettings)
        spans = windows(len(motion), motion.fps, settings)
        contexts = self.embed([motion[start:stop] for start, stop in spans])
        scores = near_scores(self.graphs["step"], contexts, self._likeliest(contexts), settings.reach, progress)
        return self._parts(motion, edges(spans, best_path(scores, settings.change)))

    def _likeliest(self, contexts: Floats) -> list[tuple[int, ...]]:
        """The most probable sentence of each context, as ids from the start to the end."""
        start, end = (self.vocabulary.ids[word] for word in (SOS, EOS))
        beam = LOOPS["beam"]
        found = self._hypotheses(beam, contexts, beam.defaults(self.manifest.defaults))
        return [(start, *best.ids, end) for best, *_ in found]

    def _parts(self, motion: Motion, cuts: list[int]) -> list[Part]:
        """Parts of a motion between cuts; a cut between two equal descriptions is dropped."""
        found = [row[0] for row in self.describe([_middle(motion[a:b]) for a, b in pairwise(cuts)])]
        inner = [cut for cut, (one, two) in zip(cuts[1:-1], pairwise(found), strict=True) if one.text != two.text]
        if len(inner) < len(cuts) - 2:
            return self._parts(motion, [cuts[0], *inner, cuts[-1]])
        times = pairwise(cut / motion.fps for cut in cuts)
        return [Part(**asdict(said), start=a, stop=b) for said, (a, b) in zip(found, times, strict=True)]

    def _hypotheses(
        self, loop: Loop, contexts: Floats, settings: Mapping[str, Any], progress: Progress = silent
    ) -> list[list[Hypothesis]]:
        """The hypotheses of many contexts, decoded in batches of the loop's size."""
        found: list[list[Hypothesis]] = []
        for place in range(0, len(contexts), loop.batch):
            found += self._decoded(loop, contexts[place : place + loop.batch], settings)
            progress(len(found), len(contexts))
        return found

    def _decoded(self, loop: Loop, contexts: Floats, settings: Mapping[str, Any]) -> list[list[Hypothesis]]:
        rest = {name: value for name, value in settings.items() if name != "max_words"}
        found: list[list[Hypothesis]] = loop.run(self.graphs["step"], contexts, self.limits(settings), **rest)
        return found

    def embed(self, motions: Motion | Sequence[Motion]) -> Floats:
        """The context vector (C,) float32 of a motion, or (N, C) of several; MotionError like :meth:`frames`."""
        if isinstance(motions, Motion):
            context: Floats = self.contexts([self.frames(motions)])[0]
            return context
        return self.contexts([self.frames(motion) for motion in motions])

    def score(self, motion: Motion, sentence: str) -> float:
        """Log-probability of a sentence given a motion; unknown words count as UNK, and a TextWarning names them."""
        ids = self.vocabulary.ids
        words = np.concatenate([[ids[SOS]], self.ids(sentence), [ids[EOS]]])[None]
        return float(score_words(self.graphs["step"], self.embed([motion]), np.zeros(1, np.int64), words)[0])

    def limits(self, settings: Mapping[str, Any]) -> Limits:
        """The limits of a sentence, in ids of the vocabulary, with "max_words" of the settings."""
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


def _middle(motion: Motion) -> Motion:
    """The middle of a motion too long for the model."""
    most = int(MAX_SECONDS * motion.fps + 1e-9)
    start = max(0, len(motion) - most) // 2
    return motion[start : start + most]
