"""Generate: ranked motions for a sentence. Section 4.3 of Plappert et al. 2017."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np

from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.mixture import Noise, Sample
from motet.decode.noise import Recorded
from motet.errors import DecodingError
from motet.files import File
from motet.formats import write_motion
from motet.formats.character import Character
from motet.models.language import LanguageModel
from motet.models.progress import Progress, silent
from motet.models.seeds import Seed, seeds_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract

PLAYED = 30.0
"""Frames per second of what is generated, whatever the model's own rate is."""


@dataclass(frozen=True, eq=False, repr=False)
class Generated:
    """A generated motion, its log-likelihood given the sentence, and the words that were unknown.

    contract: what the frames mean. frames: (T, D) as they were drawn, in its channels; their feet slide.
    log_likelihood: of the normalised frames as drawn and of where they end, as :meth:`GenerateModel.score` gives it;
        None where the model's loop has no likelihoods.
    """

    contract: MotionContract
    frames: Array
    log_likelihood: float | None
    unknown: tuple[str, ...] = ()

    @cached_property
    def features(self) -> Motion:
        """The motion in the contract's channels and at its frame rate, its feet planted: to be measured."""
        return self.contract.features(self.frames, plant=True)

    @cached_property
    def motion(self) -> Motion:
        """The motion at 30 frames a second, going where its feet take it: to be played and written."""
        return self.playable()

    def playable(self, fps: float = PLAYED, plant: bool = True) -> Motion:
        """The motion at another frame rate, or without its feet planted: moving as it was drawn, with sliding feet."""
        return self.contract.motion(self.frames, plant=plant).resample(fps)

    def write(
        self,
        path: File,
        fps: float = PLAYED,
        plant: bool = True,
        *,
        like: File | Character | Motion | Skeleton | None = None,
    ) -> None:
        """Write :meth:`playable` as :func:`motet.write` does, perhaps put onto a character."""
        write_motion(path, self.playable(fps, plant), like=like)

    def __repr__(self) -> str:
        seconds = len(self.frames) / self.contract.fps
        score = "" if self.log_likelihood is None else f", log-likelihood {self.log_likelihood:.1f}"
        return f"Generated({len(self.frames)} frames, {seconds:.1f} s{score})"


