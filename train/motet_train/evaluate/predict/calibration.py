"""Whether a predictor's errors are what it expects them to be, on recordings that it did not see in training.

Of a model that knows its errors: measured over expected, which ought to be 1, for kinds of motions and frames; whether
windows of which it expects more do have more, by quarters and by the correlation of ranks. Letters in shapes: W
windows, N predicted frames.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from scipy.stats import spearmanr

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet_train.evaluate.predict.error_rows import REPORTED, ErrorRows
from motet_train.evaluate.predict.mocap import PLACE, Measured

QUARTERS = ("least expected", "second", "third", "most expected")
"""Of the windows, by what is expected at a frame."""

ALL = "all"


@runtime_checkable
class KnowsErrors(Protocol):
    """A predictor that can say how far it will be off."""

    @property
    def knows_errors(self) -> bool:
        """Whether this one can."""

    def expected_errors(self, motions: Sequence[Motion], /) -> Array:
        """The expected mean distances (W, N) of joints in centimetres."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """What was expected, beside what was measured, in centimetres.

    ratios: kind of motions -> measured over expected (N,). quarters: for each of :data:`QUARTERS` what was expected and
    what was measured, (N,) each. ranks: Spearman's correlation (N,) of the two over windows, NaN where one does not
    vary.
    """

    ratios: Mapping[str, Array]
    quarters: Mapping[str, tuple[Array, Array]]
    ranks: Array


def calibration_of(model: object, found: Measured, name: str, kinds: Mapping[str, Sequence[str]]) -> Calibration | None:
    """The calibration of a model that was measured by that name, None of one that does not know its errors.

    kinds: kind of motions -> names of its recordings.
    """
    if not (isinstance(model, KnowsErrors) and model.knows_errors):
        return None
    true = found.distances[name][PLACE]
    return calibrated(
        np.asarray(model.expected_errors(found.seeds), dtype=np.float64),
        true,
        {kind: found.windows(names) for kind, names in kinds.items()},
    )


def calibrated(expected: Array, true: Array, kinds: Mapping[str, Array]) -> Calibration:
    """Of expected and measured errors (W, N). kinds: kind -> numbers of its windows; those without any are left out."""
    groups = {ALL: np.arange(len(true)), **{kind: picked for kind, picked in kinds.items() if len(picked)}}
    ratios = {kind: true[picked].mean(axis=0) / expected[picked].mean(axis=0) for kind, picked in groups.items()}
    order = np.argsort(expected, axis=0, kind="stable")
    rising = np.take_along_axis(expected, order, axis=0), np.take_along_axis(true, order, axis=0)
    parts = np.array_split(np.arange(len(true)), len(QUARTERS))
    quarters = {
        words: (rising[0][part].mean(axis=0), rising[1][part].mean(axis=0))
        for words, part in zip(QUARTERS, parts, strict=True)
        if len(part)
    }
    ranks = [_correlation(one, other) for one, other in zip(expected.T, true.T, strict=True)]
    return Calibration(ratios, quarters, np.array(ranks))


def _correlation(one: Array, other: Array) -> float:
    """Spearman's of two rows (W,); NaN where one does not vary."""
    return float(spearmanr(one, other).statistic) if np.ptp(one) > 0 and np.ptp(other) > 0 else float("nan")


def calibration_table(found: Calibration, name: str) -> str:
    """As text, at the frames reported."""
    rows = ErrorRows()
    rows.title(f"{name}: measured mean error over the expected one, joints in the world")
    for kind, ratio in found.ratios.items():
        rows.add(kind, ratio)
    rows.title("quarters of the windows by the expected error: expected, cm; and measured, cm")
    for words, (expected, true) in found.quarters.items():
        rows.add(f"{words}: expected", expected)
        rows.add(f"{words}: measured", true)
    rows.title("correlation of the ranks of expected and measured errors (Spearman)")
    rows.add("all windows", found.ranks)
    return rows.text()


def to_json(found: Calibration) -> dict[str, Any]:
    """The "ratio" of each kind, "quarters" with the least expected first, "rank_correlation": each at the frames."""
    return {
        "ratio": {kind: _frames(ratio) for kind, ratio in found.ratios.items()},
        "quarters": [
            {"expected_cm": _frames(expected), "measured_cm": _frames(true)}
            for expected, true in found.quarters.values()
        ],
        "rank_correlation": _frames(found.ranks),
    }


def _frames(values: Array) -> dict[str, float | None]:
    return {
        f"frame_{frame}": round(float(values[frame]), 4) if np.isfinite(values[frame]) else None for frame in REPORTED
    }
