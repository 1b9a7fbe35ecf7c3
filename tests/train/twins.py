"""Parts of nets in numpy and double precision, for twins of whole nets."""

import numpy as np
from numpy.typing import NDArray
from torch import Tensor, nn

Array = NDArray[np.float64]


def array(tensor: Tensor) -> Array:
    return tensor.detach().double().numpy()


def squash(x: Array) -> Array:
    return 1 / (1 + np.exp(-x))


def linear(layer: nn.Module, x: Array) -> Array:
    return x @ array(layer.weight).T + array(layer.bias)
