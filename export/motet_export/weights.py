"""How the weights of an exported graph are kept: in 16 or 8 bits, from which they become float32 when it is loaded."""

from collections.abc import Callable
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from motet.bundle.graph import Floats
from motet_export.exporter import self_contained

LEAST = 256
"""Numbers of a tensor that is worth it."""

Small = tuple[NDArray[Any], Floats | None]
"""A tensor in a smaller type, and what its numbers are to be multiplied by."""


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

    return _stored(model, smaller)


def quantised(model: bytes) -> bytes:
    """An exported graph whose matrices are kept in int8, each row with a scale of its own; vectors stay as they are.

    Products stay in float32: those of 8 bits saturate on processors without VNNI, so a bundle would say other things
    on other machines, and what a row of a batch gives would depend on the others.
    """

    def smaller(values: Floats) -> Small | None:
        if values.squeeze().ndim < 2 or not np.isfinite(values).all():
            return None
        scale = np.abs(values).max(axis=-1, keepdims=True) / np.float32(127)
        scale[scale == 0] = 1
        return np.rint(values / scale).astype(np.int8), scale

    return _stored(model, smaller, weights="int8")


def _stored(model: bytes, smaller: Callable[[Floats], Small | None], **label: str) -> bytes:
    """A graph whose large tensors of float32 are kept as ``smaller`` says, or as they are where it gives None.

    ONNX Runtime casts and scales them once, when it loads the graph. label: more metadata.
    """
    proto = onnx.load_from_string(model)
    graph, nodes = proto.graph, []
    for tensor in list(graph.initializer):
        if tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < LEAST:
            continue
        if (found := smaller(numpy_helper.to_array(tensor))) is None:
            continue
        name, (small, scale) = tensor.name, found
        tensor.CopyFrom(numpy_helper.from_array(small, f"{name}.small"))
        cast = name if scale is None else f"{name}.cast"
        nodes.append(helper.make_node("Cast", [f"{name}.small"], [cast], to=TensorProto.FLOAT))
        if scale is not None:
            graph.initializer.append(numpy_helper.from_array(scale, f"{name}.scale"))
            nodes.append(helper.make_node("Mul", [cast, f"{name}.scale"], [name]))
    nodes += graph.node
    del graph.node[:]
    graph.node.extend(nodes)
    return self_contained(proto, {**{prop.key: prop.value for prop in proto.metadata_props}, **label})
