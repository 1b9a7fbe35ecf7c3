"""Motion as words: motions written code by code, as long as they take or as is asked, continued, told as a story."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from motet.arguments import warn
from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.codes import Drawing, Source, Writer, draw_codes, drawn_actions, drawn_steps
from motet.decode.memory import Memory
from motet.decode.noise import Noise, apart
from motet.decode.planar import nearest_moves
from motet.decode.rollout import Ids
from motet.decode.sample import Sample
from motet.decode.streaming_decoder import Sight, Unrolled
from motet.errors import BundleError, DecodingError, MotionError, TextError, TextWarning
from motet.models.familiarity import FamiliaritySettings, Known, Understood
from motet.models.generate import Generated, GenerateModel
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_block import way
from motet.representation.root_sixd import in_world

FINE = 4
"""Frames that the decoder's layers at the rate of frames look back."""

CONTEXT = 4.0
"""Seconds of a given motion that are looked at to go on with it."""

STANDING = "a person stands still"
"""What is asked for where a motion is to start or to end in standing."""

STAND = 0.8
"""Seconds of that standing."""


@dataclass(frozen=True)
class Passage:
    """A sentence of a story, and the seconds from and to which it is told."""

    text: str
    start: float
    stop: float


@dataclass(frozen=True, eq=False, repr=False)
class Story(Generated):
    """One motion for several sentences, and which of them is shown when."""

    passages: tuple[Passage, ...] = ()


