"""Which act by key poses a sentence names: an index of the acts that ship, and of a caller's own, by their words."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain
from typing import NamedTuple

from motet.generate.keyed_acts import (
    ARTICLES,
    BODY_STEMS,
    BOTH_SIDES,
    FILLER_VERBS,
    LONGEST_SUBJECT,
    NamedAct,
    stems_of,
)
from motet.keyed.acts import KeyedAct
from motet.keyed.keys import mirrored_keys
from motet.keyed.shipped import says, shipped
from motet.text.clauses import FUNCTION_WORDS, stem
from motet.text.numeric_phrases import PACE_PHRASES
from motet.text.vocabulary import NEW_MODEL_RULES, NUMBER_WORDS


class Order(NamedTuple):
    """A sentence of an act, with its stems, and the function words that it cannot do without: "put" is not "put up"."""

    name: str
    sentence: str
    stems: frozenset[str]
    particles: frozenset[str]

    def fit(self, words: Sequence[str]) -> tuple[int, int, int, str, str]:
        """Rises with how much it says of a sentence's words: in stems, in words in their order, in others."""
        of_order = self.sentence.split()
        following = iter(map(stem, words))
        in_order = all(stem(word) in following for word in of_order) * len(of_order)
        return len(self.stems), in_order, len(set(words).intersection(of_order)), self.name, self.sentence


