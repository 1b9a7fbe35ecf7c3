"""8-bit weights: a bundle of a quarter of the size, and what that changes in complete runs."""

import numpy as np

from motet.bundle.graph import Floats
from motet.models.base import BundleModel
from motet_export.decoded import whole_runs
from motet_export.weights import Small, stored


def quantised(model: bytes) -> bytes:
    """An exported graph whose matrices are kept in int8, each row with a scale of its own.

    Products stay in float32: those of 8 bits saturate on processors without VNNI, so a bundle would say other things
    on other machines, and what a row of a batch gives would depend on the others.
    """
    return stored(model, _rows, weights="int8")


def difference(int8: BundleModel, exact: BundleModel) -> dict[str, float]:
    """What int8 changes in the runs of the parity ladder, for the manifest.

    "<run>.equal": share of the decoded sentences that are the same. "<run>.score": mean |difference| of the
    log-likelihoods of known pairs, in units of their mean |value|. "<run>.frames", where nothing but frames is decoded:
    their mean |difference|.
    """
    report: dict[str, float] = {}
    for name, run in whole_runs(int8, exact).items():
        found, expected = run()
        if "words" in found and found["words"].shape == expected["words"].shape:
            report[f"{name}.equal"] = float((found["words"] == expected["words"]).all(axis=1).mean())
        if "scores" in found:
            off = np.abs(found["scores"] - expected["scores"]).mean() / np.abs(expected["scores"]).mean()
            report[f"{name}.score"] = float(off)
        if set(found) == {"frames"}:
            report[f"{name}.frames"] = float(np.abs(found["frames"] - expected["frames"]).mean())
    return report


def _rows(values: Floats) -> Small | None:
    """Every row over its largest number; vectors, such as biases and the scales of channels, stay as they are."""
    if values.squeeze().ndim < 2 or not np.isfinite(values).all():
        return None
    scale = np.abs(values).max(axis=-1, keepdims=True) / np.float32(127)
    scale[scale == 0] = 1
    return np.rint(values / scale).astype(np.int8), scale
