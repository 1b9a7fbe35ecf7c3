"""Whether a describe model knows when it is right, and when another action begins, on validation motions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import NamedTuple

import numpy as np

from motet.models.describe import ConfidenceSettings, DescribeModel, Description, Part
from motet.motion.motion import Motion
from motet.motion.rotations import Array, Mask
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_train.evaluate.language.attributes import ACTIONS, action_right, common, mentioned
from motet_train.evaluate.language.split_store import SplitStore
from motet_train.evaluate.tables import Figures

ENOUGH = 20
"""Descriptions needed to choose a limit."""

TIMELINES = 60
"""Timelines that are measured."""

CHAIN = 3
"""Motions of a timeline."""


def confidence(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> Figures:
    """The shares of the best descriptions of some records (``of``) that are right, and confident.

    "right_if_confident", "right_if_not": the shares of confident and of other ones that are right. "kept": the share of
    right ones that are confident. "auc": how often a right one is more probable than a wrong one; "auc_word": the same
    by the mean over its words. See :func:`motet_train.evaluate.language.attributes.action_right` for right. NaN for a
    share of nothing.
    """
    descriptions, right = judged(model, corpus, records)
    sure = np.array([description.confident for description in descriptions])
    scores = np.array([description.log_probability for description in descriptions])
    words = [len(NEW_MODEL_RULES.words(description.text)) + 1 for description in descriptions]  # with the end
    return {
        "of": float(len(descriptions)),
        "right": share(right),
        "confident": share(sure),
        "right_if_confident": share(right[sure]),
        "right_if_not": share(right[~sure]),
        "kept": share(sure[right]),
        "auc": _auc(scores, right),
        "auc_word": _auc(scores / np.array(words), right),
    }


def judged(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> tuple[list[Description], Mask]:
    """The best description of each record, and whether it is right."""
    descriptions = [row[0] for row in model.describe(corpus.motions(records))]
    right = []
    for description, sentences in zip(descriptions, corpus.references(records), strict=True):
        right.append(action_right(description.text, sentences))
    return descriptions, np.array(right, dtype=np.bool_)


def calibrated(scores: Array, right: Mask) -> ConfidenceSettings:
    """The limit that is right most often, with right descriptions at or above it and wrong ones below.

    scores: (N,) log-probabilities. The limit lies half-way between two of them; of equally good limits it is the
    lowest. With fewer than :data:`ENOUGH` descriptions it is the default.
    """
    if len(scores) < ENOUGH:
        return ConfidenceSettings()
    # by how much each description above the limit improves the count of correct decisions
    order = np.argsort(scores, kind="stable")
    gains = np.where(right[order], 1, -1)
    gains_above = np.append(np.cumsum(gains[::-1])[::-1], 0)

    # between the last rejected and the first accepted one
    best = int(gains_above.argmax())
    bounds = [2 * scores[order[0]], *scores[order], 0.0]
    limit = float(bounds[best] + bounds[best + 1]) / 2
    return ConfidenceSettings(max(-1000.0, limit))


class Moment(NamedTuple):
    """A moment of a timeline: the record that goes on, and the part of the described timeline there."""

    record: int
    part: Part


class Timelines(NamedTuple):
    """Described timelines. joins_found: how many joins have a cut. cuts: of all timelines. moments: every tenth of a
    second."""

    joins_found: int
    cuts: int
    moments: list[Moment]

    def cut_shares(self, count: int) -> Figures:
        """The shares of joins in ``count`` timelines with a cut, and of cuts with a join."""
        return {
            "joins_found": self.joins_found / (count * (CHAIN - 1)),
            "cuts_right": self.joins_found / self.cuts if self.cuts else np.nan,
        }


def timelines_of(model: DescribeModel, corpus: SplitStore, chains: Iterable[Sequence[int]], within: float) -> Timelines:
    """Describe chains of records as timelines. within: seconds between a join and a cut that finds it."""
    joins_found = 0
    cuts = 0
    moments = []
    for chain in chains:
        motions = corpus.motions(chain)
        parts = model.timeline(joined(motions))
        # joins that cuts have found
        ends = np.cumsum([motion.duration for motion in motions])
        joins_found += matched(ends[:-1].tolist(), [part.start for part in parts[1:]], within)
        cuts += len(parts) - 1

        # what goes on in every tenth of a second, and what is said about it
        for time in np.arange(0.05, ends[-1], 0.1):
            place = min(int(np.searchsorted(ends, time)), len(chain) - 1)
            part = next((part for part in parts if time < part.stop), parts[-1])
            moments.append(Moment(chain[place], part))
    return Timelines(joins_found, cuts, moments)


def timeline_figures(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> Figures:
    """Figures of :data:`TIMELINES`, three motions of 2 to 12 s joined at random, neighbours of different actions.

    "joins_found", "cuts_right": the shares of joins with a cut within a second, and of cuts with a join. "parts": how
    many a timeline has. "time_right": the share of time with a right description
    (:func:`motet_train.evaluate.language.attributes.action_right`); "time_confident", "time_right_if_confident": the
    same by confident parts. "alone_right": the share of the same motions that are described correctly alone. Empty if
    no two motions differ.
    """
    others = _others(corpus, records)
    if not others:
        return {}
    # described as timelines, and each motion alone
    random = np.random.default_rng(0)
    chains = [_chain(others, random) for _ in range(TIMELINES)]
    timelines = timelines_of(model, corpus, chains, within=1.0)
    right = np.array([action_right(part.text, corpus.sentences(record)) for record, part in timelines.moments])
    sure = np.array([part.confident for _, part in timelines.moments])
    alone = np.concatenate([judged(model, corpus, chain)[1] for chain in chains])
    return {
        **timelines.cut_shares(TIMELINES),
        "parts": timelines.cuts / TIMELINES + 1,
        "time_right": share(right),
        "time_confident": share(sure),
        "time_right_if_confident": share(right[sure]),
        "alone_right": share(alone),
    }


def fits_timeline(motion: Motion) -> bool:
    """Whether a motion is long and short enough for a timeline: 2 to 12 s."""
    return 2.0 <= motion.duration <= 12.0


def _others(corpus: SplitStore, records: Sequence[int]) -> Mapping[int, Sequence[tuple[str, int]]]:
    """For each record the records of other actions, once for each of their actions, with the action."""
    # the actions in any sentence about a record, and those that half of its sentences agree on
    mentioned_actions: dict[int, frozenset[str]] = {}
    agreed_actions: dict[int, frozenset[str]] = {}
    for record in records:
        actions = [mentioned(ACTIONS, sentence) for sentence in corpus.sentences(record)]
        mentioned_actions[record] = frozenset().union(*actions)
        if fits_timeline(corpus.motion(record)):
            agreed_actions[record] = common(actions)

    # neighbours differ if no sentence about one mentions what people agree on in the other
    others = {}
    for record, agreed in agreed_actions.items():
        rest = []
        for other, other_agreed in agreed_actions.items():
            clear = agreed.isdisjoint(mentioned_actions[other])
            if clear and other_agreed.isdisjoint(mentioned_actions[record]):
                rest += [(action, other) for action in sorted(other_agreed)]
        if agreed and rest:
            others[record] = rest
    return others


def _chain(others: Mapping[int, Sequence[tuple[str, int]]], random: np.random.Generator) -> list[int]:
    """Three records in a row: each action is drawn before its motion, so that rare ones are as frequent."""
    chain = [int(random.choice(list(others)))]
    while len(chain) < CHAIN:
        # one of the actions that differ from the last motion's, then a motion of it
        candidates = others[chain[-1]]
        actions = sorted({action for action, _ in candidates})
        drawn = actions[random.integers(len(actions))]
        chain.append(int(random.choice([record for action, record in candidates if action == drawn])))
    return chain


def joined(motions: Sequence[Motion]) -> Motion:
    """Features of motions in a row; the pose jumps between them, and the path continues since it is in rates."""
    return replace(motions[0], values=np.concatenate([motion.values for motion in motions]))


def matched(joins: Sequence[float], cuts: Sequence[float], within: float = 1.0) -> int:
    """How many joins have a cut of their own within a time in seconds, matched nearest first."""
    # the nearest pairs first, each join and cut once
    pairs = sorted((abs(join - cut), join, cut) for join, cut in product(joins, cuts))
    free_joins = set(joins)
    free_cuts = set(cuts)
    for distance, join, cut in pairs:
        if distance <= within + 1e-9 and join in free_joins and cut in free_cuts:
            free_joins.remove(join)
            free_cuts.remove(cut)
    return len(joins) - len(free_joins)


def share(truths: Mask) -> float:
    """The share of true flags, NaN without any flags."""
    return truths.mean() if len(truths) else np.nan


def _auc(scores: Array, right: Mask) -> float:
    """How often the score of a right description is above that of a wrong one; equal ones count half."""
    from sklearn.metrics import roc_auc_score  # imported here, so that training does not load it

    return float(roc_auc_score(right, scores)) if right.any() and not right.all() else np.nan
