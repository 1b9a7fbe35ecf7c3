"""Generate motions code by code, of natural or given length, continue them, and show several sentences as a story."""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, Self, Unpack, cast, get_args

import numpy as np

from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.decode.loop import Noise, Sample, apart
from motet.errors import (
    BundleError,
    DecodingError,
    MotionError,
    TextError,
    TextWarning,
    warn,
)
from motet.generate.base import (
    FamiliaritySettings,
    Generated,
    LoopSettings,
    LoopValues,
    Story,
)
from motet.generate.codec import Codec, Context, ReceptiveField, StreamingDecoder
from motet.generate.codes import LOOPS, CodesSettings, Source, Writer, draw_codes, drawn_actions
from motet.generate.continue_codes import ContinuationSettings
from motet.generate.keyed_acts import (
    RESTS,
    STANDS,
    STAYS,
)
from motet.generate.memory import Memory, MemorySettings
from motet.generate.motion_measures import Seen, short
from motet.generate.reading import NEVER, SentenceModel
from motet.generate.story_decoder import KEPT, Piece, Request, Teller, pace_of
from motet.models.language import texts_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_sixd import in_world
from motet.settings import Seed
from motet.text.clauses import (
    Passage,
    Shown,
)
from motet.text.numeric_phrases import Quantities

STANDING_SECONDS = 0.8
"""Duration of standing there."""

DECODED_AT_ONCE = 64
"""Steps of a story that are decoded at once."""

Stand = Literal["start", "end", "both"]
"""Where a figure stands briefly."""


class ReadSettings(LoopSettings, total=False):
    """Settings of a loop and of the reading of sentences: :meth:`GenerateModel.generate`."""

    numbers: bool
    whole: bool


class StorySettings(ReadSettings, total=False):
    """Settings of a call of :meth:`CodesModel.story`; seconds may be a list, of one value for each sentence."""

    after: Motion | None
    seconds: float | Sequence[float | None] | None
    stand: Stand | None
    seed: Seed
    strict: bool


