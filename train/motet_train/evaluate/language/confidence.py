"""Whether a describe model knows when it is right: best descriptions of validation motions, believed or not."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from motet.models.describe import DescribeModel
from motet.models.text import RULES
from motet_train.evaluate.language.attributes import action_right
from motet_train.evaluate.language.split_store import SplitStore

Truths = NDArray[np.bool_]


def confidence(model: DescribeModel, corpus: SplitStore, records: Sequence[int]) -> dict[str, float]:
    """Of the best descriptions of some records (``of``): the shares that are right, and confident.

    "right_if_confident", "right_if_not": the shares that are right of those two. "kept": the share of right ones that
    are confident. "auc": how often a right one is more probable than a wrong one; "auc_word": by the mean of its words.
    Right is what names an action, and none that nobody named
    (:func:`motet_train.evaluate.language.attributes.action_right`). NaN where there are none.
    """
    found = [row[0] for row in model.describe(corpus.motions(records))]
    pairs = zip(found, corpus.references(records), strict=True)
    right = np.array([action_right(one.text, sentences) for one, sentences in pairs])
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


def _share(truths: Truths) -> float:
    return float(truths.mean()) if len(truths) else np.nan


def _auc(scores: NDArray[np.float64], right: Truths) -> float:
    """How often the score of a right one is above that of a wrong one; equal ones count half."""
    above = scores[right][:, None] - scores[~right]
    return float((np.sign(above).mean() + 1) / 2) if above.size else np.nan
