"""Generate: motions for a sentence, as far as all models that generate are alike."""

from abc import abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, TypedDict, Unpack, cast, overload

import numpy as np

from motet.bundle.graph import Arrays, Floats
from motet.decode.loop import Noise, Recorded, Sample
from motet.errors import DecodingError, TextError, TextWarning, collected
from motet.files import File
from motet.formats import Character, write_motion
from motet.models.language import LanguageModel, texts_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.motion.skeleton import Skeleton
from motet.representation.contract import MotionContract
from motet.settings import Progress, Range, Seed, Settings, seeds_of, silent
from motet.text.clauses import Passage
from motet.text.numeric_phrases import Quantities

SETTLED = 0.3
"""Seconds in which the planting of feet blends in."""

PLAYED = 30.0
"""Frames per second of generated motions by default, whatever the model's own rate."""


LoopValues = Mapping[str, float | None]
"""Settings of a loop by name; None: the bundle's."""


class LoopSettings(TypedDict, total=False):
    """Settings as far as the model's loop has them: :meth:`GenerateModel.generate`. None: the bundle's."""

    candidates: int | None
    certainty: float | None
    first_temperature: float | None
    guidance: float | None
    max_seconds: float | None
    memory: float | None
    temperature: float | None
    top_p: float | None


class GenerateSettings(LoopSettings, total=False):
    """Settings of a call of :meth:`GenerateModel.generate`; None: the bundle's."""

    seconds: float | None


class _Options(GenerateSettings, total=False):
    numbers: bool
    whole: bool
    seed: Seed
    strict: bool
    progress: Progress


@dataclass(frozen=True)
class FamiliaritySettings(Settings):
    """When a sentence counts as known (docs/generate.md)."""

    FEATURE: ClassVar[str] = "familiarity"

    confident: Annotated[float, Range(0, 1)] = 0.5
    """Least confidence of a known sentence."""

    doubt: Annotated[float, Range(0, 10)] = 0.25
    """Exponent of the probability of the likeliest action, which is often low because sentences share actions."""


@dataclass(frozen=True, eq=False, repr=False)
class Generated:
    """A generated motion, its log-likelihood given the sentence, and the words that were unknown."""

    contract: MotionContract
    """The meaning of the frames."""

    frames: Array
    """(T, D) as drawn, in the contract's channels."""

    log_likelihood: float | None
    """Of the normalised frames as drawn and of their end, like :meth:`GenerateModel.score`; None where the model's loop
    has no likelihoods."""

    unknown: tuple[str, ...] = ()
    """Words of the sentence that the model does not know."""

    after: Motion | None = None
    """The motion that it continues; without one it starts at the origin."""

    action: str = ""
    """A sentence of the action that it shows; "" where a model knows none, or several are shown."""

    lacking: tuple[str, ...] = ()
    """Known words of its sentence that no sentence of that action has."""

    confidence: float | None = None
    """How well the model knows its sentence (:meth:`motet.generate.model.CodesModel.understood`), 0 to 1; of several
    sentences the least; None where a model cannot tell."""

    requested: Mapping[str, float] = field(default_factory=dict)
    """The numbers in its sentence (:mod:`motet.text.numeric_phrases`): degrees to the left, metres, steps, times,
    seconds, and a pace relative to the usual one; empty where several things are shown."""

    measured: Mapping[str, float] = field(default_factory=dict)
    """How much of each the motion has, as far as it can be measured."""

    @cached_property
    def features(self) -> Motion:
        """The motion in the contract's channels and at its frame rate, its feet planted: for measuring. The
        continuation of a motion whose feet are not planted is planted gradually."""
        planted = self.contract.features(self.frames, plant=True)
        if self.after is None:
            return planted
        share = np.minimum(np.arange(len(planted)) / (SETTLED * planted.fps), 1.0)[:, None]
        return replace(planted, values=self.frames + share * (planted.values - self.frames))

    @cached_property
    def motion(self) -> Motion:
        """The motion at 30 frames per second, its path following its planted feet: for playing and writing."""
        return self.playable()

    def playable(self, fps: float = PLAYED, plant: bool = True) -> Motion:
        """The motion at another frame rate, or as drawn: feet not planted, and possibly sliding."""
        frames = self.features.values if plant else self.frames
        return self.contract.motion(frames, after=self.after, plant=False).resample(fps)

    def write(
        self,
        path: File,
        fps: float = PLAYED,
        plant: bool = True,
        *,
        like: File | Character | Motion | Skeleton | None = None,
        onto: File | Character | None = None,
    ) -> None:
        """Write :meth:`playable` like :func:`motet.write`, optionally retargeted onto a character, or into its file."""
        write_motion(path, self.playable(fps, plant), like=like, onto=onto)

    def __repr__(self) -> str:
        seconds = len(self.frames) / self.contract.fps
        score = "" if self.log_likelihood is None else f", log-likelihood {self.log_likelihood:.1f}"
        return f"Generated({len(self.frames)} frames, {seconds:.1f} s{score})"


