"""Generate motions code by code, of natural or given length, continue them, and show several sentences as a story."""

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from typing import Any, Literal, Self, Unpack, cast, get_args

import numpy as np
from numpy.typing import NDArray

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
from motet.figures.humanoid import HUMANOID
from motet.generate.base import (
    FamiliaritySettings,
    Generated,
    GenerateModel,
    LoopSettings,
    LoopValues,
    Story,
    Understood,
)
from motet.generate.codec import Codec, Context, ReceptiveField, StreamingDecoder
from motet.generate.codes import LOOPS, CodesSettings, Source, Writer, draw_codes, drawn_actions
from motet.generate.commands import Commands
from motet.generate.continue_codes import ContinuationSettings
from motet.generate.keyed_acts import (
    BOTH_SIDES,
    HAND,
    HELD,
    LIMB_STEMS,
    STANDING,
    STANDS,
    TOGETHER,
    NamedAct,
    act_named,
    act_within,
    counted,
    stems_of,
    without_subject,
)
from motet.generate.keyed_acts import verbs as keyed_verbs
from motet.generate.memory import Memory, MemorySettings
from motet.generate.motion_measures import Seen, short
from motet.generate.story_decoder import Piece, Request, Teller, pace_of
from motet.models.language import texts_of
from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.root_sixd import in_world
from motet.settings import Seed
from motet.text.clauses import (
    ADDRESSEE,
    FUNCTION_WORDS,
    OWN,
    SUBJECT,
    THEN,
    Passage,
    Shown,
    at_odds,
    parts_of,
    sentences_of,
    stem,
    verbs_of,
)
from motet.text.numeric_phrases import PACE_PHRASES, Quantities, known_turns, quantities_of

DONE = re.compile(r"(?:ing|ed|[^s]s)$")
"""The ending of a word for an action."""

STANDING_SECONDS = 0.8
"""Duration of standing there."""

DECODED_AT_ONCE = 64
"""Steps of a story that are decoded at once."""

NEVER = -1e9
"""Log-probability of an action that is not drawn."""

FAR_LESS = -100.0
"""What is added to the log-probabilities of actions where a command is meant."""

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


