"""Acts by key poses (:mod:`motet.keyed`) as generated motions: which sentences name one, and how it is laid over a
figure that stands."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from motet.keyed import KeyedAct, ours
from motet.keyed.acts import ACT_FPS
from motet.keyed.keys import mirrored_keys
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.clauses import FUNCTION_WORDS, stem
from motet.text.numeric_phrases import PACE_PHRASES

BASE_SENTENCE = "a person stands still"
"""The sentence of what they are laid over."""

FILLER_VERBS = frozenset(map(stem, ("does", "makes", "gives")))
"""Stems of verbs that name no act."""

FILLER_WORDS = FUNCTION_WORDS | {"human", "humans", "subject", "subjects", "persons", "please"}
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
    whether the sentence says how often."""

    act: KeyedAct
    sentence: str
    is_counted: bool = False

    @property
    def is_small(self) -> bool:
        """Whether only head, trunk and shoulders move: codes of recordings lose movements as small."""
        small = {"head", "chest", "shoulders"}
        return all(key.numbers.keys() <= small and not key.hands for key in self.act.keys)

    def within(self, seconds: float, seed: int) -> "NamedAct":
        """The act played up to twice as fast, if it lasts longer than some seconds."""
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
    stems = stems_of(words)
    matches = list(_sentences_within(stems))
    if not matches:
        return None
    # the sentence that says the most of it
    _, name, sentence = max(matches)
    act = ours()[name]
    # acts of either hand are written for the right one
    sides = stems & BOTH_SIDES - stems_of(sentence.split())
    if act.mirrored and len(sides) == 1:
        act = replace(act, keys=mirrored_keys(act.keys) if "left" in sides else act.keys, mirrored=False)
    if times is not None and act.repeat is not None:
        act = replace(act, repeat=replace(act.repeat, times=(int(times),) * 2))
    return NamedAct(act, sentence, times is not None)


def _sentences_within(stems: frozenset[str]) -> Iterator[tuple[int, str, str]]:
    """Of the acts that have all of some stems, but for a side, the sentences that have no others: how many stems each
    has, the act's name and the sentence."""
    if not stems - BOTH_SIDES <= _stems_of_acts():  # most sentences have a word that no act has
        return
    for name, sentences in _sentences().items():
        sides = stems & BOTH_SIDES if ours()[name].mirrored else frozenset()
        if not stems - sides <= _stems_of_act(name):
            continue
        for sentence, of_sentence in sentences.items():
            if of_sentence and of_sentence <= stems:
                yield len(of_sentence), name, sentence


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
    return frozenset[str]().union(*map(_stems_of_act, _sentences()))


@cache
def _stems_of_act(name: str) -> frozenset[str]:
    """The stems of all words of an act."""
    return frozenset[str]().union(*_sentences()[name].values())


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
