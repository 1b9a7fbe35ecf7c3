"""Acts by key poses (:mod:`motet.keyed`) as generated motions: which sentences name one, and how it is laid over a
figure that stands."""

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from motet.keyed import KeyedAct, ours
from motet.keyed.acts import ACT_FPS
from motet.keyed.keys import mirrored_keys
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.clauses import FUNCTION_WORDS, Shown, stem
from motet.text.numeric_phrases import PACE_PHRASES

BASE_SENTENCES = {"stand": "a person stands still", "walk": "a person walks forward"}
"""The sentences of what they are laid over."""

WALKED_SECONDS = 4.0
"""How long an act that is laid over anything but a figure that stands lasts at least."""

TOGETHER = re.compile(r"\b(?:while|whilst|as (?:he|she|they|it)|with)\b")
"""Words between an act and what the figure does below it."""

FILLER_VERBS = frozenset(map(stem, ("does", "makes", "gives")))
"""Stems of verbs that name no act."""

FILLER_WORDS = (
    FUNCTION_WORDS
    | {"human", "humans", "subject", "subjects", "persons", "please"}
    | {
        *("across", "like", "quite", "really", "some", "through", "very"),
    }
)
"""Words that name no act; not their stems, as that of toes is to."""

BODY_STEMS = frozenset(map(stem, ("hand", "arm", "fist", "finger", "thumb", "head", "knee")))
"""Stems of words that orders may begin with, and that are no verbs: "hands on hips"."""

ARTICLES = frozenset(("a", "an", "the", "my", "our", "your"))

LONGEST_SUBJECT = 3
"""Words before a verb that may say who acts: "the old wizard"."""

MOST_HURRIED = 2.0
"""How many times as fast an act is played at most."""

BOTH_SIDES = frozenset(("left", "right"))


@dataclass(frozen=True)
class NamedAct:
    """An act as a sentence names it: on its side, and as often as it says. sentence: that of the act. is_counted:
    whether the sentence says how often. lacking: the words of the sentence that the act leaves out. below: the text of
    what the act is laid over, "" for what the act says itself."""

    act: KeyedAct
    sentence: str
    is_counted: bool = False
    lacking: tuple[str, ...] = ()
    below: str = ""

    @property
    def base(self) -> str:
        """The text of what the act is laid over."""
        return self.below or BASE_SENTENCES[self.act.over]

    @property
    def goes(self) -> bool:
        """Whether it is laid over anything but a figure that stands."""
        return self.base != BASE_SENTENCES["stand"]

    @property
    def is_of_upper_body(self) -> bool:
        """Whether hips and feet stay, so that the act can be laid over anything."""
        lower = {"hips", "left_foot", "right_foot"}
        return all(key.numbers.keys().isdisjoint(lower) for key in self.act.keys)

    @property
    def confidence(self) -> float:
        """The share of the words of both sentences that is not left out."""
        words = len(self.sentence.split())
        return words / (words + len(self.lacking))

    @property
    def shown(self) -> Shown:
        """How the sentence is shown."""
        return Shown(self.act.says[0], self.lacking, self.confidence)

    @property
    def is_small(self) -> bool:
        """Whether only head, trunk and shoulders move: codes of recordings lose movements as small."""
        small = {"head", "chest", "shoulders"}
        return all(key.numbers.keys() <= small and not key.hands for key in self.act.keys)

    def lasting(self, seconds: float, seed: int) -> "NamedAct":
        """The act repeated more often, if it can be and is shorter than some seconds, or played up to twice as fast, if
        it lasts longer."""
        shortfall = seconds - self.act.seconds(seed)
        if shortfall > 0 and self.act.repeat and not self.is_counted:
            times = self.act.repeat.times[0] + math.ceil(shortfall / self.act.repeat.every[0])
            return replace(self, act=replace(self.act, repeat=replace(self.act.repeat, times=(times, times))))
        faster = np.clip(self.act.seconds(seed) / max(seconds - 2 / ACT_FPS, 1 / ACT_FPS), 1, MOST_HURRIED)
        slowest, fastest = faster * np.array(self.act.speed)
        return replace(self, act=replace(self.act, speed=(slowest, fastest)))

    def laid_over(self, frames: Array, contract: MotionContract, seed: int) -> Array:
        """Frames (T, D) of a figure that stands, in the contract's channels, that do the act."""
        base = contract.motion(frames, plant=False)
        acted = self.act.motion(base, seed)
        shown = frames.copy()
        # what the act changes is added: the frames of a motion are not quite those that it was made of
        shown[: len(acted)] += contract.frames(acted) - contract.frames(base)[: len(acted)]
        return shown


