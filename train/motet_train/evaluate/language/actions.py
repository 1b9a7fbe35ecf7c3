"""Whether descriptions are right by what is done, how often those that are sure are, and whether turns are told."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motet.models.describe import DescribeModel, Description
from motet.models.known import NOTHING
from motet_train.data.kinds import Shown, named, shown_by
from motet_train.data.store import Split, Store, matches
from motet_train.evaluate.language.attributes import common_side, side, turning
from motet_train.evaluate.language.confidence import joined, matched
from motet_train.evaluate.language.describe import nearest_motions
from motet_train.evaluate.language.split_store import SplitStore
from motet_train.evaluate.tables import Report

Truths = NDArray[np.bool_]

BINS = 10
"""Of the probability, in the expected calibration error."""


def clips_apart(store: Store, patterns: str) -> SplitStore:
    """The clips whose names match one of several patterns, separated by commas, as the test part; all others train."""
    found = [matches(entry.name, patterns) for entry in store.records]
    parts = ([i for i, own in enumerate(found) if own == wanted] for wanted in (False, True))
    train, test = map(tuple, parts)
    return SplitStore(store, Split(train, (), test))


def actions_report(model: DescribeModel, corpus: SplitStore) -> Report:
    """How test motions are described.

    "actions": how many there are ("of"); the shares that are right by action (:class:`motet_train.data.kinds.Shown`),
    about which some sentence of the model's known motions is right ("reachable"), that are sure, of these that are
    right and wrong, and of which nothing is said; and the expected calibration error of the probability, beside that
    of probabilities that are exactly right, of as many motions. "lookup": the share of the sentences about the nearest
    training motions that are right, by mean and deviation of positions, speeds and
    path. "turns": of motions of which half of the sentences tell a turn and its side, how many there are and the share
    whose description tells it. "timeline": see :func:`timelines`.
    """
    test = corpus.described(corpus.parts.test)
    motions, shown = corpus.motions(test), [_shown(corpus, record) for record in test]
    found = [row[0] for row in model.describe(motions)]
    right = np.array([one.right(said.text) for one, said in zip(shown, found, strict=True)])
    sure = np.array([said.confident for said in found])
    chances = np.array([said.probability for said in found])
    sayable = {named(text) for text in (model.known.sentences if model.known else ())}
    near = corpus.references(nearest_motions(corpus, motions))
    copied = [np.mean([one.right(text) for text in texts]) for one, texts in zip(shown, near, strict=True)]
    actions = {
        "of": float(len(test)),
        "right": _share(right),
        "reachable": _share(np.array([any(map(one.right_kinds, sayable)) for one in shown])) if sayable else np.nan,
        "sure": _share(sure),
        "right_if_sure": _share(right[sure]),
        "wrong_if_sure": _share(~right[sure]),
        "nothing": _share(np.array([said.text == NOTHING for said in found])),
        "calibration_error": calibration_error(chances, right),
        "calibration_by_chance": error_by_chance(chances),
    }
    report = {"actions": actions, "lookup": {"right": float(np.mean(copied))}, "turns": _turns(corpus, test, found)}
    return report | {"timeline": timelines(model, corpus, test)}


def _shown(corpus: SplitStore, record: int) -> Shown:
    entry = corpus.store.records[record]
    return shown_by((*entry.sentences, *entry.unseen), entry.action)


def _turns(corpus: SplitStore, records: Sequence[int], found: Sequence[Description]) -> dict[str, float]:
    told = []
    for record, said in zip(records, found, strict=True):
        sentences = corpus.sentences(record)
        agreed = common_side([one for one in sentences if turning(one)])
        if agreed and 2 * sum(side(one) == {agreed} and "turn" in one for one in sentences) >= len(sentences):
            told.append(side(said.text) == {agreed})
    return {"of": float(len(told)), "told": _share(np.array(told, dtype=bool))}


def timelines(model: DescribeModel, corpus: SplitStore, records: Sequence[int], count: int = 40) -> dict[str, float]:
    """Of timelines of three motions of 2 to 12 s, drawn at random and joined: the share of time at which what is told
    is right about what goes on ("time_right"), of joins with a cut within half a second ("joins_found"), and of cuts
    with a join ("cuts_right"). Nothing where there are fewer than three such motions."""
    usable = [record for record in records if 2.0 <= corpus.motion(record).duration <= 12.0]
    if len(usable) < 3:
        return {}
    random, right, found, cuts = np.random.default_rng(0), list[bool](), 0, 0
    for _ in range(count):
        chain = random.choice(usable, 3, replace=False).tolist()
        motions, shown = corpus.motions(chain), [_shown(corpus, record) for record in chain]
        parts, ends = model.timeline(joined(motions)), np.cumsum([motion.duration for motion in motions])
        found += matched(ends[:-1].tolist(), [part.start for part in parts[1:]], 0.5)
        cuts += len(parts) - 1
        for moment in np.arange(0.05, ends[-1], 0.1):
            part = next((part for part in parts if moment < part.stop), parts[-1])
            right.append(shown[min(int(np.searchsorted(ends, moment)), 2)].right(part.text))
    return {
        "time_right": _share(np.array(right)),
        "joins_found": found / (2 * count),
        "cuts_right": found / cuts if cuts else np.nan,
    }


def calibration_error(probability: NDArray[np.float64], right: Truths) -> float:
    """The expected calibration error (Guo et al. 2017): the mean distance of probability (N,) and share that is right,
    over tenths of the probability, each as much as there is in it."""
    bins = np.minimum((probability * BINS).astype(int), BINS - 1)
    errors = [abs(probability[bins == one].sum() - right[bins == one].sum()) for one in range(BINS)]
    return float(sum(errors) / len(right))


def error_by_chance(probability: NDArray[np.float64], times: int = 1000) -> float:
    """The mean calibration error where each probability (N,) is exactly right: what too few motions leave."""
    drawn = np.random.default_rng(0).random((times, len(probability))) < probability
    return float(np.mean([calibration_error(probability, right) for right in drawn]))


def _share(truths: Truths) -> float:
    return float(truths.mean()) if len(truths) else np.nan
