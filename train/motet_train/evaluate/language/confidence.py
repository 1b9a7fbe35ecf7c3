"""Whether a describe model knows when it is right, and when something else begins, on validation motions."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from motet.models.describe import ConfidenceSettings, DescribeModel, Description
from motet.models.language import RULES
from motet.motion.motion import Motion
from motet_train.evaluate.language.attributes import ACTIONS, action_right, common, said
from motet_train.evaluate.language.split_store import SplitStore

ENOUGH = 20
"""Descriptions by which a limit is chosen at least."""

Truths = NDArray[np.bool_]


def confidence(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> dict[str, float]:
    """Of the best descriptions of some records (``of``): the shares that are right, and confident.

    "right_if_confident", "right_if_not": the shares that are right of those two. "kept": the share of right ones that
    are confident. "auc": how often a right one is more probable than a wrong one; "auc_word": by the mean of its words.
    Right is what names an action, and none that nobody named
    (:func:`motet_train.evaluate.language.attributes.action_right`). NaN where there are none.
    """
    found, right = judged(model, corpus, records)
    sure = np.array([one.confident for one in found])
    scores = np.array([one.log_probability for one in found])
    words = np.array([len(RULES.words(one.text)) + 1 for one in found])  # with the end
    return {
        "of": float(len(found)),
        "right": _share(right),
        "confident": _share(sure),
        "right_if_confident": _share(right[sure]),
        "right_if_not": _share(right[~sure]),
        "kept": _share(sure[right]),
        "auc": _auc(scores, right),
        "auc_word": _auc(scores / words, right),
    }


def judged(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> tuple[list[Description], Truths]:
    """The best description of each record, and whether it is right."""
    found = [row[0] for row in model.describe(corpus.motions(records))]
    pairs = zip(found, corpus.references(records), strict=True)
    return found, np.array([action_right(one.text, sentences) for one, sentences in pairs], dtype=np.bool_)


def calibrated(scores: NDArray[np.float64], right: Truths) -> ConfidenceSettings:
    """The limit that is most often right: right descriptions are at or above it, and wrong ones below.

    scores: (N,) log-probabilities. Between two of them the limit is half-way; of equally good limits it is the lowest.
    With less than :data:`ENOUGH` descriptions it is the default.
    """
    if len(scores) < ENOUGH:
        return ConfidenceSettings()
    order = np.argsort(scores, kind="stable")
    believed = np.where(right[order], 1, -1)  # what each adds to the number of those told correctly
    start = int(np.append(np.cumsum(believed[::-1])[::-1], 0).argmax())
    ends = [2 * scores[order[0]], *scores[order], 0.0]
    return ConfidenceSettings(max(-1000.0, float(ends[start] + ends[start + 1]) / 2))


def timeline_figures(
    model: DescribeModel, corpus: SplitStore, records: Sequence[int], seed: int = 0, count: int = 60
) -> dict[str, float]:
    """Of ``count`` timelines, three motions of 2 to 12 s, joined at random, neighbours of different actions: which
    joins are found, and what is said rightly.

    "joins_found", "cuts_right": the shares of joins that have a cut within a second, and of cuts that have a join.
    "parts": how many a timeline has. "time_right": the share of time at which an action is named that people named of
    what goes on, and no other; "time_confident", "time_right_if_confident": of parts that are confident.
    "alone_right": of the same motions, each described alone. Nothing where no motions differ.
    """
    others, random = _others(corpus, records), np.random.default_rng(seed)
    found, cuts, right, sure, alone = 0, 0, list[bool](), list[bool](), list[bool]()
    for _ in range(count if others else 0):
        chain = _chain(others, random)
        motions, references = corpus.motions(chain), corpus.references(chain)
        parts = model.timeline(joined(motions))
        ends = np.cumsum([motion.duration for motion in motions])
        found += matched(ends[:-1].tolist(), [part.start for part in parts[1:]])
        cuts += len(parts) - 1
        for moment in np.arange(0.05, ends[-1], 0.1):
            part = next((part for part in parts if moment < part.stop), parts[-1])
            place = min(int(np.searchsorted(ends, moment)), len(chain) - 1)
            right.append(action_right(part.text, references[place]))
            sure.append(part.confident)
        alone += judged(model, corpus, chain)[1].tolist()
    if not others:
        return {}
    return {
        "joins_found": found / (count * 2),
        "cuts_right": found / cuts if cuts else np.nan,
        "parts": cuts / count + 1,
        "time_right": _share(np.array(right)),
        "time_confident": _share(np.array(sure)),
        "time_right_if_confident": _share(np.array(right)[sure]),
        "alone_right": _share(np.array(alone)),
    }


def _others(corpus: SplitStore, records: Sequence[int]) -> Mapping[int, Sequence[tuple[str, int]]]:
    """For each record the records of other actions, each as often as it has actions, with the action."""
    named = {record: [said(ACTIONS, sentence) for sentence in corpus.sentences(record)] for record in records}
    agreed = {record: common(found) for record, found in named.items() if 2.0 <= corpus.motion(record).duration <= 12.0}
    anyone = {record: frozenset().union(*found) for record, found in named.items()}
    found = {
        one: [
            (action, two)
            for two in agreed
            if agreed[one].isdisjoint(anyone[two]) and agreed[two].isdisjoint(anyone[one])
            for action in sorted(agreed[two])
        ]
        for one in agreed
        if agreed[one]
    }
    return {record: rest for record, rest in found.items() if rest}


def _chain(others: Mapping[int, Sequence[tuple[str, int]]], random: np.random.Generator) -> list[int]:
    """Three records one after the other: first the action is drawn, so that rare ones come as often, then the
    motion."""
    chain = [int(random.choice(list(others)))]
    while len(chain) < 3:
        actions = sorted({action for action, _ in others[chain[-1]]})
        chosen = actions[random.integers(len(actions))]
        chain.append(int(random.choice([record for action, record in others[chain[-1]] if action == chosen])))
    return chain


def joined(motions: Sequence[Motion]) -> Motion:
    """Features one after the other, with a leap from each pose to the next: where the figure goes is in rates."""
    return replace(motions[0], values=np.concatenate([motion.values for motion in motions]))


def matched(joins: Sequence[float], cuts: Sequence[float], within: float = 1.0) -> int:
    """How many joins have a cut of their own within a second or other time, the nearest first."""
    pairs = sorted((abs(join - cut), join, cut) for join in joins for cut in cuts)
    free_joins, free_cuts = set(joins), set(cuts)
    for distance, join, cut in pairs:
        if distance <= within + 1e-9 and join in free_joins and cut in free_cuts:
            free_joins.remove(join)
            free_cuts.remove(cut)
    return len(joins) - len(free_joins)


def _share(truths: Truths) -> float:
    return float(truths.mean()) if len(truths) else np.nan


def _auc(scores: NDArray[np.float64], right: Truths) -> float:
    """How often the score of a right one is above that of a wrong one; equal ones count half."""
    from sklearn.metrics import roc_auc_score  # for this alone, so that training does not load it

    return float(roc_auc_score(right, scores)) if right.any() and not right.all() else np.nan
