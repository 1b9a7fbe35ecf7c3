"""Generate motions code by code, of natural or given length, continue them, and show several sentences as a story."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.codec import Codec, Context, ReceptiveField, StreamingDecoder
from motet.decode.codes import Drawing, Source, Writer, draw_codes, drawn_actions, drawn_steps
from motet.decode.continuation_settings import ContinuationSettings
from motet.decode.memory import Memory
from motet.decode.noise import Noise, apart
from motet.decode.sample import Sample
from motet.errors import BundleError, DecodingError, MotionError, TextError, TextWarning, warn
from motet.models.familiarity import FamiliaritySettings, Known, Understood
from motet.models.generate import Generated, GenerateModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_sixd import in_world
from motet.settings import Seed

FINE = 4
"""Frames that the decoder's frame-rate layers look back."""

STANDING = "a person stands still"
"""Sentence for a motion that is to start or end standing."""

STAND = 0.8
"""Seconds of standing."""

LONGEST = 600.0
"""Most seconds of a sentence."""

Stand = Literal["start", "end", "both"]
"""Where a figure stands briefly."""

Seconds = float | None | Sequence[float | None]
"""Lengths of sentences: one for all, or for each; None for one that ends by itself."""


@dataclass(frozen=True)
class Passage:
    """A sentence of a story, shown from ``start`` to ``stop`` in seconds."""

    text: str
    start: float
    stop: float


@dataclass(frozen=True, eq=False, repr=False)
class Story(Generated):
    """One motion for several sentences, and when each is shown."""

    passages: tuple[Passage, ...] = ()


class Telling(NamedTuple):
    """A requested story: its sentences, the seconds of each or 0, contexts, noise of one row, all settings, and
    the motion on the model's figure that it continues, if any."""

    texts: list[str]
    seconds: list[float]
    contexts: Floats
    noise: list[np.random.Generator]
    settings: Mapping[str, Any]
    after: Motion | None