@dataclass(frozen=True, eq=False, repr=False)
class Story(Generated):
    """One motion for several sentences, and when each is shown."""

    passages: tuple[Passage, ...] = ()


@dataclass(frozen=True)
class Understood:
    """How well a model knows a sentence."""

    confidence: float
    """The share of known words, rare words counting more, times the certainty about the action meant; 0 to 1."""

    nearest: tuple[str, ...]
    """Sentences of the likeliest actions, the likeliest first."""

    confident: bool
    """Whether the model knows the sentence."""


class GenerateModel(LanguageModel):
    """A text-to-motion model, by the bundle's loop :class:`motet.papers.mixture_model.MixtureModel` or
    :class:`motet.generate.model.CodesModel`."""

    VERB = "generate"

    @overload
    def generate(  # type: ignore[overload-overlap]  # a string is a sequence of strings, too
        self, sentences: str, hypotheses: int | None = None, **options: Unpack[_Options]
    ) -> list[Generated]: ...
    @overload
    def generate(
        self, sentences: Sequence[str], hypotheses: int | None = None, **options: Unpack[_Options]
    ) -> list[list[Generated]]: ...
    def generate(
        self,
        sentences: str | Sequence[str],
        hypotheses: int | None = None,
        *,
        numbers: bool = True,
        whole: bool = False,
        seed: Seed = 0,
        strict: bool = False,
        progress: Progress = silent,
        **settings: Unpack[GenerateSettings],
    ) -> list[Generated] | list[list[Generated]]:
        """``hypotheses`` motions for a sentence; for several sentences, a list for each.

        A mixture model ranks them, the likeliest per frame first. Those of a motion-code model are independent, and the
        first does not depend on their number.
        numbers: show as many degrees, metres, steps, times and seconds as sentences say (:meth:`quantities`), or warn.
        whole: show a sentence that requests several things in a row (:meth:`parts`) as one; else each of its motions is
            a story of its parts, and seconds is the length of all of them together.
        seed: sentence i uses seed + i (or seed[i]), and gets the same motions as alone with that seed.
        strict: refuse a sentence with unknown words, one that is outside the training data, and one whose action leaves
            out a word; else these are warnings. progress: called with the number of sentences done and in all.
        settings: those of the model's loop; None (the default) for the bundle's.
            temperature: of sampling: about the centres of a mixture's components, or of codes. max_seconds: a motion
            that has not ended by then is cut. Mixture models also take candidates: frames drawn by each hypothesis in a
            step; 1 gives independent samples. Motion-code models also take seconds: the length of the motion, where an
            action that ends early is repeated; and top_p: nucleus sampling, the most likely codes up to this mass.
        TextError for a sentence that is empty, too long or wholly unknown; DecodingError for a setting that is out of
        range or unknown to the loop. Unknown words are named by a TextWarning and in the result.
        """
        texts = texts_of(sentences)
        drawing = {"hypotheses": hypotheses, **cast(LoopValues, settings)}
        seeds = seeds_of(seed, len(texts), DecodingError)
        motions: dict[int, list[Generated]] = {}
        for number, motions_of_text in self._motions(texts, seeds, strict, drawing, numbers, whole):
            motions[number] = motions_of_text
            progress(len(motions), len(texts))
        return motions[0] if isinstance(sentences, str) else [motions[number] for number in range(len(texts))]

    def _composed(self, sentence: str, numbers: bool, whole: bool, settings: LoopValues) -> bool:
        """Whether a sentence is shown as a story: for its parts, its numbers, or the seconds of the settings."""
        if not whole and len(self.parts(sentence)) > 1:
            return True
        return numbers and bool(self.quantities(sentence).amounts)

    def _motions(
        self,
        texts: Sequence[str],
        seeds: Sequence[int],
        strict: bool,
        drawing: LoopValues,
        numbers: bool,
        whole: bool,
    ) -> Iterator[tuple[int, list[Generated]]]:
        """The number and the motions of each sentence: those drawn as a whole, then the stories."""
        is_composed = [self._composed(text, numbers, whole, drawing) for text in texts]
        yield from self._drawn(texts, seeds, strict, drawing, [i for i in range(len(texts)) if not is_composed[i]])
        reading = {**drawing, "numbers": numbers, "whole": whole}
        for i in range(len(texts)):
            if is_composed[i]:
                yield i, self.composed(texts[i], seeds[i], strict, reading)

    def _drawn(
        self, texts: Sequence[str], seeds: Sequence[int], strict: bool, drawing: LoopValues, numbers: Sequence[int]
    ) -> Iterator[tuple[int, list[Generated]]]:
        """The motions of the sentences with these numbers, drawn as a whole and in batches."""
        texts_drawn = [texts[i] for i in numbers]
        seeds_drawn = [seeds[i] for i in numbers]
        contexts, noise, chosen = self.drawing_inputs(texts_drawn, len(numbers), seeds_drawn, strict, drawing)
        for start in range(0, len(numbers), self.loop.batch):
            batch = slice(start, start + self.loop.batch)
            for i, samples in zip(numbers[batch], self.decode(contexts[batch], noise[batch], chosen), strict=True):
                yield i, self.results(texts[i], samples)

    def results(self, sentence: str, samples: Sequence[Sample]) -> list[Generated]:
        """The motions drawn for a sentence; a TextWarning where they show less than it says."""
        unknown = tuple(self.unknown(sentence))
        return [Generated(self.contract, sample.frames, sample.log_likelihood, unknown) for sample in samples]

    def parts(self, sentence: str) -> list[str]:
        """The things that a sentence requests one after another; itself, where the model knows it as one thing."""
        return [sentence]

    def quantities(self, sentence: str) -> Quantities:
        """The numbers in a sentence, and the text that it is read as without them; none where the model's loop cannot
        follow them."""
        return Quantities(sentence)

    def composed(self, sentence: str, seed: int, strict: bool, settings: Mapping[str, Any]) -> list[Generated]:
        """``settings["hypotheses"]`` motions that show the parts of a sentence; see :meth:`generate`."""
        raise DecodingError(f"models of the loop {self.manifest.loop!r} show one sentence at a time")

    def drawing_inputs(
        self, texts: Sequence[str], rows: int, seed: Seed, strict: bool, settings: LoopValues
    ) -> tuple[Floats, list[np.random.Generator], dict[str, float]]:
        """Contexts (N, C) of sentences, noise of ``rows`` rows, and all settings of the loop; see :meth:`generate`."""
        chosen = self._settled(settings)
        contexts = self.embed(texts)
        noise = [np.random.Generator(np.random.PCG64(row_seed)) for row_seed in seeds_of(seed, rows, DecodingError)]
        for text, context in zip(texts, contexts, strict=True):
            self.note(text, context, strict)
        return contexts, noise, chosen

    def _settled(self, settings: LoopValues) -> dict[str, float]:
        """All settings of the loop, the bundle's in place of None; DecodingError like :meth:`generate`."""
        if settings.get("seconds") == 0:
            raise DecodingError("seconds must be more than 0; omit them to let a motion end by itself")
        return self.loop.settled(self.defaults, settings)

    def check(self, sentence: str, whole: bool = False, numbers: bool = True, lacking: bool = True) -> None:
        """TextError where the model does not know all of a sentence, or of its parts; see :meth:`note`.

        lacking: and where the action that it is read as leaves out a word (:meth:`check_whole`).
        """
        with collected(TextWarning):
            for part in [sentence] if whole else self.parts(sentence):
                text = self.quantities(part).text if numbers else part
                self.note(text, self.embed(text), strict=True)
                if lacking:
                    self.check_whole(part, numbers)

    def check_whole(self, sentence: str, numbers: bool = True) -> None:
        """TextError where the action that a sentence is read as leaves out a word of it, if the model knows actions.

        numbers: read it without its numbers.
        """

    def note(self, sentence: str, context: Floats, strict: bool) -> None:
        """Warn if the model knows a sentence with this context (C,) only in part, apart from its unknown words.

        strict: raise TextError instead.
        """
        if strict and (unknown := self.unknown(sentence)):
            raise TextError(f"the model does not know {', '.join(unknown)} (in {sentence!r})")

    @abstractmethod
    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """Samples for each context (B, C) from its noise and the loop's settings; frames in the contract's units."""

    def embed(self, sentences: str | Sequence[str]) -> Floats:
        """The context vector (C,) float32 of a sentence, or vectors (N, C) of several; errors like :meth:`ids`."""
        contexts = self.contexts([self.ids(text) for text in texts_of(sentences)])
        return contexts[0] if isinstance(sentences, str) else contexts

    def score(self, sentence: str, motion: Motion) -> float:
        """Log-likelihood of a motion, and of its end, given a sentence; a TextWarning names the words taken as UNK.
        DecodingError for a model whose loop has no likelihoods."""
        raise DecodingError(f"models of the loop {self.manifest.loop!r} cannot score motions")

    def replay(self, inputs: Arrays, settings: Mapping[str, Any]) -> Arrays:
        """A sentence ("text" of the settings) and its noise to ids (words,) int64 and the frames of the best motion.
        The noise of each kind is (calls, ...), the frames (T, D) are normalised."""
        ids, _ = self.vocabulary.encode(str(settings["text"]))
        chosen = self.loop.settled(self.defaults, {name: value for name, value in settings.items() if name != "text"})
        (row,) = self.decode(self.contexts([ids]), [Recorded(inputs)], chosen)
        return {"ids": ids, "frames": self.contract.normalised(row[0].frames).astype(np.float32)}
