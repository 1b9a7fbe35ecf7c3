"""How a model of motion codes reads sentences: as recorded actions, bare commands or acts by key poses, with numbers,
and in parts."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from motet.bundle.fields import Fields
from motet.bundle.graph import Floats
from motet.errors import BundleError, TextError, TextWarning, needs, warn
from motet.figures.humanoid import HUMANOID
from motet.generate.act_index import SHIPPED_ACTS, ActIndex
from motet.generate.base import FamiliaritySettings, GenerateModel, Understood
from motet.generate.commands import Commands
from motet.generate.keyed_acts import (
    ARTICLES,
    BOTH_SIDES,
    HAND_NAMED,
    HELD,
    LEGS,
    LIMB_STEMS,
    STANDING,
    TOGETHER,
    NamedAct,
    counted,
    stems_of,
)
from motet.keyed.acts import KeyedAct
from motet.models.language import texts_of
from motet.text.clauses import (
    ADDRESSEE,
    FUNCTION_WORDS,
    OWN,
    SUBJECT,
    Shown,
    at_odds,
    parts_of,
    sentences_of,
    stem,
    verbs_of,
)
from motet.text.numeric_phrases import PACE_PHRASES, Quantities, known_turns, quantities_of
from motet.text.vocabulary import MAX_WORDS, check_length

DONE = re.compile(r"(?:ing|ed|[^s]s)$")
"""The ending of a word for an action."""

NEVER = -1e9
"""Log-probability of an action that is not drawn."""

FAR_LESS = -100.0
"""What is added to the log-probabilities of actions where a command is meant."""


def first_verb(clause: str) -> str:
    """The stem of the word after the subject of a clause."""
    return stem(SUBJECT.sub("", clause, count=1).lower().split()[0])


class SentenceModel(GenerateModel):
    """A model that knows the words of each action, and commands."""

    def _read_sentences(self) -> None:
        """Read actions and commands from the manifest, once the number of actions is known."""
        source = Fields(self.manifest.source)
        commands = source.list_of_fields("commands") if "commands" in self.manifest.source else []
        self._commands = Commands.of(commands, self.vocabulary.rules, self.sizes["A"], self.vocabulary.meant)
        self._familiar = self.settings(FamiliaritySettings)
        self._know(SHIPPED_ACTS)
        self._read_actions(source.list_of_fields("actions"))

    def _know(self, acts: ActIndex) -> None:
        """Read sentences by an index of acts."""
        self._acts = acts
        # a reading needs the act and the context of each part of a sentence several times
        self._keyed = lru_cache(maxsize=256)(self._keyed_act)
        self._context = lru_cache(maxsize=256)(self._context_of)

    def with_acts(self, acts: Mapping[str, KeyedAct]) -> Self:
        """A model that also knows acts by key poses of the caller's, such as those of :func:`motet.keyed.read`: a
        sentence that names several means these. The present one stays as it is. ArgumentError for another value."""
        needs(acts, Mapping, "acts by name")
        for act in acts.values():
            needs(act, KeyedAct, "an act by key poses")
        model = copy(self)
        model._know(ActIndex(acts))
        return model

    def unknown(self, sentence: str) -> list[str]:
        """See :meth:`motet.models.language.LanguageModel.unknown`; none where an act by key poses is named, whose words
        the vocabulary need not have, or in each of its parts."""
        is_keyed = self._keyed(sentence) or (self._knows_none(sentence) and self.parts(sentence))
        return [] if is_keyed else super().unknown(sentence)

    def contexts(self, sequences: Sequence[NDArray[Any]], role: str = "encoder") -> Floats:
        """See :meth:`motet.models.language.LanguageModel.contexts`; one by one, since padding changes the rounding."""
        alone = [super(SentenceModel, self).contexts([sequence], role) for sequence in sequences]
        return np.concatenate([np.empty((0, self.sizes["A"]), dtype=np.float32), *alone])

    def embed(self, sentences: str | Sequence[str]) -> Floats:
        """See :meth:`GenerateModel.embed`: (A,), or (A + 1 + C,) where the bundle has C commands."""
        texts = texts_of(sentences)
        for text in texts:
            self.ids(text)  # warns of unknown words
        if not texts:
            return np.empty((0, self.sizes["A"]), dtype=np.float32)
        contexts = np.stack([self._context(text) for text in texts])
        return contexts[0] if isinstance(sentences, str) else contexts

    def _meant(self, text: str, context: Floats) -> Floats:
        """The context (A + 1 + C,) of a text, from the log-probabilities (A,) of actions: that of its command alone,
        where it has one."""
        act = self._command(text, context)
        meant = np.full(self._commands.first + len(self._commands.acts), NEVER, dtype=np.float32)
        meant[: len(context)] = context
        if act is not None:
            meant[: len(context)] += np.float32(FAR_LESS)
            meant[act] = 0.0
        return meant

    def _command(self, text: str, context: Floats) -> int | None:
        """The command that a text is but for its subject, unless it is the sentence of an action or the command is not
        recorded; or the nearest one where it leaves out less than the likeliest action, or the same and that does
        something else. Less: a word more counts where that is not confident, and two where it lacks one of the command.
        """
        is_recorded = text in self._sentences[: self.sizes["A"]]
        order = text if is_recorded else SUBJECT.sub("", text, count=1)
        act = self._commands.act(order)
        if act is not None and (order == text or self._is_obeyed(order, context)):
            return act
        nearest = self._commands.nearest(order)
        if nearest is None:
            return None
        likeliest = int(context.argmax())
        lacking = self.lacking(text, likeliest)
        command = self._commands.action(nearest)
        lacked = self.lacking(text, command)
        limit = (
            len(lacking)
            + (not self._understood(text, context).confident)
            + 2 * (not nearest.isdisjoint(map(stem, lacking)))
        )
        if lacked == lacking and first_verb(text) != first_verb(self._sentences[likeliest]):
            limit += 1
        return command if len(lacked) < limit else None

    def _is_obeyed(self, order: str, context: Floats) -> bool:
        """Whether a command whose subject is said is shown, and not the likeliest action: unless nobody recorded it,
        and the action has its verb."""
        recorded = self.vocabulary.rules.words(self._sentences[int(context.argmax())])
        return not self._commands.is_instead(order) or stem(order.split(maxsplit=1)[0]) not in stems_of(recorded)

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
        check_length(sentence)
        if len(self.vocabulary.rules.words(sentence)) > MAX_WORDS:
            self.vocabulary.encode(sentence)  # refuses it
        if self.contract.skeleton != HUMANOID or self._is_recorded(sentence):
            return None
        text, amounts = counted(sentence)
        if amounts.keys() != {"seconds"}:
            return self._keyed_at_pace(sentence)
        text = HELD.sub("", text)
        act = None if text in self._sentences else self._keyed_by_hand(text)
        return replace(act, seconds=amounts["seconds"]) if act and not act.is_other_text else None

    def _is_recorded(self, sentence: str) -> bool:
        """Whether a sentence is one of a recorded action, and names no act of the caller's."""
        if sentence not in self._sentences:
            return False
        words = self._acts.without_subject(self.vocabulary.rules.words(sentence))
        return not self._acts.is_of_caller(self._acts.named(words))

    def _keyed_at_pace(self, sentence: str) -> NamedAct | None:
        """The act of a sentence that does not say how long it lasts; in its pace, if that is no part of the act."""
        act = self._keyed_by_hand(sentence)
        is_composed = re.search(r",| and | then ", sentence)
        pace = PACE_PHRASES.search(sentence)
        if (act and not act.lacking) or is_composed or pace is None:
            return act
        plain = self._keyed_by_hand(PACE_PHRASES.sub("", sentence).strip(" ,"))
        if plain is None or plain.lacking:
            return act
        if plain.is_other_text:
            if self._commands.act(plain.base) is None:
                return act
            paced = replace(plain.act, over=f"{plain.base} {pace[0]}")
            return replace(plain, act=paced)
        # acts are short: less is not seen
        return plain.at_pace(quantities_of(sentence).amounts.get("pace", 1.0) ** 2)

    def _keyed_by_hand(self, sentence: str) -> NamedAct | None:
        """The act of a sentence that does not say how long it lasts, done with the hand that it names, if it is one of
        either hand."""
        if hand := HAND_NAMED.search(sentence):
            act = self._keyed_usual(HAND_NAMED.sub("", sentence))
            if act and act.act.mirrored:
                return act.with_hand(hand[1])
            # who points to the left with the right hand does so with the left one
            other_side = BOTH_SIDES - {hand[1]}
            if act and other_side & stems_of(act.sentence.split()):
                return replace(act, lacking=(*act.lacking, hand[1], "hand"))
        return self._keyed_usual(sentence)

    def _keyed_usual(self, sentence: str) -> NamedAct | None:
        """The act of a sentence with neither: :meth:`_keyed_act`."""
        words = self.vocabulary.rules.words(sentence)
        act = self._keyed_counted(sentence) or self._acts.named(words)
        if act is None:
            words = self._acts.without_subject(words)
            sentence = " ".join(words)
            act = self._acts.named(words)
        if act is None:
            return self._keyed_over(sentence) or self._keyed_within(sentence)
        if act.is_small or act.times or act.is_other_text or self._acts.is_of_caller(act):
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
            words = self._acts.without_subject(act_clause.split())
            named = self._acts.named(words)
            # a recorded action has all words: it gives way to an act and a command that are said so
            if not (leaves_out or (named and self._commands.act(below) is not None)):
                continue
            act = named or self._acts.within(words)
            laid_over = self._laid_over(act, below) if act else None
            if laid_over is not None:
                return laid_over
        return None

    def _laid_over(self, act: NamedAct, below: str) -> NamedAct | None:
        """An act over what a clause says; None where it cannot be, or the clause says nothing that is known."""
        if STANDING.fullmatch(below):
            return act
        if not act.leaves(*LEGS):
            return None
        words = below.split()
        if SUBJECT.sub("", below).split()[0] in ARTICLES:  # "wakes up with a start"
            return None
        legs = self._acts.named(self._acts.without_subject(words))
        if legs and not (legs.leaves(*LEGS) or legs.is_other_text):
            return replace(act, legs=legs)
        is_limb = stems_of(words) <= BOTH_SIDES | LIMB_STEMS
        has_verb = not is_limb and any(stem(word) in self._verbs for word in words)
        return replace(act, below=below) if has_verb and not self._leaves_out(below) else None

    def _leaves_out(self, sentence: str) -> bool:
        """Whether a sentence has an unknown word, or its likeliest action or command leaves out a word."""
        words = self.vocabulary.rules.words(sentence)
        return "" in map(self.vocabulary.meant, words) or bool(self.lacking(sentence))

    def _keyed_within(self, sentence: str) -> NamedAct | None:
        """The act whose order a sentence without its subject holds beside other words, unless the likeliest recorded
        action or command leaves out no more of it. For this a word more counts where that is not confident, and another
        one where it lacks a word of the order."""
        text, amounts = counted(sentence)
        words = self.vocabulary.rules.words(text)
        act = self._acts.within(words, amounts.get("times")) if words else None
        if act is None or act.is_other_text:
            return None
        if self._knows_none(text):
            return act
        lacking = self.lacking(text)
        missing = stems_of(word for word in words if self.vocabulary.meant(word) in ("", *lacking))
        limit = len(missing) + (not self._understood(text, self._context(text)).confident)
        limit += not missing.isdisjoint(stems_of(act.sentence.split()))
        return act if len(act.lacking) < limit else None

    def _knows_none(self, sentence: str) -> bool:
        """Whether all words of a sentence are unknown."""
        return not any(map(self.vocabulary.meant, self.vocabulary.rules.words(sentence)))

    def _keyed_counted(self, sentence: str) -> NamedAct | None:
        """The act that a sentence names beside how often: "nods three times"."""
        text, amounts = counted(sentence)
        times = amounts.get("times")
        if times is None:
            return None
        words = self.vocabulary.rules.words(text)
        named = self._acts.named(words, times) or self._acts.named(self._acts.without_subject(words), times)
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
            # a command that counts what it does is given the number
            often = f"{act.base} {act.times} times"
            if act.times and self._commands.act(act.base) is not None and quantities_of(often).act:
                return [often]
            return max(1, act.times) * self._pieces(act.base)
        pieces = self._pieces(sentence)
        if len(pieces) > 1:
            return list(chain.from_iterable(map(self.parts, pieces)))
        if act is None:
            self.vocabulary.encode(sentence)
        if act and act.times and not (act.act.repeat or act.lacking):
            return act.times * [counted(sentence)[0]]
        return [sentence]

    def _pieces(self, sentence: str) -> list[str]:
        """The sentences of a text, each cut into its parts where they are not shown at once."""
        pieces = []
        for whole in sentences_of(sentence):
            parts = self._parts_of(whole)
            at_once = len(parts) > 1 and not self._knows_none(whole) and self._shown_at_once(whole, parts)
            pieces += [whole] if at_once else parts
        return pieces

    def _parts_of(self, sentence: str) -> list[str]:
        """The parts of a sentence before verbs of recorded actions and commands, or, if one of them is then an act by
        key poses, before the verbs of these, too."""
        with_keyed = parts_of(sentence, self._verbs | self._acts.verbs)
        return with_keyed if any(map(self._keyed, with_keyed)) else parts_of(sentence, self._verbs)

    def _shown_at_once(self, sentence: str, parts: Sequence[str]) -> bool:
        """Whether the likeliest action of a sentence shows all its parts, none of which has numbers of its own or
        is done again; or an act by key poses shows all, and no two parts name different ones."""
        shown = self.likeliest(sentence)
        if shown.lacking or (shown.confidence or 0.0) < self._familiar.confident:
            return False
        acts = [act for act in map(self._keyed, parts) if act]
        if whole := self._keyed(sentence):
            return not whole.is_other_text and all(act.act == acts[0].act for act in acts)
        # recordings show no act of the caller's
        verbs = set(map(first_verb, parts))
        if len(verbs) < len(parts) or any(map(self._acts.is_of_caller, acts)):
            return False
        if not self._share_numbers(sentence, parts):
            return False
        # Several commands are one only where they are known as one.
        if self._is_known(sentence, keyed=False):
            return True
        says_all = verbs <= stems_of(self.vocabulary.rules.words(shown.action))
        return not all(self._is_known(part, keyed=not says_all) for part in parts)

    def _share_numbers(self, sentence: str, parts: Sequence[str]) -> bool:
        """Whether the numbers of a sentence may be those of all its parts, as steps and repetitions are not."""
        amounts = self.quantities(sentence).amounts
        if {"steps", "times"} & amounts.keys():
            return False
        return all(quantities_of(part).amounts in ({}, amounts) for part in parts)

    def _is_known(self, part: str, keyed: bool) -> bool:
        """Whether a part is a command or, if ``keyed``, an act by key poses."""
        is_keyed = keyed and self._keyed(part) is not None
        return is_keyed or self._commands.act(self.quantities(part).text) is not None

    def quantities(self, sentence: str) -> Quantities:
        """The numbers in a sentence, and the text that it is read as: itself if the likeliest action has all its words,
        else the sentence without the numbers, or with another angle; no pace that this action has already. TextError
        like :func:`motet.text.numeric_phrases.quantities_of`."""
        if self.contract.skeleton != HUMANOID:
            return Quantities(sentence)
        if act := self._keyed(sentence):
            return Quantities(act.base, {"seconds": act.seconds} if act.seconds else {})
        quantities = self._paced(self._on_the_spot(quantities_of(sentence)))
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
        return self._without_own_pace(quantities)

    def _without_own_pace(self, quantities: Quantities) -> Quantities:
        """Quantities without a pace that their likeliest action has already."""
        has_pace = "pace" in quantities.amounts and PACE_PHRASES.search(quantities.text)
        if not has_pace or any(map(PACE_PHRASES.fullmatch, self.lacking(quantities.text))):
            return quantities
        amounts = dict(quantities.amounts)
        del amounts["pace"]
        return replace(quantities, amounts=amounts)

    def _paced(self, quantities: Quantities) -> Quantities:
        """Quantities whose text is a command without its pace, unless the likeliest action does what that says: to
        stand up quickly is not to step aside quickly. Where a subject is said, any of its sentences may have the verb,
        but the pace is to be in the one that it is shown by: a few of many are no sign.
        """
        text = re.sub(" +", " ", PACE_PHRASES.sub("", quantities.text)).strip(" ,")
        order = SUBJECT.sub("", text, count=1)
        is_command = self._commands.act(order) is not None and self._commands.act(quantities.text) is None
        if "pace" not in quantities.amounts or not is_command:
            return quantities
        action = int(self._context(quantities.text).argmax())
        verb = first_verb(text)
        shown = self._sentences[action]
        has_verb = verb == first_verb(shown) or (order != text and verb in self._stems(action))
        does_it = has_verb and PACE_PHRASES.search(shown) and not self.lacking(quantities.text, action)
        return quantities if does_it else replace(quantities, text=text)

    def _on_the_spot(self, quantities: Quantities) -> Quantities:
        """Quantities whose text is a turn on the spot, where that is a command, whoever turns; else as they are."""
        if "degrees" not in quantities.amounts:
            return quantities
        for spot in (quantities.spot, SUBJECT.sub("", quantities.spot, count=1)):
            turn = PACE_PHRASES.sub("", spot).strip()
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

    def _context_of(self, sentence: str) -> Floats:
        """The context (A,) of a sentence, without a warning of unknown words."""
        ids, _ = self.vocabulary.encode(sentence)
        context: Floats = self.contexts([ids])[0]
        return self._meant(sentence, context) if self._commands.acts else context

    def _content(self, sentence: str) -> dict[str, frozenset[str]]:
        """The known words of a sentence, sorted, without function words, and the stems that show each."""
        words = set(map(self.vocabulary.meant, self.vocabulary.rules.words(sentence))) - FUNCTION_WORDS - {""}
        return {word: frozenset((stem(word), stem(self.vocabulary.near(word)))) for word in sorted(words)}

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
        nearest = dict.fromkeys(filter(None, map(self._sentences.__getitem__, order.tolist())))
        likeliest = float(context[order[0]])
        if likeliest > 0.01:  # more than rounding
            raise BundleError(f"graph encoder: its context holds {likeliest:g}, which is no log-probability")
        confidence = self._share_known(sentence, int(order[0])) * math.exp(likeliest) ** self._familiar.doubt
        return Understood(confidence, tuple(nearest)[:3], confidence >= self._familiar.confident)

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
        message = (
            f"{sentence!r} is outside the training data (confidence {understood.confidence:.2f}); nearest: {nearest}"
        )
        if strict:
            raise TextError(message)
        warn(message, TextWarning)

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
