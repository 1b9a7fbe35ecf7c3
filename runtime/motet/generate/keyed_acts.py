"""Acts by key poses (:mod:`motet.keyed`) as generated motions: which sentences name one, and how it is laid over a
figure that stands, walks, or does anything else."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import chain
from typing import NamedTuple

import numpy as np

from motet.errors import TextError
from motet.keyed.acts import ACT_FPS, KeyedAct
from motet.keyed.keys import held_longer, mirrored_keys
from motet.keyed.shipped import says, shipped
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.clauses import FUNCTION_WORDS, Shown, stem
from motet.text.numeric_phrases import PACE_PHRASES, Kind, quantities_of
from motet.text.vocabulary import NUMBER_WORDS

STANDS = "a person stands still"
"""The sentence of a figure that stands."""

LOW_HIPS = 0.7
"""Metres of the hips of a figure that sits, kneels or lies, whose standing hips are about 0.95 m high."""

RESTS = {STANDS: LOW_HIPS, "a person waits": LOW_HIPS, "a person lies down": 0.35}
"""Sentence -> metres of the hips below which nothing is to be done for it: who sits waits, and who lies lies."""

STAYS = "stay as you are"
"""The act of a figure that does nothing, sitting, kneeling or lying."""

BASE_SENTENCES = {"stand": STANDS, "walk": "a person walks forward"}
"""The sentences of what acts are laid over."""

WALKED_SECONDS = 4.0
"""How long an act that is laid over anything but a figure that stands lasts at least."""

TOGETHER = re.compile(
    r"\b(?:while|whilst|as (?:he|she|they|it)|with)\b|(?<!\bis)(?<!\bthe)(?<!\ba),? (?=[a-z]+(?<!th)ing\b)"
)
"""Words between an act and what the figure does below it; a participle needs none: "walks backwards, waving"."""

FILLER_VERBS = frozenset(map(stem, ("does", "makes", "gives", "has", "have")))
"""Stems of verbs that name no act."""

# fmt: off
FILLER_WORDS = (FUNCTION_WORDS - {"up"}) | {
    "across", "human", "humans", "like", "persons", "please", "quite", "really", "some", "subject", "subjects",
    "through", "very",
}
# fmt: on
"""Words that name no act; not their stems, as that of toes is to."""

BODY_STEMS = frozenset(map(stem, ("hand", "arm", "fist", "finger", "thumb", "head", "knee")))
"""Stems of words that orders may begin with, and that are no verbs: "hands on hips"."""

LIMB_STEMS = BODY_STEMS | frozenset(map(stem, ("leg", "foot", "feet", "elbow", "shoulder")))
"""Stems of words for what an act moves: a recording that moves more shows more."""

HELD = re.compile(r",? and holds?(?: (?:it|that|still|there|the pose|the position|this))?$")
"""Words of a sentence that says how long its last pose stays."""

HAND_NAMED = re.compile(r" ?\b(?:with|in|using) (?:the |your |his |her |their |my |its )?(left|right) (?:hand|arm)\b")
"""The hand that an act is done with."""

STANDING = re.compile(r"standing(?: up| still| there)?")
"""What a figure does below an act that need not be said."""

ARTICLES = frozenset(("a", "an", "the", "my", "our", "your"))

LONGEST_SUBJECT = 3
"""Words before a verb that may say who acts: "the old wizard"."""

MOST_HURRIED = 2.0
"""How many times as fast an act is played at most."""

LEGS = ("hips", "left_foot", "right_foot")
"""The parts by which an act by key poses moves the legs."""

BOTH_SIDES = frozenset(("left", "right"))


@dataclass(frozen=True)
class NamedAct:
    """An act as a sentence names it: on its side, and as often and as long as it says. sentence: that of the act.
    times, seconds: how often and how long the sentence says, 0 if it does not. lacking: the words of the sentence that
    the act leaves out. below: the text of what the act is laid over, "" for what the act says itself. legs: another
    act that is done at the same time, below it."""

    act: KeyedAct
    sentence: str
    times: int = 0
    lacking: tuple[str, ...] = ()
    below: str = ""
    seconds: float = 0.0
    legs: "NamedAct | None" = None

    @property
    def base(self) -> str:
        """The text of what the act is laid over."""
        if self.legs is not None:
            return self.legs.base
        return self.below or BASE_SENTENCES.get(self.act.over, self.act.over)

    @property
    def pace(self) -> float:
        """How fast what it is laid over is played."""
        return self.legs.pace if self.legs is not None else self.act.pace

    @property
    def is_other_text(self) -> bool:
        """Whether it is no act by key poses, but a text that is shown instead."""
        return not self.act.keys

    @property
    def goes(self) -> bool:
        """Whether it is laid over anything but a figure that stands."""
        return self.base != STANDS

    def leaves(self, *parts: str) -> bool:
        """Whether parts of the body are as below. If these are hips and feet, the act can be laid over anything; if
        these are the hips, over who sits, kneels or lies."""
        return not self.goes and all(key.numbers.keys().isdisjoint(parts) for key in self.act.keys)

    @property
    def confidence(self) -> float:
        """The share of the words of both sentences that is not left out."""
        words = len(self.sentence.split())
        return words / (words + len(self.lacking))

    @property
    def shown(self) -> Shown:
        """How the sentence is shown."""
        name = self.act.says[0] if self.legs is None else f"{self.act.says[0]}, {self.legs.act.says[0]}"
        return Shown(name, self.lacking, self.confidence)

    @property
    def is_small(self) -> bool:
        """Whether only head, trunk and shoulders move: codes of recordings lose movements as small."""
        small = {"head", "chest", "shoulders"}
        return all(key.numbers.keys() <= small and not key.hands for key in self.act.keys)

    def with_hand(self, side: str) -> "NamedAct":
        """The act, one of either hand, done with the hand of a side."""
        keys = mirrored_keys(self.act.keys) if side == "left" else self.act.keys
        return replace(self, act=replace(self.act, keys=keys, mirrored=False))

    def at_pace(self, pace: float) -> "NamedAct":
        """The act played a factor faster."""
        slowest, fastest = self.act.speed
        return replace(self, act=replace(self.act, speed=(pace * slowest, pace * fastest)))

    def lasting(self, seconds: float, seed: int) -> "NamedAct":
        """The act repeated more often, if it can be and is shorter than some seconds, or with its longest pose held
        longer, if it cannot; or played up to twice as fast, if it lasts longer. seconds: 0 for its usual length."""
        usual = self.act.seconds(seed)
        if seconds > usual and self.act.repeat is None:
            return replace(self, act=replace(self.act, keys=held_longer(self.act.keys, seconds - usual)))
        seconds = seconds or max(usual, WALKED_SECONDS if self.goes else 0.0)
        if seconds > usual and self.act.repeat and not self.times:
            return replace(self, act=replace(self.act, repeat=self.act.repeat.longer(seconds - usual)))
        faster = np.clip(usual / max(seconds - 2 / ACT_FPS, 1 / ACT_FPS), 1, MOST_HURRIED)
        slowest, fastest = faster * np.array(self.act.speed)
        return replace(self, act=replace(self.act, speed=(slowest, fastest)))

    def laid_over(self, frames: Array, contract: MotionContract, seed: int) -> Array:
        """Frames (T, D) of what is below the act, in the contract's channels, that do the act, too."""
        if self.legs is not None:
            seconds = len(frames) / contract.fps
            legs = self.legs.lasting(seconds, seed)
            if legs.act.seconds(seed) > seconds:  # repeated once too often
                legs = legs.lasting(seconds, seed)
            frames = legs.laid_over(frames, contract, seed)
        base = contract.motion(frames, plant=False)
        acted = self.act.motion(base, seed, strict=False)
        shown = frames.copy()
        # what the act changes is added: the frames of a motion are not quite those that it was made of
        shown[: len(acted)] += contract.frames(acted) - contract.frames(base)[: len(acted)]
        return shown


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


