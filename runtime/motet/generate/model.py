"""Generate motions code by code, of natural or given length, continue them, and show several sentences as a story."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from typing import Annotated, Any, ClassVar, Literal, Unpack, cast, get_args

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.bundle.graph import Arrays, Floats, Graph
from motet.bundle.manifest import Manifest
from motet.compose.compose import Composition, compose
from motet.compose.plans import Moment, parse_plan
from motet.decode.loop import Noise, Sample, apart
from motet.errors import (
    BundleError,
    DecodingError,
    MotionError,
    TextError,
    TextWarning,
    needs,
    warn,
)
from motet.figures.humanoid import HUMANOID
from motet.generate.base import Generated, GenerateModel, LoopSettings
from motet.generate.codec import Codec, Context, ReceptiveField, StreamingDecoder
from motet.generate.codes import LOOPS, CodesSettings, Source, Writer, draw_codes, drawn_actions
from motet.generate.continue_codes import ContinuationSettings
from motet.generate.memory import Memory, MemorySettings
from motet.generate.motion_measures import Seen, short
from motet.generate.story_decoder import Part, Piece, Teller, pace_of
from motet.models.language import texts_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_sixd import in_world
from motet.settings import Range, Seed, Settings
from motet.steering.model import SteerModel
from motet.text.clauses import FUNCTION_WORDS, OWN, Passage, Shown, at_odds, parts_of, sentences_of, stem, verbs_of
from motet.text.numeric_phrases import PACES, Quantities, known_turns, quantities_of

DONE = re.compile(r"(?:ing|ed|[^s]s)$")
"""The ending of a word for what is done."""

STANDING, STANDING_SECONDS = "a person stands still", 0.8
"""The sentence of a figure that is to stand at the start or end of a story, and for how long it stands."""

NEVER = -1e9
"""Log-probability of an action that is not drawn."""

Stand = Literal["start", "end", "both"]
"""Where a figure stands briefly."""


class ReadSettings(LoopSettings, total=False):
    """Settings of a loop, and of how sentences are read: :meth:`GenerateModel.generate`."""

    numbers: bool
    whole: bool


class StorySettings(ReadSettings, total=False):
    """Settings of a call of :meth:`CodesModel.story`; seconds may be a list, of one value for each sentence."""

    after: Motion | None
    seconds: float | Sequence[float | None] | None
    stand: Stand | None
    seed: Seed
    strict: bool


@dataclass(frozen=True, eq=False, repr=False)
class Story(Generated):
    """One motion for several sentences, and when each is shown."""

    passages: tuple[Passage, ...] = ()


@dataclass(frozen=True)
class FamiliaritySettings(Settings):
    """confident: least confidence of a known sentence (docs/generate.md).

    doubt: exponent of the probability of the likeliest action, which is often low because sentences share actions.
    """

    FEATURE: ClassVar[str] = "familiarity"
    confident: Annotated[float, Range(0, 1)] = 0.5
    doubt: Annotated[float, Range(0, 10)] = 0.25


@dataclass(frozen=True)
class Understood:
    """confidence: from 0 to 1: the share of known words in a sentence, rare words counting more, times the certainty
    about the action meant.

    nearest: sentences of the likeliest actions, the likeliest first. confident: whether the model knows the sentence.
    """

    confidence: float
    nearest: tuple[str, ...]
    confident: bool


class CodesModel(GenerateModel):
    """A model that generates motion codes; docs/reference/bundle.md has its graphs and tables. A context is the
    log-probabilities of actions."""

    SETTINGS = (FamiliaritySettings, ContinuationSettings, MemorySettings)
    LOOPS = LOOPS
    ROLES = ("encoder", "part", "decoder", "tokens", "step")

    def __init__(self, manifest: Manifest, graphs: Mapping[str, Graph], tables: Arrays | None = None) -> None:
        super().__init__(manifest, graphs, tables)
        codec = Fields(manifest.config, "config").fields("codec")
        moves, hop, ahead = codec.whole("moves", 1, 1 << 15), codec.whole("hop", 2, 100), codec.items("ahead")
        if len(ahead) > 100 or any(one not in (0, 1) for one in ahead):
            raise codec.fault("0 or 1 for each of at most 100 layers", ahead, "ahead")
        back = sum(2 - one for one in ahead) + math.ceil(4 / hop)  # the layers at the frame rate look back 4 frames
        self.continuation, field = self.settings(ContinuationSettings), ReceptiveField(back, sum(ahead), hop)
        self.codec = Codec(graphs["decoder"], graphs["tokens"], field, moves, self.fps, self.continuation.half_life)
        self.sizes |= {"T": hop, "M": moves}
        memory = self._bound()
        self.source = Source(graphs["step"], graphs["part"], moves, self.sizes["A"], memory)
        self._familiar = self.settings(FamiliaritySettings)
        self._read_actions(Fields(manifest.source).list_of_fields("actions"))

    def _bound(self) -> Memory:
        """The memory, once graphs and tables are found to fit each other."""
        self.bind("encoder", {"words": "*batch words", "lengths": "*batch"}, {"context": "batch A"})
        self.bind("step", self.loop.inputs, self.loop.outputs)
        self.bind("part", {"known": "batch H", "codes": "*batch P"}, {"log_probabilities": "batch P K"})
        self.bind("decoder", {"codes": "*batch steps P"}, {"frames": "batch steps T D", "moves": "batch steps 3"})
        self.sizes |= {"B": self.sizes["P"] - 1, "S": self.sizes["P"] + 2}
        self.bind("tokens", {"frames": "batch steps T D"}, {"codes": "*batch steps B"})
        if self.codec.moves >= self.sizes["K"]:
            most = self.sizes["K"] - 1
            raise BundleError(f"manifest, config.codec.moves: must be at most {most}, to fit the graph part")
        steps, moves = self.table("memory", "R S", "int16"), self.table("moves", "M 3", "float32")
        body = self.table("body", "Q N", "float32")
        if 3 + self.sizes["B"] * self.sizes["N"] != self.sizes["L"]:
            raise BundleError("manifest, tables.body: does not fit the graph step")
        return Memory.of(steps, moves, body, self.sizes["A"], self.settings(MemorySettings))

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """See :meth:`motet.models.language.LanguageModel.contexts`; one by one: padding changes how sums round."""
        alone = [super(CodesModel, self).contexts([sequence], role) for sequence in sequences]
        return np.concatenate([np.empty((0, self.sizes["A"]), dtype=np.float32), *alone])

    def _read_actions(self, entries: Sequence[Fields]) -> None:
        """The known actions: a sentence of each, and the weights of words, more of one that describes few actions."""
        if len(entries) != self.sizes["A"]:
            raise BundleError(f"manifest, actions: {len(entries)} entries, expected {self.sizes['A']}")
        said = Counter(word for entry in entries for word in set(entry.texts("words")))
        self._sentences = [entry.text("sentence") for entry in entries]
        self._rare = {word: math.log((1 + len(entries)) / times) for word, times in said.items()}
        self._stems = [frozenset(map(stem, entry.texts("words"))) for entry in entries]
        self._done = [frozenset(stem(word) for word in entry.texts("words") if DONE.search(word)) for entry in entries]
        self._verbs = verbs_of(said)

    def parts(self, sentence: str) -> list[str]:
        """What a text asks for one after another: its sentences, and those parts of a sentence
        (:func:`motet.text.clauses.parts_of`) of which the likeliest action lacks something; errors like
        :meth:`ids`."""
        self.vocabulary.encode(sentence)
        found = []
        for one in sentences_of(sentence):
            parts = parts_of(one, self._verbs)
            told = self.quantities(one)
            apart = len(parts) > 1 and (self.lacking(told.text) or any(self._more(part, told) for part in parts))
            found += parts if apart else [one]
        return found if len(found) > 1 else [sentence]

    def _more(self, part: str, told: Quantities) -> bool:
        """Whether a part of a sentence asks for another number than the sentence does: it has several of a kind, or is
        to have them one after another."""
        return bool(quantities_of(part).amounts) and dict(quantities_of(part).amounts) != dict(told.amounts)

    def quantities(self, sentence: str) -> Quantities:
        """What a sentence asks for in numbers, and what it is taken for: itself where the likeliest action has all its
        words, else what it says without the numbers, or with another angle; no pace that this action has. TextError
        like :func:`motet.text.numeric_phrases.quantities_of`."""
        found = quantities_of(sentence) if self.contract.skeleton == HUMANOID else Quantities(sentence)
        if found.amounts and found.text != sentence:
            texts = [sentence] if found.amounts.keys() & {"degrees", "times"} else []
            known = (text for text in (*texts, *known_turns(found)) if not (self.unknown(text) or self.lacking(text)))
            found = replace(found, text=next(known, found.text))
        if "pace" in found.amounts and not any(map(PACES.fullmatch, self.lacking(found.text))):
            found = replace(found, amounts={kind: value for kind, value in found.amounts.items() if kind != "pace"})
        return found

    def lacking(self, sentence: str, action: int | None = None) -> list[str]:
        """The known words of a sentence, but for function words, of which no sentence of an action has any form, nor
        of what a common word is near to; by default of the likeliest action."""
        ids, _ = self.vocabulary.encode(sentence)
        have = self._stems[int(self.contexts([ids])[0].argmax()) if action is None else action]
        return [word for word, forms in self._content(sentence).items() if have.isdisjoint(forms)]

    def _content(self, sentence: str) -> dict[str, frozenset[str]]:
        """The known words of a sentence in their order, but for function words, and the stems that show each."""
        words = set(map(self.vocabulary.meant, self.vocabulary.rules.words(sentence))) - FUNCTION_WORDS - {""}
        return {word: frozenset((stem(word), stem(self.vocabulary.near(word)))) for word in sorted(words)}

    def _composed(self, sentence: str, numbers: bool, whole: bool, settings: Mapping[str, float | None]) -> bool:
        seconds, told = self._settled(settings)["seconds"], super()._composed(sentence, numbers, whole, settings)
        if told or not (numbers and seconds):
            return told
        part = Part(sentence, Quantities(sentence), self.contexts([self.vocabulary.encode(sentence)[0]])[0], seconds)
        return pace_of(part, self.source, self.codec) != 1

    def composed(self, sentence: str, seed: int, strict: bool, settings: Mapping[str, Any]) -> list[Generated]:
        """See :meth:`GenerateModel.composed`; the first motion is the :meth:`story` of this seed."""
        own: dict[str, Any] = {name: value for name, value in settings.items() if name != "hypotheses"}
        count = int(self._settled({"hypotheses": settings["hypotheses"]})["hypotheses"])
        seeds = [seed, *np.random.SeedSequence(seed).generate_state(count - 1).tolist()]
        return [self.story(sentence, **cast(StorySettings, {**own, "seed": one, "strict": strict})) for one in seeds]

    def understood(self, sentence: str, numbers: bool = True) -> Understood:
        """How well a sentence is known, and the nearest known sentences; errors like :meth:`ids`.

        numbers: of what it is taken for without its numbers (:meth:`quantities`), as :meth:`generate` shows them.
        """
        text = self.quantities(sentence).text if numbers else sentence
        return self._understood(text, self.embed(text))

    def _understood(self, sentence: str, context: Floats) -> Understood:
        asked, unheard = set(self.vocabulary.rules.words(sentence)), math.log(1 + len(self._sentences))
        heard = sum(self._rare.get(word, 0.0) for word in asked)
        share = heard / (sum(self._rare.get(word, unheard) for word in asked) or 1.0)
        order, how = np.argsort(-context, kind="stable"), self._familiar
        nearest = dict.fromkeys(self._sentences[action] for action in order)
        likeliest = float(context[order[0]])
        if likeliest > 0.01:  # more than rounding
            raise BundleError(f"graph encoder: its context holds {likeliest:g}, which is no log-probability")
        confidence = share * math.exp(likeliest) ** how.doubt
        return Understood(confidence, tuple(nearest)[:3], confidence >= how.confident)

    def note(self, sentence: str, context: Floats, strict: bool) -> None:
        """See :meth:`GenerateModel.note`."""
        if odd := at_odds(sentence):
            warn(f"{sentence!r} asks for {odd[0]!r} and {odd[1]!r} at once, which cannot be: one is shown", TextWarning)
        likeliest = int(context.argmax())
        nouns = self._verbs & self._stems[likeliest] - self._done[likeliest]
        for verb in OWN.findall(self.vocabulary.rules.normalise(sentence)):
            if stem(verb) in nouns:
                shown = self._sentences[likeliest]
                warn(f"{shown!r} has no action {verb!r} (in {sentence!r})", TextWarning)
        found = self._understood(sentence, context)
        if found.confident:
            return
        near = ", ".join(f"'{one}'" for one in found.nearest)
        said = f"{sentence!r} is outside the training data (confidence {found.confidence:.2f}); nearest: {near}"
        if strict:
            raise TextError(said)
        warn(said, TextWarning)

    def results(self, sentence: str, samples: Sequence[Sample]) -> list[Generated]:
        """See :meth:`GenerateModel.results`."""
        told = {action: self._shown(sentence, action) for one in samples if (action := one.action) is not None}
        found = zip(super().results(sentence, samples), samples, strict=True)
        return [replace(one, **told[own]._asdict()) for one, (*_, own) in found if own is not None]

    def _shown(self, sentence: str, action: int) -> Shown:
        """What a sentence is shown as by an action; a TextWarning names the words that are left out."""
        shown = self._shown_as(sentence, action)
        if shown.lacking:
            warn(shown.left_out(sentence), TextWarning)
        return shown

    def likeliest(self, sentence: str) -> Shown:
        """What a sentence is shown as by its likeliest action; motions that are drawn may show another likely one.
        Errors like :meth:`ids`, without warnings."""
        return self._shown_as(self.quantities(sentence).text)

    def _shown_as(self, sentence: str, action: int | None = None) -> Shown:
        """What a sentence is shown as by an action, by default by the likeliest."""
        context = self.contexts([self.vocabulary.encode(sentence)[0]])[0]
        taken = int(context.argmax()) if action is None else action
        confidence = self._understood(sentence, context).confidence
        return Shown(self._sentences[taken], tuple(self.lacking(sentence, taken)), confidence)

    def check_whole(self, sentence: str) -> None:
        """See :meth:`GenerateModel.check_whole`."""
        shown = self._shown_as(sentence)
        if shown.lacking:
            raise TextError(shown.left_out(sentence))

    def asked(
        self, texts: Sequence[str], rows: int, seed: Seed, strict: bool, settings: Mapping[str, float | None]
    ) -> tuple[Floats, list[np.random.Generator], dict[str, float]]:
        """See :meth:`GenerateModel.asked`; strict: of each sentence only actions that leave out no word are drawn."""
        contexts, noise, chosen = super().asked(texts, rows, seed, strict, settings)
        if strict:
            for text, context in zip(texts, contexts, strict=True):
                self.check_whole(text)
                words = self._content(text).values()
                context[[any(have.isdisjoint(forms) for forms in words) for have in self._stems]] = NEVER
        return contexts, noise, chosen

    def decode(self, contexts: Floats, noise: Sequence[Noise], settings: Mapping[str, Any]) -> list[list[Sample]]:
        """See :meth:`GenerateModel.decode`."""
        count, seconds = settings["hypotheses"], settings["seconds"]
        each = [one for own in noise for one in apart(own, count)]
        actions = drawn_actions(self.source, np.repeat(contexts, count, axis=0), each, settings["certainty"])
        longest = max(1, self.codec.steps(seconds or settings["max_seconds"]))
        writer = Writer(self.source, each, CodesSettings(**settings))
        found = draw_codes(writer, actions, longest, exactly=seconds > 0)
        last = max(1, round(seconds * self.fps)) if seconds else None
        frames = [self.codec.frames_of(codes)[:last] for codes in found]
        samples = [Sample(one, None, action) for one, action in zip(frames, actions.tolist(), strict=True)]
        return [samples[start : start + count] for start in range(0, len(samples), count)]

    def story(self, sentences: str | Sequence[str], **settings: Unpack[StorySettings]) -> Story:
        """One continuous motion for several sentences, each starting where the last one ends.

        after: a motion to continue, of any human figure, from its last seconds. seconds: of each sentence, or one value
        for all, to within one code; by default each ends by itself. whole: take a sentence that asks for several things
        in a row as one; else its parts, each of the same length, are passages. stand: where it is to stand briefly.
        Others like :meth:`generate`; a story of one sentence is the motion that it returns.
        DecodingError for seconds, a seed or a setting out of range, and for several ``hypotheses``; MotionError for a
        motion that is too short to continue or not of a human figure; TextError like :meth:`generate`.
        """
        parts, after, drawn = self._told(sentences, **settings)
        pieces = list(drawn)
        frames = np.concatenate([piece.frames for piece in pieces])
        stops = [*accumulate(sum(one.longer for one in pieces if one.number == i) for i in range(len(parts)))]
        actions = {piece.number: piece.action for piece in pieces}
        passages = tuple(
            self._passage(part, actions[i], frames[start:stop], start / self.fps, stop / self.fps)
            for i, (part, start, stop) in enumerate(zip(parts, [0, *stops], stops, strict=False))
        )
        unknown = tuple(word for part in parts for word in self.unknown(part.asked.text))
        lacking = tuple(word for one in passages for word in one.lacking)
        confidence = min(one.confidence or 0.0 for one in passages)
        only = passages[0] if len(passages) == 1 else Passage("", 0, 0)
        told = (only.action, lacking, confidence, only.asked, only.measured)
        return Story(self.contract, frames, None, unknown, after, *told, passages=passages)

    def _passage(self, part: Part, action: int, frames: Array, start: float, stop: float) -> Passage:
        """What is said of the frames (T, D) that show a part; a TextWarning tells numbers that are not met."""
        shown = self._shown(part.asked.text, action)
        asked: dict[str, float] = {kind: value for kind, value in part.asked.amounts.items()}  # noqa: C416
        seen = Seen.of(self.contract, frames) if asked and len(frames) else None
        found = [(kind, seen.measured(kind, part.asked.act)) for kind in part.asked.amounts] if seen else []
        measured: dict[str, float] = {kind: value for kind, value in found if not np.isnan(value)}
        for kind in asked.keys() - measured.keys() - {"pace"}:
            warn(f"{part.text!r} asks for {asked[kind]:g} {kind}, which are not counted in what is shown", TextWarning)
        for kind in short(asked, measured, part.asked.either):
            warn(f"{part.text!r} asks for {asked[kind]:g} {kind}; shown: {measured[kind]:.3g}", TextWarning)
        return Passage(part.text, start, stop, *shown, asked, measured)

    def compose(
        self, moments: str | Sequence[Moment], *, steer: SteerModel | None = None, seed: int = 0, strict: bool = False
    ) -> Composition:
        """A motion that shows prompts at their times, and is where it is asked to be, facing that way, in given poses.

        moments: what is asked for at which time (:class:`motet.Moment`), such as ``motet.read_plan`` gives; or a script
            as ``motet.parse_plan`` reads it. Feet are planted. A prompt that asks for walking or running, and nothing
            else, is steered to its places; any other motion is turned and moved there by up to half a metre a second.
        steer: the model of walks to places, by default the bundle "control".
        seed, strict: like :meth:`story`.
        SettingError for moments that are out of order; MotionError for a place that is out of reach, with the time that
        it takes, and for a pose that is not a human's or is under the ground; TextError like :meth:`story`.
        """
        from motet.models.load import load  # which knows this class

        given = parse_plan(moments) if isinstance(moments, str) else list(moments)
        for moment in given:
            needs(moment, Moment, "a moment")
        return compose(given, self, steer or load("control"), seed, strict)

    def stream(self, sentences: str | Sequence[str], **settings: Unpack[StorySettings]) -> Iterator[Motion]:
        """The motion of :meth:`story` in pieces, as they are drawn: each continues the last one.

        Feet are as drawn, since planting them requires knowing how long they stand. Memory and the time of a piece stay
        constant, however long the stream lasts. With ``seconds``, what turns by a number or is played faster or slower
        comes in pieces of up to 20 s; what ends when it has a number of something comes as one. Errors like
        :meth:`story`.
        """
        parts, after, drawn = self._told(sentences, **settings)  # what cannot be told is refused before the first piece

        def pieces() -> Iterator[Motion]:
            last, pose, told = after, None, 0
            for piece in drawn:
                if piece.number == told:
                    self._shown(parts[told].asked.text, piece.action)
                    told += 1
                if len(piece.frames):
                    last, pose = in_world(self.contract.features(piece.frames), last, pose)
                    yield last

        return pieces()

    def _told(
        self,
        sentences: str | Sequence[str],
        *,
        after: Motion | None = None,
        seconds: float | Sequence[float | None] | None = None,
        stand: Stand | None = None,
        seed: Seed = 0,
        strict: bool = False,
        **settings: Unpack[ReadSettings],
    ) -> tuple[list[Part], Motion | None, Iterator[Piece]]:
        """The parts of a story with those of standing, the motion on the model's figure that it continues, and its
        pieces as they are drawn."""
        texts = texts_of(sentences)
        numbers, whole = settings.pop("numbers", True), settings.pop("whole", False)
        drawn = cast(Mapping[str, float | None], settings)
        if not texts:
            raise TextError("a story needs a sentence")
        if stand not in (None, *get_args(Stand)):
            raise DecodingError(f"stand is one of {', '.join(get_args(Stand))}, not {stand!r}")
        if drawn.get("hypotheses") not in (None, 1):
            raise DecodingError(f"a story is one motion: hypotheses must be 1, not {drawn['hypotheses']}")
        lengths = self._lengths(seconds, len(texts))
        parts = [[text] if whole else self.parts(text) for text in texts]
        each = [length / len(own) for own, length in zip(parts, lengths, strict=True) for _ in own]
        texts = [part for own in parts for part in own]
        for end, place in (("start", 0), ("end", len(texts) + 1)):
            if stand in (end, "both"):
                texts.insert(place, STANDING)
                each.insert(place, STANDING_SECONDS)
        asked = [self.quantities(text) if numbers else Quantities(text) for text in texts]
        contexts, noise, chosen = self.asked([one.text for one in asked], 1, seed, strict, drawn)
        figure = None if after is None else self.contract.on_figure(self.at_own_rate(after))
        told = [
            Part(text, one, context, length or one.amounts.get("seconds", 0.0))
            for text, one, context, length in zip(texts, asked, contexts, each, strict=True)
        ]
        told = [replace(part, pace=pace_of(part, self.source, self.codec)) for part in told] if numbers else told
        teller = Teller(self.source, self.codec, self.contract, noise, chosen, self.continuation.context)
        return told, figure, teller.pieces(told, None if figure is None else self.context(figure))

    def _lengths(self, seconds: float | Sequence[float | None] | None, count: int) -> list[float]:
        """The seconds of so many sentences, 0 where one ends by itself; DecodingError like :meth:`story`."""
        given: list[Any] = [seconds] * count if np.ndim(cast(Any, seconds)) == 0 else list(cast(Any, seconds))
        if len(given) != count:
            raise DecodingError(f"seconds must be a number, or one for each of {count} sentences, not {seconds}")
        return [self._settled({"seconds": one})["seconds"] for one in given]

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
