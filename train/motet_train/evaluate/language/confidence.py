"""Whether a describe model knows when it is right: best descriptions of validation motions, believed or not."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motet.models.describe import ConfidenceSettings, DescribeModel, Description
from motet.models.language import RULES
from motet_train.evaluate.language.attributes import action_right
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


def _share(truths: Truths) -> float:
    return float(truths.mean()) if len(truths) else np.nan


def _auc(scores: NDArray[np.float64], right: Truths) -> float:
    """How often the score of a right one is above that of a wrong one; equal ones count half."""
    from sklearn.metrics import roc_auc_score  # for this alone, so that training does not load it

    return float(roc_auc_score(right, scores)) if right.any() and not right.all() else np.nan