def act_named(words: Iterable[str], times: float | None = None) -> NamedAct | None:
    """The act that lower-case words name, None where there is none: all of them are words of its sentences, but for a
    side, and one of its sentences has no others. times: how often it is to be done, where the words say it."""
    words = list(words)
    stems = stems_of(words)
    if not stems - BOTH_SIDES <= _stems_of_acts():  # most sentences have a word that no act has
        return None
    orders = [order for order in _orders_in(words, stems) if not stems - _stems_of_act(order.name) - BOTH_SIDES]
    # acts of one side are not those of the other
    of_sides = [order for order in orders if stems <= _stems_of_act(order.name) or shipped(order.name).mirrored]
    if not of_sides:
        return None
    return _adapted(max(of_sides, key=lambda order: order.fit(words)), stems, times)


def act_within(words: Sequence[str], times: float | None = None) -> NamedAct | None:
    """The act of which a sentence, in lower-case words without its subject, has an order beside other words, the first
    of them its verb; that which leaves out the fewest of these. None where there is none."""
    stems = stems_of(words)
    # "gives a big thumbs up" has its act in the words after a verb that names none
    names_none = bool(words) and stem(words[0]) in FILLER_VERBS
    orders = list(_orders_in(words, stems if names_none else stems_of(words[:1])))
    if not orders:
        return None
    lacking = {}
    for name in {order.name for order in orders}:
        of_act = _stems_of_act(name) | (BOTH_SIDES if shipped(name).mirrored else set())
        lacking[name] = tuple(word for word in words if stems_of([word]) - of_act)
    best = max(orders, key=lambda order: (-len(lacking[order.name]), *order.fit(words)))
    return replace(_adapted(best, stems, times), lacking=lacking[best.name])


