"""What a motion shows, answered from known motions that are near it in a space of motions.

Sentences are not compared with each other: all wordings of one kind of action count together, and a sentence is as
good as the share of near motions that it would be right about (minimum Bayes risk, Kumar and Byrne 2004).
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.bundle.graph import Floats
from motet.errors import BundleError
from motet.models.base import BundleModel
from motet.motion.rotations import Array
from motet.representation.contract import MotionContract
from motet.settings import Range, Settings

NOTHING = "no human motion that it knows"
"""What is said of a motion that is like none of those that are known, or too short to tell."""

GOES_LEFT = 1
GOES_RIGHT = -1
GOES_STRAIGHT = 2
"""Where a sentence says that somebody goes; 0 if it does not say."""

TILE = 8192
"""Numbers of known vectors in a product with one vector: so few that OpenBLAS starts no threads, which would go on
turning for milliseconds after it, beside what comes next and beside other processes."""

BACKWARDS = re.compile("backward|in reverse|retreat")
"""What a sentence says that somebody goes backwards by."""


@dataclass(frozen=True)
class AnswerSettings(Settings):
    """How known motions answer. Training finds the last four (docs/describe.md).

    near: how many of the nearest motions count. temperature: a motion this much less similar counts e times less.
    turned, straight: from how many degrees on a path turns, and up to how many it is straight. backwards: mean speed
    from which a path leads backwards, which CMU's motions reach only where that is said of them. window, hop: of a
    timeline, as in :class:`motet.models.describe.TimelineSettings`. change: the cost of another action in it, where
    there are two windows a second, and as much more as there are more. shortest: what is shorter is not described.
    sure: least probability of a description that is trusted. outside: least similarity of the nearest motion; below it
    nothing is said. bias, share: of the logistic function that gives the probability, see :meth:`Known.probability`.
    """

    FEATURE: ClassVar[str] = "answer"
    near: Annotated[int, Range(1, 1000)] = 40
    temperature: Annotated[float, Range(0.001, 10)] = 0.07
    turned: Annotated[float, Range(0, 360, "degrees")] = 45.0
    straight: Annotated[float, Range(0, 360, "degrees")] = 25.0
    backwards: Annotated[float, Range(0, 100, "m/s")] = 0.2
    window: Annotated[float, Range(0.1, 30, "s")] = 1.0
    hop: Annotated[float, Range(0.1, 30, "s")] = 0.2
    change: Annotated[float, Range(0, 1000, "nats")] = 4.5
    shortest: Annotated[float, Range(0, 30, "s")] = 0.5
    sure: Annotated[float, Range(0, 1)] = 0.8
    outside: Annotated[float, Range(-1, 1)] = 0.0
    bias: Annotated[float, Range(-1000, 1000)] = 0.0
    share: Annotated[float, Range(-1000, 1000)] = 1.0


class Seen(NamedTuple):
    """What is known of a motion. vector: its place in the space (E,). seconds: its length. turn: of its path in
    degrees, to the left; None where it is not told. ahead: mean speed forward in m/s, 0 where it is not told."""

    vector: Floats
    seconds: float
    turn: float | None
    ahead: float = 0.0


class Answer(NamedTuple):
    """A sentence, and the probability that it is right."""

    text: str
    probability: float


@dataclass(frozen=True, eq=False)
class Known:
    """T known motions with A actions and S sentences, which name K kinds of action.

    vectors: (T, V, E) int8, V views of each motion, unit vectors times 127. actions: (T,) that of each motion.
    shown: (A, K) 2 where an action shows a kind, 1 where one may say so, else 0. sentences: S of them.
    sentence_actions: (S,) the action that each is about. names: (S, K) whether it names a kind. ways: (S, 3), where it
    says that somebody goes, the degrees that it gives, and whether it is about going and nothing else. All as in the
    bundle's tables.
    """

    vectors: NDArray[np.int8]
    actions: NDArray[np.int16]
    shown: NDArray[np.uint8]
    sentences: tuple[str, ...]
    sentence_actions: NDArray[np.int16]
    names: NDArray[np.uint8]
    ways: NDArray[np.int16]
    settings: AnswerSettings = AnswerSettings()

    @cached_property
    def _bank(self) -> Floats:
        """All vectors (B, T, E), view by view, in B tiles of T rows, the last filled up with zeros."""
        rows = self.vectors.transpose(1, 0, 2).reshape(-1, self.vectors.shape[-1])
        tile = max(1, TILE // rows.shape[1])
        bank = np.zeros((-(-len(rows) // tile) * tile, rows.shape[1]), dtype=np.float32)
        bank[: len(rows)] = rows / np.float32(127)
        return bank.reshape(-1, tile, rows.shape[1])

    @cached_property
    def _kinds(self) -> tuple[NDArray[np.uint8], NDArray[np.intp]]:
        """The Q different sets of kinds that sentences name (Q, K), and which of them each sentence names (S,)."""
        kinds, places = np.unique(self.names, axis=0, return_inverse=True)
        return kinds, places.reshape(-1)

    @property
    def sets(self) -> NDArray[np.uint8]:
        """The Q different sets of kinds that sentences name (Q, K)."""
        return self._kinds[0]

    @cached_property
    def _right(self) -> Array:
        """Which sets of kinds are right about which actions (A, Q): one is shown, and none is not to be said."""
        sets = self.sets.astype(np.int64)
        shows = (self.shown == 2).astype(np.int64) @ sets.T > 0
        wrong = (self.shown == 0).astype(np.int64) @ sets.T > 0
        right: Array = (shows & ~wrong).astype(np.float64)
        return right

    @cached_property
    def _named(self) -> Array:
        """Which sets of kinds sentences about which actions name (A, Q)."""
        names = np.zeros(self._right.shape)
        names[self.sentence_actions, self._kinds[1]] = 1
        return names

    def near(self, vectors: Floats) -> tuple[Array, Array]:
        """How much each action counts (N, A), 1 in all, by the motions near vectors (N, E); and the greatest
        similarity (N,)."""
        settings = self.settings
        similarities = self._similarities(vectors)
        best = similarities.max(axis=1, keepdims=True)
        count = min(settings.near, similarities.shape[1])
        least = np.partition(similarities, -count, axis=1)[:, -count, None]
        weights = np.exp((similarities - best) / settings.temperature)
        weights = np.where(similarities >= least, weights, 0.0)
        counted = np.zeros((len(vectors), len(self.shown)))
        np.add.at(counted.T, self.actions, weights.T)
        return counted / weights.sum(axis=1, keepdims=True), best[:, 0]

    def _similarities(self, vectors: Floats) -> Array:
        """Of vectors (N, E) with each motion, seen from the side from which they are most alike: (N, motions)."""
        motions, views = self.vectors.shape[:2]
        products = np.matmul(self._bank, vectors.T).reshape(-1, len(vectors))[: views * motions]
        similarities: Array = products.reshape(views, motions, -1).max(axis=0).T.astype(np.float64)
        return similarities

    def shares(self, counted: Array) -> Array:
        """Of each set of kinds (N, Q) the share of near motions that it is right about; 0 where none of them is said to
        show it."""
        near = np.flatnonzero(counted.any(axis=0))  # some 30 of all actions
        weights = counted[:, near]
        return np.where(weights @ self._named[near] > 0, weights @ self._right[near], 0.0)

    def answers(self, seen: Sequence[Seen], count: int = 1) -> list[list[Answer]]:
        """For each motion up to ``count`` sentences about different kinds of action, the likeliest first; one of
        :data:`NOTHING` where the motion is too short, or like none that is known."""
        settings = self.settings
        answers = list[list[Answer]]()
        for motion in seen:  # one by one, so that each gets the very bits that it gets alone
            counted, (similarity,) = self.near(motion.vector[None])
            (row,) = counted
            (share,) = self.shares(counted)
            # too short, or like nothing that is known
            if motion.seconds < settings.shortest or similarity < settings.outside:
                answers.append([Answer(NOTHING, 0.0)])
                continue
            # the likeliest kinds of action, and a sentence of a near motion for each
            best = [int(q) for q in np.argsort(-share, kind="stable")[:count] if share[q] > 0]
            chances = self.probability(share[best])
            sentences = [self._sentence(q, row, motion) for q in best]
            answers.append([Answer(text, float(chance)) for text, chance in zip(sentences, chances, strict=True)])
        return answers

    def probability(self, share: Array) -> Array:
        """How probable it is that sentences are right, of the ``share`` (N,) of near motions that each is right about.

        The nearest one's similarity and the length tell no more: their weights change sign from corpus to corpus.
        """
        score: Array = self.settings.bias + self.settings.share * log_odds(share)
        return 1 / (1 + np.exp(-score))

    def _sentence(self, kinds: int, counted: Array, seen: Seen) -> str:
        """The sentence that names a set of kinds: one whose way fits if there is any, and of these the one of the
        action that counts most. If it is about going, what it lacks of the way is added."""
        rows = np.flatnonzero((self._kinds[1] == kinds) & (counted[self.sentence_actions] > 0))
        fits, side = self._fits(rows, seen.turn)
        best = int(rows[np.lexsort((-counted[self.sentence_actions[rows]], -fits))[0]])
        text = self.sentences[best]
        way, _, going = self.ways[best]
        if going and seen.ahead <= -self.settings.backwards and not BACKWARDS.search(text):
            text += ", backwards"
        if going and side and way != side:
            text += f", turning {'left' if side == GOES_LEFT else 'right'}"
        return text

    def _fits(self, rows: NDArray[np.intp], turn: float | None) -> tuple[Array, int]:
        """How well the ways of sentences (N,) fit a path that turns by so many degrees, and its side, 0 for none."""
        fits = np.zeros(len(rows))
        if turn is None:
            return fits, 0
        side = GOES_LEFT if turn > 0 else GOES_RIGHT
        turned = abs(turn) >= self.settings.turned
        ways, degrees, _ = self.ways[rows].T
        # a clear turn: its side fits, the other side and straight ahead do not
        if turned:
            fits[ways == side] = 1
            fits[(ways == -side) | (ways == GOES_STRAIGHT)] = -1
        elif abs(turn) <= self.settings.straight:
            fits[ways == GOES_STRAIGHT] = 0.5
            fits[(ways == GOES_LEFT) | (ways == GOES_RIGHT)] = -1
        else:  # neither is certain, but the other side is wrong
            fits[ways == -side] = -1
        # a sentence that names degrees is wrong by more than 30
        fits[(degrees > 0) & (np.abs(degrees - abs(turn)) > 30)] = -1
        return fits, side if turned else 0


def log_odds(share: Array) -> Array:
    """The log-odds of shares, of .02 to .98."""
    kept = np.clip(share, 0.02, 0.98)
    odds: Array = np.log(kept / (1 - kept))
    return odds


def path_of(frames: Array, contract: MotionContract) -> tuple[float | None, float]:
    """By how many degrees a figure turns to the left in frames (T, D) of a contract, and its mean speed forward in m/s;
    None and 0 where the channels do not tell, or it does not stay upright."""
    at = {name: column for column, name in enumerate(contract.channels)}
    if not {"root.forward", "root.turn", "root.pitch", "root.roll"} <= at.keys():
        return None, 0.0
    factor = np.degrees(1.0) if contract.units[at["root.turn"]].startswith("rad") else 1.0
    leant = np.abs(frames[:, [at["root.pitch"], at["root.roll"]]]).max(initial=0) * factor
    if leant >= 70:
        return None, 0.0
    turned = float(frames[1:, at["root.turn"]].sum() / contract.fps * factor)
    return turned, float(frames[1:, at["root.forward"]].mean()) if len(frames) > 1 else 0.0


def known_of(model: BundleModel) -> Known:
    """The known motions of a model, from its tables; BundleError where one is missing or does not fit."""
    table = model.table
    text = table("known_sentences", "BYTES", "uint8").tobytes().decode("utf-8", "replace").split("\n")
    known = Known(
        table("known_vectors", "MOTIONS VIEWS E", "int8"),
        table("known_actions", "MOTIONS", "int16"),
        table("known_shown", "ACTIONS KINDS", "uint8"),
        tuple(text),
        table("known_said", "SENTENCES", "int16"),
        table("known_names", "SENTENCES KINDS", "uint8"),
        table("known_ways", "SENTENCES 3", "int16"),
        model.settings(AnswerSettings),
    )
    # numbers of actions are those of the table
    for name, rows in (("known_actions", known.actions), ("known_said", known.sentence_actions)):
        if not len(rows) or rows.min() < 0 or rows.max() >= len(known.shown):
            raise BundleError(f"manifest, tables: {name!r} has numbers that are none of {len(known.shown)} actions")
    count = len(known.sentence_actions)
    if len(text) != count or not known.vectors.size:
        raise BundleError(f"manifest, tables: 'known_sentences' has {len(text)} lines, expected {count}")
    return known
