"""How the weights of an exported graph are kept: in fewer bits, from which they become float32 when it is loaded."""

from collections.abc import Callable
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from motet.bundle.graph import Floats
from motet_export.exporter import self_contained

LEAST = 256
"""Numbers of a tensor that is worth it."""

Small = tuple[NDArray[Any], Floats | None]
"""A tensor in a smaller type, and what its numbers are to be multiplied by."""


def stored(model: bytes, smaller: Callable[[Floats], Small | None], **label: str) -> bytes:
    """A graph whose large tensors of float32 are kept as ``smaller`` says, or as they are where it gives None.

    ONNX Runtime casts and scales them once, when it loads the graph, and then computes in float32 as before. label:
    more metadata.
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