class CodesModel(GenerateModel):
    """A model that writes motions as codes.

    graphs: "encoder" (words, lengths -> context: log-probabilities of actions), "step" (codes, action, age, states ->
        known, numbers, next states), "part" (known, codes -> log_probabilities), "decoder" (codes -> frames, moves),
        "tokens" (frames -> codes of the body). tables: "memory", "moves" and "body", see docs/bundle.md.
    """

    SETTINGS = (FamiliaritySettings,)
    LOOPS = ("codes",)
    ROLES = ("encoder", "part", "decoder", "tokens", "step")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        codec = Fields(manifest.config, "config").fields("codec")
        self.moves, self.sizes["T"] = codec.whole("moves", 1, 1 << 15), codec.whole("hop", 1, 100)
        ahead = codec.items("ahead")
        if len(ahead) > 100 or any(one not in (0, 1) for one in ahead):
            raise codec.fault("0 or 1 for each of at most 100 layers", ahead, "ahead")
        back = sum(2 - one for one in ahead) + math.ceil(FINE / self.sizes["T"])
        self.sight = Sight(back, sum(ahead), self.sizes["T"])
        self._bind()
        self.source = Source(graphs["step"], graphs["part"], self.moves, self.sizes["A"], self._memory())
        familiarity = self.settings(FamiliaritySettings)
        self.known = Known.read(Fields(manifest.source), self.sizes["A"], self.vocabulary.rules, familiarity)

    def _bind(self) -> None:
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch A"})
        self.bind("step", self.loop.inputs, self.loop.outputs)
        self.bind("part", {"known": "batch H", "codes": "*batch P"}, {"log_probabilities": "batch P K"})
        self.bind("decoder", {"codes": "*batch steps P"}, {"frames": "batch steps T D", "moves": "batch steps 3"})
        self.sizes["B"] = self.sizes["P"] - 1
        self.bind("tokens", {"frames": "batch steps T D"}, {"codes": "*batch steps B"})
        if self.moves >= self.sizes["K"]:
            most = self.sizes["K"] - 1
            raise BundleError(f"manifest, config.codec.moves: must be at most {most}, as the graph part has it")

    def _memory(self) -> Memory:
        self.sizes |= {"S": self.sizes["P"] + 2, "M": self.moves}
        steps, moves = self.table("memory", "R S", "int16"), self.table("moves", "M 3", "float32")
        body = self.table("body", "Q N", "float32")
        if 3 + self.sizes["B"] * self.sizes["N"] != self.sizes["L"]:
            raise BundleError("manifest, tables.body: its numbers are not those of the graph step")
        return Memory.of(steps, moves, body, self.sizes["A"])

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """See :meth:`motet.models.language.LanguageModel.contexts`; one by one: padding changes how sums round."""
        alone = [super(CodesModel, self).contexts([sequence], role) for sequence in sequences]
        return np.concatenate([np.empty((0, self.sizes["A"]), dtype=np.float32), *alone])

    def understood(self, sentence: str) -> Understood:
        """How well a sentence is known, and the known sentences nearest to it; errors as :meth:`ids`."""
        return self.known.understood(sentence, self.embed(sentence))

    def note(self, sentence: str, context: Floats, strict: bool) -> None:
        """See :meth:`GenerateModel.note`."""
        found = self.known.understood(sentence, context)
        if found.confident:
            return
        near = ", ".join(f"'{one}'" for one in found.nearest)
        said = f"{sentence!r} is outside of what the model knows (confidence {found.confidence:.2f}); nearest: {near}"
        if strict:
            raise TextError(said)
        warn(said, TextWarning)

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        count = settings["hypotheses"]
        rows = np.repeat(np.arange(len(contexts)), count)
        each = [one for own in noise for one in apart(own, count)]
        actions = drawn_actions(self.source, contexts[rows], each, settings["certainty"])
        longest = self.steps(settings["seconds"] or settings["max_seconds"])
        found = draw_codes(self._writer(each, settings), actions, longest, exactly=settings["seconds"] > 0)
        last = round(settings["seconds"] * self.fps) or None
        samples = [Sample(self.frames_of(codes)[:last], None) for codes in found]
        return [samples[start : start + count] for start in range(0, len(samples), count)]

    def story(
        self,
        sentences: Sequence[str],
        *,
        after: Motion | None = None,
        seconds: float | Sequence[float] | None = None,
        stand: str | None = None,
        seed: int = 0,
        strict: bool = False,
        **settings: float | None,
    ) -> Story:
        """One continuous motion that shows one sentence after the other, each taking over where the last one ends.

        after: a motion that is gone on with, of any human figure; its last seconds are looked at. seconds: how long
        each sentence is shown, or all alike; by default until it ends by itself. stand: "start", "end" or "both": where
        the figure is to stand for a moment. Others as :meth:`generate`; a story of one sentence is the motion that
        :meth:`generate` gives for it.
        """
        if stand not in (None, "start", "end", "both"):
            raise DecodingError(f"a figure stands at the start, the end or both, not at {stand!r}")
        figure = None if after is None else self._figure(after)
        chosen = _each(self.defaults["seconds"] if seconds is None else seconds, len(sentences))
        before, behind = ([STANDING] if stand in (end, "both") else [] for end in ("start", "end"))
        sentences = [*before, *sentences, *behind]
        seconds = [STAND] * len(before) + chosen + [STAND] * len(behind)
        pieces = list(self._told(sentences, figure, seconds, seed, strict, settings))
        frames = np.concatenate([found for _, found in pieces])
        if all(one > 0 for one in seconds):
            frames = frames[: round(sum(seconds) * self.fps)]
        passages = self._passages([text for text, _ in pieces[:-1]], len(frames) / self.fps)
        return Story(
            self.contract,
            frames,
            None,
            tuple(word for text in sentences for word in self.unknown(text)),
            figure,
            passages,
        )

    def _passages(self, texts: Sequence[str], end: float) -> tuple[Passage, ...]:
        """The passages of a story from the sentence of each step of codes, and the second at which it ends."""
        found, step = list[Passage](), self.sight.hop / self.fps
        for number, text in enumerate(texts):
            start = found.pop().start if found and found[-1].text is text else number * step
            found.append(Passage(text, start, min((number + 1) * step, end)))
        return tuple(found)

    def stream(
        self,
        sentences: str | Sequence[str],
        *,
        after: Motion | None = None,
        seconds: float | Sequence[float] | None = None,
        seed: int = 0,
        strict: bool = False,
        **settings: float | None,
    ) -> Iterator[Motion]:
        """The motion of :meth:`story` in pieces, as they are drawn: each can be played where the last one ends.

        Feet are as drawn: what holds them still has to know how long they stand. Errors and warnings come with the
        first piece.
        """
        texts = [sentences] if isinstance(sentences, str) else list(sentences)
        last, pose = None if after is None else self._figure(after), None
        for _, frames in self._told(texts, last, seconds, seed, strict, settings):
            if len(frames):
                last, pose = in_world(self.contract.features(frames), last, pose)
                yield last

    def _told(
        self,
        sentences: Sequence[str],
        figure: Motion | None,
        seconds: float | Sequence[float] | None,
        seed: int,
        strict: bool,
        settings: Mapping[str, float | None],
    ) -> Iterator[tuple[str, Array]]:
        """For each step of codes its sentence, and frames (T, D) that are settled with it; then the frames left.

        figure: a motion on the model's figure that is gone on with.
        """
        if not sentences:
            raise TextError("a story needs a sentence")
        chosen = self.loop.settled(self.defaults, settings)
        lengths = _each(seconds if seconds is not None else chosen["seconds"], len(sentences))
        contexts = self.contexts([self.ids(text) for text in sentences])
        for text, context in zip(sentences, contexts, strict=True):
            self.note(text, context, strict)
        noise = [np.random.Generator(np.random.PCG64(seed))]
        writer, unrolled = self._writer(noise, chosen), self._joined(figure)
        if figure is not None:
            writer.see(np.array(unrolled.codes))
        for text, context, length in zip(sentences, contexts, lengths, strict=True):
            (action,) = drawn_actions(self.source, context[None], noise, chosen["certainty"])
            longest = self.steps(length or chosen["max_seconds"])
            for step in drawn_steps(writer, int(action), longest, exactly=length > 0):
                yield text, unrolled.push(step)
        yield sentences[-1], unrolled.finish()

    def _writer(self, noise: Sequence[Noise], settings: Mapping[str, Any]) -> Writer:
        """A writer of codes for rows with the given noise."""
        names = ("temperature", "first_temperature", "top_p", "guidance", "memory")
        return Writer(self.source, noise, Drawing(*(settings[name] for name in names)))

    def steps(self, seconds: float) -> int:
        """How many steps of codes last so long, at least one."""
        return max(1, math.ceil(seconds * self.fps / self.sight.hop - 1e-9))

    def frames_of(self, codes: Ids) -> Array:
        """Frames (T, D) in the contract's units of steps of codes (N, P), from the origin."""
        return Unrolled(self.graphs["decoder"], self.sight, self.fps, codes[:0]).all(codes)

    def _joined(self, figure: Motion | None) -> Unrolled:
        """What makes frames of codes, at the start or after a motion on the model's figure."""
        if figure is None:
            return Unrolled(self.graphs["decoder"], self.sight, self.fps)
        frames = self.last_frames(figure)
        return Unrolled(self.graphs["decoder"], self.sight, self.fps, self.codes_of(frames), frames[-1])

    def last_frames(self, figure: Motion) -> Array:
        """The last seconds (T, D), whole steps of codes, of a motion on the model's figure, in the contract's units.

        MotionError where it is too short to go on with.
        """
        frames = self.contract.frames(figure)[-self.steps(CONTEXT) * self.sight.hop :]
        if len(frames) < 2 * self.sight.hop:
            raise MotionError(
                f"a motion of {len(frames)} frames is too short to go on with: {2 * self.sight.hop} are needed"
            )
        return frames[len(frames) % self.sight.hop :]

    def _figure(self, motion: Motion) -> Motion:
        """A motion on the model's figure at the model's frame rate, its last frame kept."""
        same = motion if motion.fps == self.fps else motion.continuous().resample(self.fps, to_end=True)
        return self.contract.on_figure(same)

    def codes_of(self, frames: Array) -> Ids:
        """Steps of codes (N, P) int64 of frames (T, D) in the contract's units; T is a multiple of a step's frames."""
        steps = frames.reshape(-1, self.sight.hop, frames.shape[1]).astype(np.float32)
        body = self.graphs["tokens"]({"frames": np.stack([steps, steps])})["codes"][0]
        facing, x, z = way(np.concatenate([frames[:, :3], frames[-1:, :3]]) / self.fps)
        moves, _ = nearest_moves(np.stack([x, z, facing], axis=-1)[:: self.sight.hop], self.book())
        return np.concatenate([moves[:, None], body], axis=1)

    def book(self) -> Array:
        """The moves (K, 3) that codes stand for."""
        codes = np.zeros((2, self.moves, self.sizes["P"]), dtype=np.int64)
        codes[..., 0] = np.arange(self.moves)
        moves: Array = self.graphs["decoder"]({"codes": codes})["moves"][0].astype(np.float64)
        return moves


def _each(seconds: float | Sequence[float], count: int) -> list[float]:
    """The seconds of each of so many sentences; DecodingError where there are more or fewer."""
    found = list(seconds) if isinstance(seconds, Sequence) else [seconds] * count
    if len(found) != count or any(not 0 <= one <= 600 for one in found):
        raise DecodingError(f"seconds are one number of 0 to 600, or one for each of {count} sentences, not {seconds}")
    return found