class GenerateModel(LanguageModel):
    """A model that puts words into motion.

    graphs: "encoder" (words, lengths -> context), "step" (for the loop "mixture" frame, context, states ->
        log_weights, means, stds, active, next states) and perhaps "score" (context, frames -> log_likelihood), with
        frames normalised and the active flag last.
    Its loops (:mod:`motet.decode.loops`) take the step, contexts (B, C), a generator of noise for each row, the longest
    number of frames and their settings by name, and give samples for each row, best first.
    """

    VERB = "generate"

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph]) -> None:
        super().__init__(manifest, graphs)
        self.sizes["F"] = self.sizes["D"] + 1  # with the active flag
        context = {"context": "batch C"}
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, context)
        self.bind("step", self.loop.inputs, self.loop.outputs)
        if "score" in graphs:
            self.bind("score", {**context, "frames": "batch time F"}, {"log_likelihood": "batch time"})

    @overload
    def generate(  # type: ignore[overload-overlap]  # a string is a sequence of strings, too
        self,
        sentences: str,
        hypotheses: int | None = None,
        *,
        candidates: int | None = None,
        temperature: float | None = None,
        seed: Seed = 0,
        max_seconds: float | None = None,
        progress: Progress = silent,
    ) -> list[Generated]: ...
    @overload
    def generate(
        self,
        sentences: Sequence[str],
        hypotheses: int | None = None,
        *,
        candidates: int | None = None,
        temperature: float | None = None,
        seed: Seed = 0,
        max_seconds: float | None = None,
        progress: Progress = silent,
    ) -> list[list[Generated]]: ...
    def generate(
        self,
        sentences: str | Sequence[str],
        hypotheses: int | None = None,
        *,
        candidates: int | None = None,
        temperature: float | None = None,
        seed: Seed = 0,
        max_seconds: float | None = None,
        progress: Progress = silent,
    ) -> list[Generated] | list[list[Generated]]:
        """``hypotheses`` motions for a sentence, the likeliest per frame first; for several sentences a list for each.

        See :func:`motet.decode.mixture.mixture_search`.
        candidates: frames that each hypothesis draws in a step; 1 gives independent samples.
        temperature: of the draws about the centres of the mixture's components; lower trembles less.
        seed: sentence i has seed + i (or seed[i]), and the motions it would have alone with that seed.
        max_seconds: a motion that has not ended by then ends there.
        progress: called with the number of sentences done and of all.
        What is None comes from the bundle. TextError for a sentence that is empty, too long or wholly unknown;
        DecodingError for a setting out of range. Unknown words are named by a TextWarning and in the result.
        """
        texts = [sentences] if isinstance(sentences, str) else list(sentences)
        ids, seeds = [self.ids(text) for text in texts], seeds_of(seed, len(texts), DecodingError)
        chosen = {
            "hypotheses": hypotheses,
            "candidates": candidates,
            "temperature": temperature,
            "max_seconds": max_seconds,
        }
        settings = self.loop.settled(self.defaults, chosen)
        noise = [np.random.Generator(np.random.PCG64(one)) for one in seeds]
        contexts, found = self.contexts(ids), []
        for place in range(0, len(texts), self.loop.batch):
            batch = slice(place, place + self.loop.batch)
            found += self.decode(contexts[batch], noise[batch], settings)
            progress(len(found), len(texts))
        rows = [[self._generated(s, text) for s in row] for text, row in zip(texts, found, strict=True)]
        return rows[0] if isinstance(sentences, str) else rows

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """Samples for each context (B, C) by the model's loop, from the noise of each and all the loop's settings."""
        rest = {name: value for name, value in settings.items() if name != "max_seconds"}
        frames = max(1, round(settings["max_seconds"] * self.fps))
        found: list[list[Sample]] = self.loop.run(self.graphs["step"], contexts, noise, frames, **rest)
        return found

    def embed(self, sentences: str | Sequence[str]) -> Floats:
        """The context vector (C,) float32 of a sentence, or vectors (N, C) of several; errors as :meth:`ids`."""
        if isinstance(sentences, str):
            context: Floats = self.contexts([self.ids(sentences)])[0]
            return context
        return self.contexts([self.ids(text) for text in sentences])

    def score(self, sentence: str, motion: Motion) -> float:
        """Log-likelihood of a motion, and of its end, given a sentence; a TextWarning names words that count as UNK."""
        normal = self.contract.normalised(self.frames(motion))
        frames = np.zeros((1, len(normal) + 1, normal.shape[1] + 1), dtype=np.float32)
        frames[0, :-1, :-1], frames[0, :-1, -1] = normal, 1
        feeds = {"context": self.embed([sentence]), "frames": frames}
        return float(self.score_graph()(feeds)["log_likelihood"].sum(dtype=np.float64))

    def replay(self, given: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """A sentence ("text" of the settings) and its noise to ids (words,) int64 and the frames of the best motion.

        The noise of each kind is (steps, ...), the frames (T, D) are normalised.
        """
        ids, _ = self.vocabulary.encode(str(settings["text"]))
        chosen = self.loop.settled(self.defaults, {k: v for k, v in settings.items() if k != "text"})
        (row,) = self.decode(self.contexts([ids]), [Recorded(given)], chosen)
        return {"ids": ids, "frames": row[0].frames}

    def _generated(self, sample: Sample, text: str) -> Generated:
        frames = self.contract.denormalised(sample.frames)
        return Generated(self.contract, frames, sample.log_likelihood, tuple(self.unknown(text)))
