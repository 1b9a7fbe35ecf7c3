"""Weights in half precision: a bundle of half the size, which computes as before in 32 bits."""

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from motet_export.exporter import self_contained

HALF = "float16"
"""What the parity report calls it."""

LEAST = 256
"""Numbers of a tensor that is worth it."""


@torch.no_grad()
def round_weights(net: nn.Module) -> None:
    """Round a net's weights to half precision, so that what is exported of it can be kept in 16 bits without loss."""
    for parameter in net.parameters():
        if parameter.numel() >= LEAST:
            parameter.copy_(parameter.half().float())


def halved(data: bytes, rounded: bool = False) -> bytes:
    """A graph whose weights are kept in 16 bits where that loses nothing; they are cast to 32 when it is loaded.

    rounded: keep them all so, where 16 bits reach as far as they do.
    """
    model = onnx.load_from_string(data)
    graph = model.graph
    casts = []
    for tensor in graph.initializer:
        if tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < LEAST:
            continue
        values = numpy_helper.to_array(tensor)
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        kept = np.isfinite(half).all() if rounded else np.array_equal(half.astype(np.float32), values)
        if not kept:
            continue
        name = tensor.name
        tensor.CopyFrom(numpy_helper.from_array(half, f"{name}.half"))
        casts.append(helper.make_node("Cast", [f"{name}.half"], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *graph.node]
    del graph.node[:]
    graph.node.extend(nodes)
    return self_contained(model, {prop.key: prop.value for prop in model.metadata_props})