def _orders_in(words: Sequence[str], stems: Iterable[str]) -> Iterator[Order]:
    """The orders with one of some stems whose words are all among some words."""
    of_words = stems_of(words)
    orders: dict[str, Order] = {}
    for a_stem in stems:
        orders |= {order.sentence: order for order in _orders().get(a_stem, ())}
    for order in orders.values():
        if order.stems <= of_words and order.particles <= set(words):
            yield order


def _adapted(order: Order, stems: frozenset[str], times: float | None) -> NamedAct:
    """The act of an order on the side that some stems name, as often as it is to be done."""
    act = shipped(order.name)
    count = int(times or 0)
    sides = stems & BOTH_SIDES - order.stems
    for side in sides:
        if len(sides) == 1 and f"{order.name} {side}" in says():  # point left is not to point with the left hand
            return NamedAct(shipped(f"{order.name} {side}"), order.sentence, count)
    # acts of either hand are written for the right one
    if act.mirrored and len(sides) == 1:
        act = replace(act, keys=mirrored_keys(act.keys) if "left" in sides else act.keys, mirrored=False)
    if count and act.repeat:
        act = replace(act, repeat=replace(act.repeat, times=(count, count)))
    return NamedAct(act, order.sentence, count)


def counted(sentence: str) -> tuple[str, Mapping[Kind, float]]:
    """A sentence without how often and how long it says that something is done, and these numbers, "times" and
    "seconds"; itself and none where it says neither, or another number, too."""
    try:
        quantities = quantities_of(sentence)
    except TextError:  # it is said when the sentence is read
        return sentence, {}
    if quantities.amounts and quantities.amounts.keys() <= {"times", "seconds"}:
        return quantities.text, quantities.amounts
    return sentence, {}


def without_subject(words: Sequence[str]) -> list[str]:
    """Lower-case words without who acts and in which manner: of "the elf claps its hands happily" claps its hands.

    A subject has up to :data:`LONGEST_SUBJECT` words, before a verb that ends in -s or -ing; without an article none of
    them is a word of acts. A manner is an adverb that is neither a pace nor a word of acts.
    """
    of_acts = _stems_of_acts()
    for count in range(1, min(LONGEST_SUBJECT, len(words) - 1) + 1):
        is_subject = words[0] in ARTICLES or stems_of(words[:count]).isdisjoint(of_acts)
        is_verb = stem(words[count]) in verbs() | FILLER_VERBS and words[count].endswith(("s", "ing"))
        if is_subject and is_verb:
            words = words[count:]
            break
    return [word for word in words if not word.endswith("ly") or PACE_PHRASES.search(word) or stem(word) in of_acts]


@cache
def _stems_of_acts() -> frozenset[str]:
    """The stems of all words of all acts."""
    return frozenset(_orders())


@cache
def _stems_of_act(name: str) -> frozenset[str]:
    """The stems of all words of an act."""
    return frozenset[str]().union(*map(stems_of, map(_words_of, says()[name])))


def _words_of(sentence: str) -> list[str]:
    """The words of an act's sentence, its numbers in digits, as sentences have them when they are read."""
    return [str(NUMBER_WORDS.get(word, word)) for word in sentence.split()]


def stems_of(words: Iterable[str]) -> frozenset[str]:
    """The stems of words that name an act."""
    return frozenset(stem(word) for word in words if word not in FILLER_WORDS) - FILLER_VERBS


@cache
def verbs() -> frozenset[str]:
    """The stems of the first words of all orders, which say what is done."""
    first_words = [sentence.split()[0] for sentence in chain.from_iterable(says().values())]
    return stems_of(first_words) - BODY_STEMS


@cache
def _orders() -> Mapping[str, Sequence[Order]]:
    """The sentences of all acts by each of their stems."""
    orders: dict[str, list[Order]] = {}
    for name, sentences in says().items():
        for sentence in sentences:
            words = _words_of(sentence)
            particles = FUNCTION_WORDS.intersection(words) - ARTICLES
            order = Order(name, " ".join(words), stems_of(words), particles)
            for of_sentence in order.stems:
                orders.setdefault(of_sentence, []).append(order)
    return orders
