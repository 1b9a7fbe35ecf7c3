"""Weights in half precision: a bundle of half the size, which computes as before in 32 bits."""

import numpy as np
import torch
from torch import nn

from motet.bundle.graph import Floats
from motet_export.weights import LEAST, Small, stored

HALF = "float16"
"""What the parity report calls it."""


@torch.no_grad()
def round_weights(net: nn.Module) -> None:
    """Round a net's weights to half precision, so that what is exported of it can be kept in 16 bits without loss."""
    for parameter in net.parameters():
        if parameter.numel() >= LEAST:
            parameter.copy_(parameter.half().float())


def halved(model: bytes, rounded: bool = False) -> bytes:
    """A graph whose weights are kept in 16 bits where that loses nothing; they are cast to 32 when it is loaded.

    rounded: keep them all so, where 16 bits reach as far as they do.
    """

    def smaller(values: Floats) -> Small | None:
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        kept = np.isfinite(half).all() if rounded else np.array_equal(half.astype(np.float32), values)
        return (half, None) if kept else None

    return stored(model, smaller)