@dataclass(frozen=True, eq=False)
class ActIndex:
    """Acts by name and by what is said for them. of_caller: acts beside those that ship, which go before these."""

    of_caller: Mapping[str, KeyedAct] = field(default_factory=dict)

    @cached_property
    def sentences(self) -> Mapping[str, tuple[str, ...]]:
        """The name of each act, and each other text -> its sentences, in lower case and without marks."""
        sentences = dict(says())
        for name, act in self.of_caller.items():
            plain = (" ".join(NEW_MODEL_RULES.words(text)) for text in act.says)
            sentences[name] = tuple(filter(None, plain))
        return sentences

    def act(self, name: str) -> KeyedAct:
        """An act by its name; KeyError for an unknown one."""
        return self.of_caller[name] if name in self.of_caller else shipped(name)

    def is_of_caller(self, act: NamedAct | None) -> bool:
        """Whether an act is one of the caller's."""
        return act is not None and act.act.name in self.of_caller

    def named(self, words: Iterable[str], times: float | None = None) -> NamedAct | None:
        """The act that lower-case words name, None where there is none: all of them are words of its sentences, but for
        a side, and one of its sentences has no others. times: how often it is to be done, where the words say it."""
        words = list(words)
        stems = stems_of(words)
        if not stems - BOTH_SIDES <= self._stems:  # most sentences have a word that no act has
            return None
        of_sides = []
        for order in self._orders_in(words, stems):
            others = stems - self._stems_of_acts[order.name]
            # acts of one side are not those of the other
            if not others or (others <= BOTH_SIDES and self.act(order.name).mirrored):
                of_sides.append(order)
        if not of_sides:
            return None
        return self._adapted(max(of_sides, key=lambda order: order.fit(words)), stems, times)

    def within(self, words: Sequence[str], times: float | None = None) -> NamedAct | None:
        """The act of which a sentence, in lower-case words without its subject, has an order beside other words, the
        first of them its verb; that which leaves out the fewest of these. None where there is none."""
        stems = stems_of(words)
        # "gives a big thumbs up" has its act in the words after a verb that names none
        names_none = bool(words) and stem(words[0]) in FILLER_VERBS
        orders = list(self._orders_in(words, stems if names_none else stems_of(words[:1])))
        if not orders:
            return None
        lacking = {}
        for name in {order.name for order in orders}:
            of_act = self._stems_of_acts[name] | (BOTH_SIDES if self.act(name).mirrored else set())
            lacking[name] = tuple(word for word in words if stems_of([word]) - of_act)
        best = max(orders, key=lambda order: (-len(lacking[order.name]), *order.fit(words)))
        return replace(self._adapted(best, stems, times), lacking=lacking[best.name])

    def _orders_in(self, words: Sequence[str], stems: Iterable[str]) -> Iterator[Order]:
        """The orders with one of some stems whose words are all among some words."""
        of_words = stems_of(words)
        orders: dict[str, Order] = {}
        for a_stem in stems:
            orders |= {order.sentence: order for order in self._orders.get(a_stem, ())}
        for order in orders.values():
            if order.stems <= of_words and order.particles <= set(words):
                yield order

    def _adapted(self, order: Order, stems: frozenset[str], times: float | None) -> NamedAct:
        """The act of an order on the side that some stems name, as often as it is to be done."""
        act = self.act(order.name)
        count = int(times or 0)
        sides = stems & BOTH_SIDES - order.stems
        for side in sides:
            # point left is not to point with the left hand
            if len(sides) == 1 and f"{order.name} {side}" in self.sentences:
                return NamedAct(self.act(f"{order.name} {side}"), order.sentence, count)
        # acts of either hand are written for the right one
        if act.mirrored and len(sides) == 1:
            act = replace(act, keys=mirrored_keys(act.keys) if "left" in sides else act.keys, mirrored=False)
        if count and act.repeat:
            act = replace(act, repeat=replace(act.repeat, times=(count, count)))
        return NamedAct(act, order.sentence, count)

    def without_subject(self, words: Sequence[str]) -> list[str]:
        """Lower-case words without who acts and in which manner: of "the elf claps its hands happily" claps its hands.

        A subject has up to :data:`LONGEST_SUBJECT` words, before a verb that ends in -s or -ing; without an article
        none of them is a word of acts. A manner is an adverb that is neither a pace nor a word of acts.
        """
        of_acts = self._stems
        for count in range(1, min(LONGEST_SUBJECT, len(words) - 1) + 1):
            is_subject = words[0] in ARTICLES or stems_of(words[:count]).isdisjoint(of_acts)
            is_verb = stem(words[count]) in self.verbs | FILLER_VERBS and words[count].endswith(("s", "ing"))
            if is_subject and is_verb:
                words = words[count:]
                break
        return [word for word in words if not word.endswith("ly") or PACE_PHRASES.search(word) or stem(word) in of_acts]

    @cached_property
    def _stems(self) -> frozenset[str]:
        """The stems of all words of all acts."""
        return frozenset(self._orders)

    @cached_property
    def _stems_of_acts(self) -> Mapping[str, frozenset[str]]:
        """The stems of all words of each act."""
        stems: dict[str, frozenset[str]] = {}
        for order in chain.from_iterable(self._orders.values()):
            stems[order.name] = stems.get(order.name, frozenset()) | order.stems
        return stems

    @cached_property
    def verbs(self) -> frozenset[str]:
        """The stems of the first words of all orders, which say what is done."""
        first_words = [sentence.split()[0] for sentence in chain.from_iterable(self.sentences.values())]
        return stems_of(first_words) - BODY_STEMS

    @cached_property
    def _orders(self) -> Mapping[str, Sequence[Order]]:
        """The sentences of all acts by each of their stems."""
        orders: dict[str, list[Order]] = {}
        for name, sentences in self.sentences.items():
            for sentence in sentences:
                words = _words_of(sentence)
                particles = FUNCTION_WORDS.intersection(words) - ARTICLES
                order = Order(name, " ".join(words), stems_of(words), particles)
                for of_sentence in order.stems:
                    orders.setdefault(of_sentence, []).append(order)
        return orders


def _words_of(sentence: str) -> list[str]:
    """The words of an act's sentence, its numbers in digits, as sentences have them when they are read."""
    return [str(NUMBER_WORDS.get(word, word)) for word in sentence.split()]


SHIPPED_ACTS = ActIndex()
"""Those that ship, for all models."""
