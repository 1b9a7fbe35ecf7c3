"""How well timelines are: motions of known actions, joined in threes, and what is said of them when."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from motet.models.describe import DescribeModel, Part
from motet.motion.motion import Motion
from motet_train.evaluate.language.attributes import ACTIONS, action_right, common, said
from motet_train.evaluate.language.split_store import SplitStore

JOINED, COUNT = 3, 60
"""Motions in a timeline, and timelines."""

Others = Mapping[int, Sequence[tuple[str, int]]]
"""For each record the records of other actions, each as often as it has actions, with the action."""


class _Measured(NamedTuple):
    """Of one timeline: joins found, cuts made; for each tenth of a second whether what is said is right, and sure."""

    found: int
    cuts: int
    right: NDArray[np.bool_]
    sure: NDArray[np.bool_]
    alone: NDArray[np.bool_]


def timeline_figures(
    model: DescribeModel, corpus: SplitStore, records: Sequence[int], seed: int = 0
) -> dict[str, float]:
    """Of motions of 2 to 12 s, joined at random, neighbours of different actions: which joins are found, and what is
    said rightly.

    "joins_found", "cuts_right": the shares of joins that have a cut within a second, and of cuts that have a join.
    "parts": how many a timeline has. "time_right": the share of time at which an action is named that people named of
    what goes on, and no other; "time_confident", "time_right_if_confident": of parts that are confident.
    "alone_right": of the same motions, each described alone. Nothing where no motions differ.
    """
    others = _others(corpus, records)
    if not others:
        return {}
    random = np.random.default_rng(seed)
    rows = [_measured(model, corpus, _chain(others, random)) for _ in range(COUNT)]
    found, cuts = sum(row.found for row in rows), sum(row.cuts for row in rows)
    right, sure, alone = (np.concatenate([getattr(row, key) for row in rows]) for key in ("right", "sure", "alone"))
    return {
        "joins_found": found / (COUNT * (JOINED - 1)),
        "cuts_right": found / cuts if cuts else np.nan,
        "parts": cuts / COUNT + 1,
        "time_right": float(right.mean()),
        "time_confident": float(sure.mean()),
        "time_right_if_confident": float(right[sure].mean()) if sure.any() else np.nan,
        "alone_right": float(alone.mean()),
    }


def _others(corpus: SplitStore, records: Sequence[int]) -> Others:
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


def _chain(others: Others, random: np.random.Generator) -> list[int]:
    """Records one after the other: first the action is drawn, so that rare ones come as often, then the motion."""
    chain = [int(random.choice(list(others)))]
    while len(chain) < JOINED:
        actions = sorted({action for action, _ in others[chain[-1]]})
        chosen = actions[random.integers(len(actions))]
        chain.append(int(random.choice([record for action, record in others[chain[-1]] if action == chosen])))
    return chain


def _measured(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> _Measured:
    motions, references = corpus.motions(records), corpus.references(records)
    parts = model.timeline(joined(motions))
    ends, cuts = np.cumsum([motion.duration for motion in motions]), [part.start for part in parts[1:]]
    moments = np.arange(0.05, ends[-1], 0.1)
    here = [_at(parts, moment) for moment in moments]
    there = np.searchsorted(ends, moments).clip(max=len(records) - 1)
    right = [action_right(part.text, references[place]) for part, place in zip(here, there, strict=True)]
    best = [row[0].text for row in model.describe(motions)]
    alone = [action_right(text, sentences) for text, sentences in zip(best, references, strict=True)]
    sure = [part.confident for part in here]
    return _Measured(matched(ends[:-1].tolist(), cuts), len(cuts), *map(np.array, (right, sure, alone)))


def _at(parts: Sequence[Part], moment: float) -> Part:
    return next((part for part in parts if moment < part.stop), parts[-1])


def joined(motions: Sequence[Motion]) -> Motion:
    """Features one after the other, with a leap from each pose to the next: where the figure goes is in rates."""
    return replace(motions[0], values=np.concatenate([motion.values for motion in motions]))


def matched(joins: Sequence[float], cuts: Sequence[float]) -> int:
    """How many joins have a cut of their own within a second, the nearest first."""
    pairs = sorted((abs(join - cut), join, cut) for join in joins for cut in cuts)
    free_joins, free_cuts = set(joins), set(cuts)
    for distance, join, cut in pairs:
        if distance <= 1.0 + 1e-9 and join in free_joins and cut in free_cuts:
            free_joins.remove(join)
            free_cuts.remove(cut)
    return len(joins) - len(free_joins)