class CodesModel(GenerateModel):
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
        source = Fields(manifest.source)
        commands = source.list_of_fields("commands") if "commands" in manifest.source else []
        self._commands = Commands.of(commands, self.vocabulary.rules, self.sizes["A"], self.vocabulary.meant)
        written = self._commands.written
        self.source = Source(graphs["step"], graphs["part"], self.codec.moves, self.sizes["A"], self._remember, written)
        self._familiar = self.settings(FamiliaritySettings)
        # a reading asks for the act of each part of a sentence several times
        self._keyed = lru_cache(maxsize=256)(self._keyed_act)
        self._read_actions(source.list_of_fields("actions"))

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
        if 3 + self.sizes["B"] * self.sizes["N"] != self.sizes["L"]:
            raise BundleError("manifest, tables.body: does not fit the graph step")

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """See :meth:`motet.models.language.LanguageModel.contexts`; one by one, since padding changes the rounding."""
        alone = [super(CodesModel, self).contexts([sequence], role) for sequence in sequences]
        return np.concatenate([np.empty((0, self.sizes["A"]), dtype=np.float32), *alone])

    def embed(self, sentences: str | Sequence[str]) -> Floats:
        """See :meth:`GenerateModel.embed`: (A,), or (A + 1 + C,) where the bundle has C commands."""
        texts = texts_of(sentences)
        contexts = super().embed(texts)
        if self._commands.acts:
            meant = [self._meant(text, context) for text, context in zip(texts, contexts, strict=True)]
            contexts = np.stack(meant) if meant else contexts
        return contexts[0] if isinstance(sentences, str) else contexts

    def _meant(self, text: str, context: Floats) -> Floats:
        """The context (A + 1 + C,) of a text, from the log-probabilities (A,) of actions: that of its command alone,
        where it has one."""
        act = self._command(text, context)
        meant = np.full(self._commands.first + len(self._commands.acts), NEVER, dtype=np.float32)
        if act is None:
            meant[: len(context)] = context
        else:
            meant[: len(context)] = context + np.float32(FAR_LESS)
            meant[act] = 0.0
        return meant

    def _command(self, text: str, context: Floats) -> int | None:
        """The command that a text is but for its subject, unless it is the sentence of an action or the command is not
        recorded; or the nearest one where it leaves out less than the likeliest action. For this a word more counts
        where it is not confident, and another one where it lacks a word of the command."""
        is_recorded = text in self._sentences[: self.sizes["A"]]
        order = text if is_recorded else SUBJECT.sub("", text, count=1)
        act = self._commands.act(order)
        if act is not None and (order == text or not self._commands.is_instead(order)):
            return act
        nearest = self._commands.nearest(order)
        if nearest is None:
            return None
        lacking = self.lacking(text, int(context.argmax()))
        limit = len(lacking) + (not self._understood(text, context).confident)
        limit += not nearest.isdisjoint(map(stem, lacking))
        command = self._commands.action(nearest)
        return command if len(self.lacking(text, command)) < limit else None

    def _read_actions(self, entries: Sequence[Fields]) -> None:
        """The known actions: a sentence and the words of each, and the weights of words, more of one that describes few
        actions."""
        if len(entries) != self.sizes["A"]:
            raise BundleError(f"manifest, actions: {len(entries)} entries, expected {self.sizes['A']}")
        self._sentences = [entry.text("sentence") for entry in entries]
        self._words = [entry.texts("words") for entry in entries]
        actions_with = Counter(chain.from_iterable(self._words))
        # Then no action, and commands.
        self._sentences += ["", *(command.sentence for command in self._commands.acts)]
        self._words += [(), *(command.words for command in self._commands.acts)]
        self._rare = {word: math.log((1 + len(entries)) / count) for word, count in actions_with.items()}
        self._verbs = verbs_of(actions_with) | self._commands.verbs

    def _stems(self, action: int) -> frozenset[str]:
        """The stems of the words that describe an action."""
        return frozenset(map(stem, self._words[action]))

    def _done(self, action: int) -> frozenset[str]:
        """The stems of those of its words that are what is done."""
        is_command = action >= self._commands.first
        return frozenset(stem(word) for word in self._words[action] if is_command or DONE.search(word))

    def _keyed_act(self, sentence: str) -> NamedAct | None:
        """The act by key poses that a sentence names; None where there is none, or, of one that is not small, where the
        sentence is a command or a recorded action has all its words, those of the act in its own sentence, and shows no
        more. A sentence may say more than the act, where the likeliest recorded action leaves out more of it."""
        if self.contract.skeleton != HUMANOID or sentence in self._sentences:
            return None
        text, amounts = counted(sentence)
        if amounts.keys() != {"seconds"}:
            return self._keyed_usual(sentence)
        act = self._keyed(HELD.sub("", text))
        return replace(act, seconds=amounts["seconds"]) if act and not act.is_other_text else None

    def _keyed_usual(self, sentence: str) -> NamedAct | None:
        """The act of a sentence that does not say how long it lasts: :meth:`_keyed_act`."""
        if hand := HAND.search(sentence):
            act = self._keyed_usual(HAND.sub("", sentence, count=1))
            if act and act.act.mirrored:
                return act.with_hand(hand[1])
        words = self.vocabulary.rules.words(sentence)
        act = self._keyed_counted(sentence) or act_named(words)
        if act is None:
            words = without_subject(words)
            sentence = " ".join(words)
            act = act_named(words)
        if act is None:
            return self._keyed_over(sentence) or self._keyed_within(sentence)
        if act.is_small or act.times or act.is_other_text:
            return act
        if self._commands.act(sentence) is not None and not self._commands.is_instead(sentence):
            return None
        if self._leaves_out(sentence):
            return act
        recorded = stems_of(self.vocabulary.rules.words(self._shown_as(sentence).action))
        shows_more = not recorded & (self._verbs | LIMB_STEMS) <= stems_of(words)
        return act if shows_more or not stems_of(act.sentence.split()) <= recorded else None

    def _keyed_over(self, sentence: str) -> NamedAct | None:
        """The act of the upper body that a sentence names beside what is done at the same time, "waves while walking",
        or beside an act of the legs, unless the likeliest recorded action or command shows both."""
        clauses = list(filter(None, map(str.strip, TOGETHER.split(sentence))))
        if len(clauses) != 2:
            return None
        leaves_out = self._leaves_out(sentence)
        for act_clause, below in (clauses, clauses[::-1]):
            words = without_subject(act_clause.split())
            named = act_named(words)
            # a recorded action has all words: it gives way to an act and a command that are said so
            if not (leaves_out or (named and self._commands.act(below) is not None)):
                continue
            act = named or act_within(words)
            if act and STANDING.fullmatch(below):
                return act
            legs = act_named(without_subject(below.split()))
            if act and act.leaves_legs and legs and not (legs.leaves_legs or legs.is_other_text):
                return replace(act, legs=legs)
            is_limb = stems_of(below.split()) <= BOTH_SIDES | LIMB_STEMS
            has_verb = not is_limb and any(stem(word) in self._verbs for word in below.split())
            if act and act.leaves_legs and has_verb and not self._leaves_out(below):
                return replace(act, below=below)
        return None

    def _leaves_out(self, sentence: str) -> bool:
        """Whether a sentence has an unknown word, or its likeliest action or command leaves out a word."""
        words = self.vocabulary.rules.words(sentence)
        return not all(map(self.vocabulary.meant, words)) or bool(self.lacking(sentence))

    def _keyed_within(self, sentence: str) -> NamedAct | None:
        """The act whose order a sentence without its subject holds beside other words, unless the likeliest recorded
        action or command leaves out no more of it. For this a word more counts where that is not confident, and another
        one where it lacks a word of the order."""
        text, amounts = counted(sentence)
        words = self.vocabulary.rules.words(text)
        act = act_within(words, amounts.get("times")) if words else None
        if act is None or act.is_other_text:
            return None
        if not any(map(self.vocabulary.meant, words)):
            return act
        lacking = self.lacking(text)
        missing = stems_of(word for word in words if self.vocabulary.meant(word) in ("", *lacking))
        limit = len(missing) + (not self._understood(text, self._context(text)).confident)
        limit += not missing.isdisjoint(stems_of(act.sentence.split()))
        return act if len(act.lacking) < limit else None

    def _keyed_counted(self, sentence: str) -> NamedAct | None:
        """The act that a sentence names beside how often: "nods three times"."""
        text, amounts = counted(sentence)
        times = amounts.get("times")
        if times is None:
            return None
        words = self.vocabulary.rules.words(text)
        named = act_named(words, times) or act_named(without_subject(words), times)
        # One that cannot be repeated gives way to a command's, which can.
        if named and not named.act.repeat and self._commands.act(text) is not None:
            return None
        return named

    def parts(self, sentence: str) -> list[str]:
        """The things that a text requests one after another: its sentences, and the parts of a sentence
        (:func:`motet.text.clauses.parts_of`) whose likeliest action leaves something out; errors like :meth:`ids`."""
        sentence = ADDRESSEE.sub("", sentence)
        act = self._keyed(sentence)
        if act and act.is_other_text:
            return max(1, act.times) * self._pieces(act.base)
        if act is None:
            self.vocabulary.encode(sentence)
        pieces = self._pieces(sentence)
        if len(pieces) > 1:
            return list(chain.from_iterable(map(self.parts, pieces)))
        if act and act.times and not (act.act.repeat or act.lacking):
            return act.times * [counted(sentence)[0]]
        return [sentence]

    def _pieces(self, sentence: str) -> list[str]:
        """The sentences of a text, each cut into its parts where they are not shown at once."""
        pieces = []
        for whole in sentences_of(sentence):
            parts = self._parts_of(whole)
            at_once = len(parts) > 1 and self._shown_at_once(whole, parts)
            pieces += [whole] if at_once else parts
        return pieces

    def _parts_of(self, sentence: str) -> list[str]:
        """The parts of a sentence before verbs of recorded actions and commands, or, if one of them is then an act by
        key poses, before the verbs of these, too."""
        with_keyed = parts_of(sentence, self._verbs | keyed_verbs())
        return with_keyed if any(map(self._keyed, with_keyed)) else parts_of(sentence, self._verbs)

    def _shown_at_once(self, sentence: str, parts: Sequence[str]) -> bool:
        """Whether the likeliest action of a sentence shows all its parts, none of which has numbers of its own or
        is done again; or an act by key poses shows all, and no two parts name different ones."""
        if self.likeliest(sentence).lacking or not self.understood(sentence).confident:
            return False
        if self._keyed(sentence):
            acts = [act.act for act in map(self._keyed, parts) if act]
            return all(act == acts[0] for act in acts)
        verbs = [stem(SUBJECT.sub("", part).split()[0].lower()) for part in parts]
        if len(set(verbs)) < len(verbs):
            return False
        quantities = self.quantities(sentence)
        for part in parts:
            amounts = dict(quantities_of(part).amounts)
            if amounts and amounts != dict(quantities.amounts):
                return False
        # Several commands are one only where they are known as one, and what is said to come after is.
        if self._commands.act(quantities.text) is not None:
            return True
        are_commands = [self._commands.act(self.quantities(part).text) is not None for part in parts]
        return not (all(are_commands) or (THEN.search(sentence) and any(are_commands)))

    def quantities(self, sentence: str) -> Quantities:
        """The numbers in a sentence, and the text that it is read as: itself if the likeliest action has all its words,
        else the sentence without the numbers, or with another angle; no pace that this action has already. TextError
        like :func:`motet.text.numeric_phrases.quantities_of`."""
        if self.contract.skeleton != HUMANOID:
            return Quantities(sentence)
        if act := self._keyed(sentence):
            return Quantities(act.base, {"seconds": act.seconds} if act.seconds else {})
        quantities = self._on_the_spot(quantities_of(sentence))
        if self._commands.act(sentence) is not None and "times" not in quantities.amounts:
            return Quantities(sentence)
        if self._commands.act(quantities.text) is not None:
            return quantities
        if quantities.amounts and quantities.text != sentence:
            texts = known_turns(quantities)
            if quantities.amounts.keys() & {"degrees", "times"}:
                texts.insert(0, sentence)
            for text in texts:
                if not (self.unknown(text) or self.lacking(text)):
                    quantities = replace(quantities, text=text)
                    break
        if "pace" in quantities.amounts and not any(map(PACE_PHRASES.fullmatch, self.lacking(quantities.text))):
            amounts = dict(quantities.amounts)
            del amounts["pace"]
            quantities = replace(quantities, amounts=amounts)
        return quantities

    def _on_the_spot(self, quantities: Quantities) -> Quantities:
        """Quantities whose text is a turn on the spot, where that is a command, whoever turns; else as they are."""
        if "degrees" not in quantities.amounts:
            return quantities
        opening = SUBJECT.match(quantities.spot)
        for turn in (quantities.spot, quantities.spot[opening.end() :] if opening else ""):
            if self._commands.act(turn) is not None:
                return replace(quantities, text=turn)
        return quantities

    def lacking(self, sentence: str, action: int | None = None) -> list[str]:
        """The known words of a sentence, without function words, that no sentence of an action has in any form; for a
        common word the word nearest to it counts, too. action: by default the likeliest."""
        if action is None:
            action = int(self._context(sentence).argmax())
        have = self._stems(action)
        if action >= self._commands.first and self._commands.is_instead(sentence):
            have = frozenset()
        return [word for word, forms in self._content(sentence).items() if have.isdisjoint(forms)]

    def _context(self, sentence: str) -> Floats:
        """The context (A,) of a sentence, without a warning of unknown words."""
        ids, _ = self.vocabulary.encode(sentence)
        context: Floats = self.contexts([ids])[0]
        return self._meant(sentence, context) if self._commands.acts else context

    def _content(self, sentence: str) -> dict[str, frozenset[str]]:
        """The known words of a sentence, sorted, without function words, and the stems that show each."""
        words = set(map(self.vocabulary.meant, self.vocabulary.rules.words(sentence))) - FUNCTION_WORDS - {""}
        return {word: frozenset((stem(word), stem(self.vocabulary.near(word)))) for word in sorted(words)}

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

    def understood(self, sentence: str, numbers: bool = True) -> Understood:
        """How well a sentence is known, and the nearest known sentences; errors like :meth:`ids`.

        numbers: judge the text that it is read as without its numbers (:meth:`quantities`), which :meth:`generate`
        shows.
        """
        if numbers and (act := self._keyed(sentence)):
            return Understood(act.confidence, (act.act.says[0],), act.confidence >= self._familiar.confident)
        text = self.quantities(sentence).text if numbers else sentence
        return self._understood(text, self.embed(text))

    def _understood(self, sentence: str, context: Floats) -> Understood:
        order = np.argsort(-context, kind="stable")
        nearest: dict[str, None] = {}
        for action in order.tolist():
            if self._sentences[action]:
                nearest[self._sentences[action]] = None
            if len(nearest) == 3:
                break
        likeliest = float(context[order[0]])
        if likeliest > 0.01:  # more than rounding
            raise BundleError(f"graph encoder: its context holds {likeliest:g}, which is no log-probability")
        confidence = self._share_known(sentence, int(order[0])) * math.exp(likeliest) ** self._familiar.doubt
        return Understood(confidence, tuple(nearest), confidence >= self._familiar.confident)

    def _share_known(self, sentence: str, action: int) -> float:
        """The share of a sentence in words of actions, rare words weighing more; 1 where its action is a command that
        leaves out nothing."""
        if action >= self._commands.first and not self.lacking(sentence, action):
            return 1.0
        words = dict.fromkeys(self.vocabulary.rules.words(sentence))
        unheard = math.log(1 + self.sizes["A"])
        known = sum(self._rare.get(word, 0.0) for word in words)
        return known / (sum(self._rare.get(word, unheard) for word in words) or 1.0)

    def note(self, sentence: str, context: Floats, strict: bool) -> None:
        """See :meth:`GenerateModel.note`."""
        if odd := at_odds(sentence):
            first, second = odd
            warn(f"{sentence!r} combines {first!r} and {second!r}, and only one can be shown", TextWarning)
        # verbs that only name what the action is about: "a fighter" does not fight
        likeliest = int(context.argmax())
        nouns = self._verbs & self._stems(likeliest) - self._done(likeliest)
        for verb in OWN.findall(self.vocabulary.rules.normalise(sentence)):
            if stem(verb) in nouns:
                shown = self._sentences[likeliest]
                warn(f"{shown!r} has no action {verb!r} (in {sentence!r})", TextWarning)
        # and what is unlike all known sentences
        understood = self._understood(sentence, context)
        if understood.confident:
            return
        nearest = ", ".join(f"'{near}'" for near in understood.nearest)
        confidence = f"confidence {understood.confidence:.2f}"
        message = f"{sentence!r} is outside the training data ({confidence}); nearest: {nearest}"
        if strict:
            raise TextError(message)
        warn(message, TextWarning)

    def results(self, sentence: str, samples: Sequence[Sample]) -> list[Generated]:
        """See :meth:`GenerateModel.results`."""
        shown: dict[int | None, Shown] = {}
        for sample in samples:
            if sample.action not in shown:
                shown[sample.action] = self._warned(sentence, self._shown_as(sentence, sample.action))
        motions = []
        for motion, sample in zip(super().results(sentence, samples), samples, strict=True):
            motions.append(replace(motion, **shown[sample.action]._asdict()))
        return motions

    def _shown(self, request: Request, action: int) -> Shown:
        """How a request is shown; a TextWarning names the words that are left out."""
        if request.keyed is not None:
            return self._warned(request.text, request.keyed.shown)
        sentence = request.quantities.text
        return self._warned(sentence, self._shown_as(sentence, action))

    def _warned(self, sentence: str, shown: Shown) -> Shown:
        if shown.lacking:
            warn(shown.left_out(sentence), TextWarning)
        return shown

    def likeliest(self, sentence: str) -> Shown:
        """How a sentence is shown by its likeliest action; motions that are drawn may show another likely one.
        Errors like :meth:`ids`, without warnings."""
        if act := self._keyed(sentence):
            return act.shown
        return self._shown_as(self.quantities(sentence).text)

    def _shown_as(self, sentence: str, action: int | None = None) -> Shown:
        """How a sentence is shown by an action, by default by the likeliest."""
        context = self._context(sentence)
        if action is None:
            action = int(context.argmax())
        confidence = self._understood(sentence, context).confidence
        return Shown(self._sentences[action], tuple(self.lacking(sentence, action)), confidence)

    def check_whole(self, sentence: str, numbers: bool = True) -> None:
        """See :meth:`GenerateModel.check_whole`."""
        shown = self.likeliest(sentence) if numbers else self._shown_as(sentence)
        if shown.lacking:
            raise TextError(shown.left_out(sentence))

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
        contexts = np.repeat(contexts, count, axis=0)
        actions = drawn_actions(self.source, contexts, noise_of_rows, settings["certainty"])
        # Codes, up to the end of a motion or as many as the seconds take.
        seconds = settings["seconds"]
        longest = max(1, self.codec.steps(seconds or settings["max_seconds"]))
        writer = Writer(self.source, noise_of_rows, CodesSettings(**settings))
        motions = draw_codes(writer, actions, longest, exactly=seconds > 0)
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