class CodesModel(GenerateModel):
    """A model that generates motion codes.

    graphs: "encoder" (words, lengths -> context: log-probabilities of actions), "step" (codes, action, age, states ->
        known, numbers, next states), "part" (known, codes -> log_probabilities), "decoder" (codes -> frames, moves),
        "tokens" (frames -> codes of the body). tables: "memory", "moves" and "body", see docs/bundle.md.
    """

    SETTINGS = (FamiliaritySettings, ContinuationSettings)
    LOOPS = ("codes",)
    ROLES = ("encoder", "part", "decoder", "tokens", "step")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        codec = Fields(manifest.config, "config").fields("codec")
        moves, self.sizes["T"] = codec.whole("moves", 1, 1 << 15), codec.whole("hop", 2, 100)
        ahead = codec.items("ahead")
        if len(ahead) > 100 or any(one not in (0, 1) for one in ahead):
            raise codec.fault("0 or 1 for each of at most 100 layers", ahead, "ahead")
        back = sum(2 - one for one in ahead) + math.ceil(FINE / self.sizes["T"])
        field = ReceptiveField(back, sum(ahead), self.sizes["T"])
        self.codec = Codec(graphs["decoder"], graphs["tokens"], field, moves, self.fps)
        self._bind()
        self.source = Source(graphs["step"], graphs["part"], moves, self.sizes["A"], self._memory())
        self.continuation, familiarity = self.settings(ContinuationSettings), self.settings(FamiliaritySettings)
        self.known = Known.read(Fields(manifest.source), self.sizes["A"], self.vocabulary.rules, familiarity)

    def _bind(self) -> None:
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch A"})
        self.bind("step", self.loop.inputs, self.loop.outputs)
        self.bind("part", {"known": "batch H", "codes": "*batch P"}, {"log_probabilities": "batch P K"})
        self.bind("decoder", {"codes": "*batch steps P"}, {"frames": "batch steps T D", "moves": "batch steps 3"})
        self.sizes["B"] = self.sizes["P"] - 1
        self.bind("tokens", {"frames": "batch steps T D"}, {"codes": "*batch steps B"})
        if self.codec.moves >= self.sizes["K"]:
            most = self.sizes["K"] - 1
            raise BundleError(f"manifest, config.codec.moves: must be at most {most}, to fit the graph part")

    def _memory(self) -> Memory:
        self.sizes |= {"S": self.sizes["P"] + 2, "M": self.codec.moves}
        steps, moves = self.table("memory", "R S", "int16"), self.table("moves", "M 3", "float32")
        body = self.table("body", "Q N", "float32")
        if 3 + self.sizes["B"] * self.sizes["N"] != self.sizes["L"]:
            raise BundleError("manifest, tables.body: does not fit the graph step")
        return Memory.of(steps, moves, body, self.sizes["A"])

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """See :meth:`motet.models.language.LanguageModel.contexts`; one by one: padding changes how sums round."""
        alone = [super(CodesModel, self).contexts([sequence], role) for sequence in sequences]
        return np.concatenate([np.empty((0, self.sizes["A"]), dtype=np.float32), *alone])

    def understood(self, sentence: str) -> Understood:
        """How well a sentence is known, and the nearest known sentences; errors like :meth:`ids`."""
        return self.known.understood(sentence, self.embed(sentence))

    def note(self, sentence: str, context: Floats, strict: bool) -> None:
        """See :meth:`GenerateModel.note`."""
        found = self.known.understood(sentence, context)
        if found.confident:
            return
        near = ", ".join(f"'{one}'" for one in found.nearest)
        said = f"{sentence!r} is outside the training data (confidence {found.confidence:.2f}); nearest: {near}"
        if strict:
            raise TextError(said)
        warn(said, TextWarning)

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        count = settings["hypotheses"]
        rows = np.repeat(np.arange(len(contexts)), count)
        each = [one for own in noise for one in apart(own, count)]
        actions = drawn_actions(self.source, contexts[rows], each, settings["certainty"])
        seconds = settings["seconds"]
        longest = max(1, self.codec.steps(seconds or settings["max_seconds"]))
        found = draw_codes(self.writer(each, settings), actions, longest, exactly=seconds > 0)
        last = max(1, round(seconds * self.fps)) if seconds else None
        samples = [Sample(self.codec.frames_of(codes)[:last], None) for codes in found]
        return [samples[start : start + count] for start in range(0, len(samples), count)]

    def story(
        self,
        sentences: str | Sequence[str],
        *,
        after: Motion | None = None,
        seconds: Seconds = None,
        stand: Stand | None = None,
        seed: Seed = 0,
        strict: bool = False,
        **settings: float | None,
    ) -> Story:
        """One continuous motion for several sentences, each starting where the last one ends.

        after: a motion to continue, of any human figure, from its last seconds. seconds: of each sentence, or one value
        for all, to within one code; by default each ends by itself. stand: where the figure is to stand briefly. Others
        like :meth:`generate`; a story of one sentence is the motion that it returns.
        DecodingError for seconds, a seed or a setting out of range, and for several ``hypotheses``; MotionError for a
        motion that is too short to continue or not of a human figure; TextError like :meth:`generate`.
        """
        told = self._telling(sentences, after, seconds, stand, seed, strict, settings)
        pieces = list(self._pieces(told))
        frames = np.concatenate([found for _, found in pieces])
        steps = Counter(number for number, _ in pieces[:-1])
        shown = accumulate(steps[number] * self.codec.field.hop for number in range(len(told.texts)))
        stops = [min(stop, len(frames)) / self.fps for stop in shown]
        passages = tuple(map(Passage, told.texts, [0.0, *stops], stops))
        unknown = tuple(word for text in told.texts for word in self.unknown(text))
        return Story(self.contract, frames, None, unknown, told.after, passages)

    def stream(
        self,
        sentences: str | Sequence[str],
        *,
        after: Motion | None = None,
        seconds: Seconds = None,
        stand: Stand | None = None,
        seed: Seed = 0,
        strict: bool = False,
        **settings: float | None,
    ) -> Iterator[Motion]:
        """The motion of :meth:`story` in pieces, as they are drawn: each continues the last one.

        Feet are as drawn, since planting them requires knowing how long they stand. Memory and the time of a piece stay
        constant, however long the stream lasts. Errors like :meth:`story`.
        """
        return self._streamed(self._telling(sentences, after, seconds, stand, seed, strict, settings))

    def _streamed(self, told: Telling) -> Iterator[Motion]:
        last, pose = told.after, None
        for _, frames in self._pieces(told):
            if len(frames):
                last, pose = in_world(self.contract.features(frames), last, pose)
                yield last

    def _telling(
        self,
        sentences: str | Sequence[str],
        after: Motion | None,
        seconds: Seconds,
        stand: str | None,
        seed: Seed,
        strict: bool,
        settings: Mapping[str, float | None],
    ) -> Telling:
        texts = [sentences] if isinstance(sentences, str) else list(sentences)
        if not texts:
            raise TextError("a story needs a sentence")
        if stand not in (None, *get_args(Stand)):
            raise DecodingError(f"stand is one of {', '.join(get_args(Stand))}, not {stand!r}")
        if settings.get("hypotheses") not in (None, 1):
            raise DecodingError(f"a story is one motion: hypotheses must be 1, not {settings['hypotheses']}")
        each = _each(self.defaults["seconds"] if seconds is None else seconds, len(texts))
        before, behind = ([STANDING] * (stand in (end, "both")) for end in ("start", "end"))
        texts = [*before, *texts, *behind]
        each = [STAND] * len(before) + each + [STAND] * len(behind)
        contexts, noise, chosen = self.asked(texts, 1, seed, strict, settings)
        return Telling(texts, each, contexts, noise, chosen, None if after is None else self.on_figure(after))

    def _pieces(self, told: Telling) -> Iterator[tuple[int, Array]]:
        """For each step of codes, the number of its sentence and the frames (T, D) that become final with it; then the
        remaining frames."""
        context = None if told.after is None else self.context(told.after)
        writer, decoder = self.writer(told.noise, told.settings), self.decoder(context)
        if context is not None:
            writer.see(context.codes)
        done, given, end, limit = 0, 0, 0.0, None
        for number, (context_, seconds) in enumerate(zip(told.contexts, told.seconds, strict=True)):
            action = drawn_actions(self.source, context_[None], told.noise, told.settings["certainty"])
            end = (end or 0.0) + seconds
            longest = self.codec.steps(end) - done if seconds else self.codec.steps(told.settings["max_seconds"])
            limit = max(1, round(end * self.fps)) if seconds else None
            for _, step in drawn_steps(writer, action, longest, exactly=seconds > 0):
                done += 1
                frames = decoder.push(step)[: None if limit is None else limit - given]
                given += len(frames)
                yield number, frames
            end = end if seconds else done * self.codec.seconds
        yield number, decoder.finish()[: None if limit is None else limit - given]

    def writer(self, noise: Sequence[Noise], settings: Mapping[str, Any]) -> Writer:
        """A writer of codes for rows with the given noise."""
        return Writer(self.source, noise, Drawing.of(settings))

    def decoder(self, context: Context | None = None) -> StreamingDecoder:
        """A decoder of codes to frames, from the origin or after the end of a motion."""
        return StreamingDecoder(self.codec, context, self.continuation.half_life)

    def on_figure(self, motion: Motion) -> Motion:
        """A motion of any human figure on the model's, at its frame rate; the last frame is kept."""
        return self.contract.on_figure(self.at_own_rate(motion))

    def context(self, figure: Motion) -> Context:
        """The last seconds, whole steps of codes, of a motion on the model's figure; MotionError where it is too short
        to continue."""
        hop = self.codec.field.hop
        frames = self.contract.frames(figure)[-self.codec.steps(self.continuation.context) * hop :]
        if len(frames) < 2 * hop:
            raise MotionError(f"a motion of {len(frames)} frames is too short to continue: {2 * hop} are needed")
        frames = frames[len(frames) % hop :]
        return Context(frames, self.codec.codes_of(frames))


def _each(seconds: float | Sequence[float | None], count: int) -> list[float]:
    """The seconds of each of ``count`` sentences, 0 where it ends by itself; DecodingError for anything but numbers,
    or another number of them."""
    try:
        given = list(seconds) if isinstance(seconds, Iterable) else [seconds] * count
        found = [0.0 if one is None else float(0.0 + one) for one in given]
    except (TypeError, ValueError):
        found = []
    if len(found) != count or not all(0 <= one <= LONGEST for one in found):
        asked = f"a number from 0 to {LONGEST:g}, or one for each of {count} sentences"
        raise DecodingError(f"seconds must be {asked}, not {seconds}")
    return found
