"""Whether a predictor's errors are what it expects them to be, on recordings that it did not see in training.

Letters in shapes: W windows, N predicted frames.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import spearmanr

from motet.motion.rotations import Array
from motet_train.evaluate.predict.frames import by_frame, cells

QUARTERS = ("least expected", "second", "third", "most expected")
"""Of the windows, by what is expected at a frame."""


def calibration(expected: Array, true: Array, kinds: Mapping[str, NDArray[np.intp]]) -> dict[str, Any]:
    """Of expected and measured errors (W, N) in centimetres, at the reported frames.

    "ratio": measured over expected, which ought to be 1, of "all" windows and of each of ``kinds``, kind -> numbers of
    its windows. "quarters" of the windows, those with the least expected errors first: the means of both, which ought
    to rise alike. "rank_correlation": Spearman's, NaN where one of the two does not vary.
    """
    groups = {"all": np.arange(len(true)), **kinds}
    order = np.argsort(expected, axis=0, kind="stable")
    both = {"expected_cm": expected, "measured_cm": true}
    rising = {key: np.take_along_axis(errors, order, axis=0) for key, errors in both.items()}
    parts = [part for part in np.array_split(np.arange(len(true)), len(QUARTERS)) if len(part)]
    return {
        "ratio": {kind: by_frame(true[own].mean(axis=0) / expected[own].mean(axis=0)) for kind, own in groups.items()},
        "quarters": [{key: by_frame(errors[part].mean(axis=0)) for key, errors in rising.items()} for part in parts],
        "rank_correlation": by_frame(np.array([_ranks(*pair) for pair in zip(expected.T, true.T, strict=True)])),
    }


def _ranks(one: Array, other: Array) -> float:
    return float(spearmanr(one, other).statistic) if np.ptp(one) > 0 and np.ptp(other) > 0 else np.nan


def calibration_rows(found: Mapping[str, Any]) -> list[list[str]]:
    """Rows of a table, after a head with the frames."""
    rows = [["measured mean error over the expected one, joints in the world"]]
    rows += [[f"  {kind}", *cells(ratio, 2)] for kind, ratio in found["ratio"].items()]
    rows.append(["quarters of the windows by the expected error: expected, cm; and measured, cm"])
    for words, quarter in zip(QUARTERS, found["quarters"], strict=False):
        rows += [[f"  {words}: {key.removesuffix('_cm')}", *cells(errors, 2)] for key, errors in quarter.items()]
    rows.append(["correlation of the ranks of expected and measured errors (Spearman)"])
    return [*rows, ["  all windows", *cells(found["rank_correlation"], 2)]]
