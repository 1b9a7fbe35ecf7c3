"""Acts by key poses (:mod:`motet.keyed`) as generated motions: which sentences name one, and how it is laid over a
figure that stands, walks, or does anything else."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from motet.errors import TextError
from motet.keyed.acts import ACT_FPS, KeyedAct
from motet.keyed.keys import held_longer, mirrored_keys
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.text.clauses import FUNCTION_WORDS, Shown, stem
from motet.text.numeric_phrases import Kind, quantities_of

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


def stems_of(words: Iterable[str]) -> frozenset[str]:
    """The stems of words that name an act."""
    return frozenset(stem(word) for word in words if word not in FILLER_WORDS) - FILLER_VERBS