def act_named(words: Iterable[str], times: float | None = None) -> NamedAct | None:
    """The act that lower-case words name, None where there is none: all of them are words of its sentences, but for a
    side, and one of its sentences has no others. times: how often it is to be done, where the words say it."""
    words = list(words)
    stems = stems_of(words)
    within = _sentences_within(stems)
    matches = [(len(order), name, sentence) for name, sentence, order in within if _has_particles(words, sentence)]
    if not matches:
        return None
    # the sentence that says the most of it
    _, name, sentence = max(matches)
    return _adapted(name, sentence, stems, times)


def act_within(words: Sequence[str], times: float | None = None) -> NamedAct | None:
    """The act of which a sentence, in lower-case words without its subject, has an order beside other words, the first
    of them its verb; that which leaves out the fewest of these. None where there is none."""
    stems = stems_of(words)
    nearest: NamedAct | None = None
    for name, sentences in _sentences().items():
        orders = []
        for sentence, order in sentences.items():
            has_verb = stems_of(words[:1]) and stems_of(words[:1]) <= order
            if has_verb and order <= stems and _has_particles(words, sentence):
                orders.append(sentence)
        if not orders:
            continue
        of_act = frozenset[str]().union(BOTH_SIDES, *sentences.values())
        lacking = tuple(word for word in words if stems_of([word]) - of_act)
        act = replace(_adapted(name, max(orders, key=len), stems, times), lacking=lacking)
        if nearest is None or act.confidence > nearest.confidence:
            nearest = act
    return nearest


def _has_particles(words: Iterable[str], sentence: str) -> bool:
    """Whether some words have the particles of an act's sentence: "put" is not "put up"."""
    return FUNCTION_WORDS.intersection(sentence.split()) - ARTICLES <= set(words)


def _adapted(name: str, sentence: str, stems: frozenset[str], times: float | None) -> NamedAct:
    """An act on the side that some stems name, as often as it is to be done."""
    act = ours()[name]
    # acts of either hand are written for the right one
    sides = stems & BOTH_SIDES - stems_of(sentence.split())
    if act.mirrored and len(sides) == 1:
        act = replace(act, keys=mirrored_keys(act.keys) if "left" in sides else act.keys, mirrored=False)
    if times is not None and act.repeat is not None:
        act = replace(act, repeat=replace(act.repeat, times=(int(times),) * 2))
    return NamedAct(act, sentence, times is not None)


def _sentences_within(stems: frozenset[str]) -> Iterator[tuple[str, str, frozenset[str]]]:
    """The acts that have all of some stems, but for a side, by name; each with its sentences that have no others, and
    their stems."""
    for name, sentences in _sentences().items():
        sides = stems & BOTH_SIDES if ours()[name].mirrored else frozenset()
        if not stems - sides <= frozenset[str]().union(*sentences.values()):
            continue
        for sentence, of_sentence in sentences.items():
            if of_sentence and of_sentence <= stems:
                yield name, sentence, of_sentence


def without_subject(words: Sequence[str]) -> list[str]:
    """Lower-case words without who acts and in which manner: of "the elf claps its hands happily" claps its hands.

    A subject has up to :data:`LONGEST_SUBJECT` words, before the verb of an act in the third person; without an article
    none of them is a word of acts. A manner is an adverb that is neither a pace nor a word of acts.
    """
    of_acts = _stems_of_acts()
    kept = list(words)
    for count in range(1, min(LONGEST_SUBJECT, len(words) - 1) + 1):
        is_subject = words[0] in ARTICLES or stems_of(words[:count]).isdisjoint(of_acts)
        if is_subject and stem(words[count]) in verbs() and words[count].endswith("s"):
            kept = kept[count:]
            break
    return [word for word in kept if not word.endswith("ly") or PACE_PHRASES.search(word) or stem(word) in of_acts]


@cache
def _stems_of_acts() -> frozenset[str]:
    """The stems of all words of all acts."""
    of_acts = set[str]()
    for sentences in _sentences().values():
        of_acts.update(*sentences.values())
    return frozenset(of_acts)


def stems_of(words: Iterable[str]) -> frozenset[str]:
    """The stems of words that name an act."""
    return frozenset(stem(word) for word in words if word not in FILLER_WORDS) - FILLER_VERBS


@cache
def verbs() -> frozenset[str]:
    """The stems of the first words of all orders, which say what is done."""
    first_words = []
    for act in ours().values():
        first_words += [sentence.split()[0] for sentence in act.says]
    return stems_of(first_words) - BODY_STEMS


@cache
def _sentences() -> Mapping[str, Mapping[str, frozenset[str]]]:
    """The stems of each sentence of each act."""
    table = {}
    for name, act in ours().items():
        table[name] = {sentence: stems_of(sentence.split()) for sentence in act.says}
    return table