class CodesModel(SentenceModel):
    """A model that generates motion codes; docs/reference/bundle.md has its graphs and tables. A context is the
    log-probabilities of actions."""

    SETTINGS = (FamiliaritySettings, ContinuationSettings, MemorySettings)
    LOOPS = LOOPS
    ROLES = ("encoder", "part", "decoder", "tokens", "step")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        self.continuation = self.settings(ContinuationSettings)
        self.codec = self._read_codec()
        self.sizes |= {"T": self.codec.field.hop, "M": self.codec.moves}
        self._bind()
        self._read_sentences()
        written = self._commands.written
        self.source = Source(graphs["step"], graphs["part"], self.codec.moves, self.sizes["A"], self._remember, written)

    def _read_codec(self) -> Codec:
        """The codec that the manifest describes, and its two graphs."""
        codec = Fields(self.manifest.config, "config").fields("codec")
        moves = codec.whole("moves", 1, 1 << 15)
        hop = codec.whole("hop", 2, 100)
        ahead = codec.items("ahead")
        if len(ahead) > 100 or any(layer not in (0, 1) for layer in ahead):
            raise codec.fault("0 or 1 for each of at most 100 layers", ahead, "ahead")
        # Each layer sees two steps besides its own; those at the frame rate look back 4 frames.
        back = sum(2 - layer for layer in ahead) + math.ceil(4 / hop)
        field = ReceptiveField(back, sum(ahead), hop)
        half_life = self.continuation.half_life
        return Codec(self.graphs["decoder"], self.graphs["tokens"], field, moves, self.fps, half_life)

    def _remember(self) -> Memory:
        """The memory of the tables; BundleError where they were altered, or hold what cannot be."""
        with self.named():
            tables = self.tables
            settings = self.settings(MemorySettings)
            actions = len(self.source.written) if self._commands.acts else self.sizes["A"]
            memory = Memory.of(tables["memory"], tables["moves"], tables["body"], actions, settings)
        for number, command in enumerate(self._commands.acts, start=self._commands.first):
            memory.lend(number, command.action)
        return memory

    def ready(self) -> Self:
        """See :meth:`motet.models.base.BundleModel.ready`."""
        _ = self.source.memory
        return super().ready()

    def _bind(self) -> None:
        """Check that graphs and tables fit each other."""
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch A"})
        self.bind("step", self.loop.inputs, self.loop.outputs)
        self.bind("part", {"known": "batch H", "codes": "*batch P"}, {"log_probabilities": "batch P K"})
        self.bind("decoder", {"codes": "*batch steps P"}, {"frames": "batch steps T D", "moves": "batch steps 3"})
        self.sizes |= {"B": self.sizes["P"] - 1, "S": self.sizes["P"] + 2}
        self.bind("tokens", {"frames": "batch steps T D"}, {"codes": "*batch steps B"})
        # tables and graphs agree on the number of codes
        if self.codec.moves >= self.sizes["K"]:
            most = self.sizes["K"] - 1
            raise BundleError(f"manifest, config.codec.moves: must be at most {most}, to fit the graph part")
        # the recordings in codes, their moves, and the body's code book
        self.bind_table("memory", "R S", "int16")
        self.bind_table("moves", "M 3", "float32")
        self.bind_table("body", "Q N", "float32")

    def _composed(self, sentence: str, numbers: bool, whole: bool, settings: LoopValues) -> bool:
        seconds = self._settled(settings)["seconds"]
        if numbers and self._keyed(sentence):
            return True
        if super()._composed(sentence, numbers, whole, settings):
            return True
        if not (numbers and seconds):
            return False
        return self._request(sentence, Quantities(sentence), self._context(sentence), seconds).pace != 1

    def _request(
        self, text: str, quantities: Quantities, context: Floats, seconds: float, paced: bool = True
    ) -> Request:
        """A request to show a text. seconds: 0 where the text says them, or it ends by itself. paced: whether it is
        played faster or slower to last as long."""
        request = Request(text, quantities, context, seconds or quantities.amounts.get("seconds", 0.0))
        if (act := self._keyed(text)) and quantities.text == act.base and not act.is_other_text:
            return replace(request, keyed=act)
        if "stand" not in text:  # who is to stand does not stay as he sits
            request = replace(request, rests=RESTS.get(self._sentences[int(context.argmax())], 0.0))
        return replace(request, pace=pace_of(request, self.source, self.codec)) if paced else request

    def composed(self, sentence: str, seed: int, strict: bool, settings: Mapping[str, Any]) -> list[Generated]:
        """See :meth:`GenerateModel.composed`; the first motion is the :meth:`story` of this seed."""
        count = int(self._settled({"hypotheses": settings["hypotheses"]})["hypotheses"])
        options: dict[str, Any] = {name: value for name, value in settings.items() if name != "hypotheses"}
        motions: list[Generated] = []
        for story_seed in [seed, *np.random.SeedSequence(seed).generate_state(count - 1).tolist()]:
            story_settings = cast(StorySettings, {**options, "seed": story_seed, "strict": strict})
            motions.append(self.story(sentence, **story_settings))
        return motions

    def results(self, sentence: str, samples: Sequence[Sample]) -> list[Generated]:
        """See :meth:`GenerateModel.results`."""
        shown: dict[int | None, Shown] = {}
        motions = []
        for motion, sample in zip(super().results(sentence, samples), samples, strict=True):
            if sample.action not in shown:
                shown[sample.action] = self._warned(sentence, self._shown_as(sentence, sample.action))
            motions.append(replace(motion, **shown[sample.action]._asdict()))
        return motions

    def _shown(self, request: Request, action: int) -> Shown:
        """How a request is shown; a TextWarning names the words that are left out."""
        if action == KEPT:
            return Shown(STAYS, (), 1.0)
        if request.keyed is not None:
            return self._warned(request.text, request.keyed.shown)
        sentence = request.quantities.text
        return self._warned(sentence, self._shown_as(sentence, action))

    def _warned(self, sentence: str, shown: Shown) -> Shown:
        if shown.lacking:
            warn(shown.left_out(sentence), TextWarning)
        return shown

    def drawing_inputs(
        self, texts: Sequence[str], rows: int, seed: Seed, strict: bool, settings: LoopValues
    ) -> tuple[Floats, list[np.random.Generator], dict[str, float]]:
        """See :meth:`GenerateModel.drawing_inputs`; strict: only actions are drawn that leave out no word."""
        contexts, noise, chosen = super().drawing_inputs(texts, rows, seed, strict, settings)
        if strict:
            for text, context in zip(texts, contexts, strict=True):
                self.check_whole(text, numbers=False)
                words = list(self._content(text).values())
                for action in range(len(self._words)):
                    stems = self._stems(action)
                    if any(stems.isdisjoint(forms) for forms in words):
                        context[action] = NEVER
        return contexts, noise, chosen

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        # A row for each hypothesis of each context, and its action.
        count = settings["hypotheses"]
        noise_of_rows = apart(noise, count)
        actions = drawn_actions(self.source, np.repeat(contexts, count, axis=0), noise_of_rows, settings["certainty"])
        # Codes, up to the end of a motion or as many as the seconds take.
        seconds = settings["seconds"]
        steps = self.codec.steps(seconds or settings["max_seconds"])
        writer = Writer(self.source, noise_of_rows, CodesSettings(**settings))
        motions = draw_codes(writer, actions, max(1, steps), exactly=seconds > 0)
        # Frames, those beyond the seconds cut off.
        last = max(1, round(seconds * self.fps)) if seconds else None
        samples = []
        for codes, action in zip(motions, actions.tolist(), strict=True):
            samples.append(Sample(self.codec.frames_of(codes)[:last], None, action))
        return [samples[start : start + count] for start in range(0, len(samples), count)]

    def story(self, sentences: str | Sequence[str], **settings: Unpack[StorySettings]) -> Story:
        """One continuous motion for several sentences, each starting where the last one ends.

        after: a motion to continue, of any human figure, from its last seconds. seconds: of each sentence, or one value
        for all, to within one code; by default each ends by itself. whole: show a sentence that requests several things
        in a row as one; else its parts, each of the same length, are passages. stand: where to stand briefly.
        Others like :meth:`generate`; a story of one sentence is the motion that it returns.
        DecodingError for seconds, a seed or a setting out of range, and for several ``hypotheses``; MotionError for a
        motion that is too short to continue or not of a human figure; TextError like :meth:`generate`.
        """
        # draw and decode all, then tell what each sentence became
        requests, after, drawn = self._telling(sentences, together=DECODED_AT_ONCE, **settings)
        pieces = list(drawn)
        frames = np.concatenate([piece.frames for piece in pieces])
        passages = self._passages(requests, pieces, frames)
        unknown: list[str] = []
        lacking: list[str] = []
        for request, passage in zip(requests, passages, strict=True):
            unknown += self.unknown(request.quantities.text)
            lacking += passage.lacking
        # a story of one sentence has its figures itself
        only = passages[0] if len(passages) == 1 else Passage("", 0, 0)
        return Story(
            contract=self.contract,
            frames=frames,
            log_likelihood=None,
            unknown=tuple(unknown),
            after=after,
            action=only.action,
            lacking=tuple(lacking),
            confidence=min(passage.confidence or 0.0 for passage in passages),
            requested=only.requested,
            measured=only.measured,
            passages=tuple(passages),
        )

    def _passages(self, requests: Sequence[Request], pieces: Sequence[Piece], frames: Array) -> list[Passage]:
        """The passages of a story's frames (T, D), one for each request."""
        actions: dict[int, int] = {}
        lengths = [0] * len(requests)
        for piece in pieces:
            actions[piece.number] = piece.action
            lengths[piece.number] += piece.longer
        passages = []
        start = 0
        for number, (request, length) in enumerate(zip(requests, lengths, strict=True)):
            stop = start + length
            shown = self._shown(request, actions[number])
            measured = self._measured(request, frames[start:stop])
            wanted = dict(cast(Mapping[str, float], request.quantities.amounts))
            passages.append(Passage(request.text, start / self.fps, stop / self.fps, *shown, wanted, measured))
            start = stop
        return passages

    def _measured(self, request: Request, frames: Array) -> dict[str, float]:
        """How much the frames (T, D) that show a request have of its numbers; a TextWarning where they are not kept."""
        wanted = request.quantities.amounts
        measured: dict[str, float] = {}
        if wanted and len(frames):
            seen = Seen.of(self.contract, frames)
            for kind in wanted:
                amount = seen.measured(kind, request.quantities.act)
                if not np.isnan(amount):
                    measured[kind] = amount
        for kind in wanted:
            if kind not in measured and kind != "pace":
                counted = f"{request.text!r} requests {wanted[kind]:g} {kind}"
                warn(f"{counted}, which cannot be counted in this motion", TextWarning)
        for kind in short(cast(Mapping[str, float], wanted), measured, request.quantities.either):
            warn(f"{request.text!r} requests {wanted[kind]:g} {kind}; shown: {measured[kind]:.3g}", TextWarning)
        return measured

    def stream(self, sentences: str | Sequence[str], **settings: Unpack[StorySettings]) -> Iterator[Motion]:
        """The motion of :meth:`story` in pieces, as they are drawn: each continues the last one.

        Feet are as drawn, since planting them requires knowing how long they stand. Memory and the time of a piece stay
        constant, however long the stream lasts. With ``seconds``, a part that turns by a number or is played faster or
        slower comes in pieces of up to 20 s; a part that ends when a number is reached comes as one. Errors like
        :meth:`story`.
        """
        # Errors are raised here, before the first piece.
        requests, after, drawn = self._telling(sentences, **settings)

        def pieces() -> Iterator[Motion]:
            last = after
            pose = None
            begun = 0
            for piece in drawn:
                if piece.number == begun:
                    self._shown(requests[begun], piece.action)
                    begun += 1
                if len(piece.frames):
                    last, pose = in_world(self.contract.features(piece.frames), last, pose)
                    yield last

        return pieces()

    def _telling(
        self,
        sentences: str | Sequence[str],
        *,
        after: Motion | None = None,
        seconds: float | Sequence[float | None] | None = None,
        stand: Stand | None = None,
        seed: Seed = 0,
        strict: bool = False,
        together: int = 1,
        **settings: Unpack[ReadSettings],
    ) -> tuple[list[Request], Motion | None, Iterator[Piece]]:
        """A story about to be drawn: its requests with those of standing, the motion on the model's figure that it
        continues, and its pieces as they are drawn. together: steps that are decoded at once."""
        sentences = texts_of(sentences)
        numbers = settings.pop("numbers", True)
        whole = settings.pop("whole", False)
        loop_settings = cast(LoopValues, settings)
        _check_story(sentences, stand, loop_settings.get("hypotheses"))

        # Texts in the order in which they are shown, and what each is read as.
        timed = self._timed_texts(sentences, seconds, whole)
        if stand in ("start", "both"):
            timed.insert(0, (STANDS, STANDING_SECONDS))
        if stand in ("end", "both"):
            timed.append((STANDS, STANDING_SECONDS))
        requests, noise, chosen = self._requests(timed, numbers, seed, strict, loop_settings)

        # They are drawn after the end of the motion before.
        teller = Teller(self.source, self.codec, self.contract, noise, chosen, self.continuation.context, together)
        if after is None:
            return requests, None, teller.pieces(requests, None)
        figure = self.contract.on_figure(self.at_own_rate(after))
        return requests, figure, teller.pieces(requests, self.context(figure))

    def _requests(
        self, timed: Sequence[tuple[str, float]], numbers: bool, seed: Seed, strict: bool, settings: LoopValues
    ) -> tuple[list[Request], list[np.random.Generator], dict[str, float]]:
        """A request for each text with its seconds; noise, and all settings of the loop.

        numbers: whether to read those of the text.
        """
        if strict:
            for text, _ in timed:
                self.check_whole(text, numbers)
        quantities = [self.quantities(text) if numbers else Quantities(text) for text, _ in timed]
        read_as = [quantity.text for quantity in quantities]
        contexts, noise, chosen = self.drawing_inputs(read_as, 1, seed, strict, settings)
        requests = []
        for (text, seconds), quantity, context in zip(timed, quantities, contexts, strict=True):
            requests.append(self._request(text, quantity, context, seconds, paced=numbers))
        return requests, noise, chosen

    def _timed_texts(
        self, sentences: Sequence[str], seconds: float | Sequence[float | None] | None, whole: bool
    ) -> list[tuple[str, float]]:
        """The parts of sentences, each with its seconds, 0 where it ends by itself; errors like :meth:`story`."""
        count = len(sentences)
        each: list[Any] = list(cast(Any, seconds)) if np.ndim(cast(Any, seconds)) else [seconds] * count
        if len(each) != count:
            raise DecodingError(f"seconds must be a number, or one for each of {count} sentences, not {seconds}")
        lengths = [self._settled({"seconds": length})["seconds"] for length in each]
        timed = []
        for sentence, length in zip(sentences, lengths, strict=True):
            parts = [sentence] if whole else self.parts(sentence)
            for part in parts[1:]:
                if re.match(r"\w+ing\b", part) and f", {part}" in sentence:
                    warn(f"{part!r} is shown after the rest, not at the same time (in {sentence!r})", TextWarning)
            timed += [(part, length / len(parts)) for part in parts]
        return timed

    def decoder(self, context: Context | None = None) -> StreamingDecoder:
        """A decoder of codes to frames, from the origin or after the end of a motion."""
        return StreamingDecoder(self.codec, context)

    def context(self, figure: Motion) -> Context:
        """The last seconds, whole steps of codes, of a motion on the model's figure; MotionError where it is too short
        to continue."""
        hop = self.codec.field.hop
        frames = self.contract.frames(figure)[-self.codec.steps(self.continuation.context) * hop :]
        if len(frames) < 2 * hop:
            raise MotionError(f"a motion of {len(frames)} frames is too short to continue: {2 * hop} are needed")
        frames = frames[len(frames) % hop :]
        return Context(frames, self.codec.codes_of(frames))


def _check_story(sentences: Sequence[str], stand: object, hypotheses: float | None) -> None:
    """TextError for a story without sentences; DecodingError for a place to stand or a number of motions that it cannot
    have."""
    if not sentences:
        raise TextError("a story needs a sentence")
    places = get_args(Stand)
    if stand not in (None, *places):
        raise DecodingError(f"stand is one of {', '.join(places)}, not {stand!r}")
    if hypotheses not in (None, 1):
        raise DecodingError(f"a story is one motion: hypotheses must be 1, not {hypotheses}")
