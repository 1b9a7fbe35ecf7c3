"""From a bundle back to a training run: the weights that its graphs hold, to train on from them."""

from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper

from motet.bundle.bundle import Bundle
from motet_export.exporter import ExportError, export_graph
from motet_train.runs import MODELS, Run


@torch.no_grad()
def restored(bundle: Bundle) -> Run:
    """The run of a bundle, its weights as the graphs hold them; what only training uses is new.

    The exporter turns some weights around and gives them names of its own. So a net of the same sizes with random
    weights is exported, too: where a weight is found there, the bundle's is in the tensor of the same name.
    ExportError for 8-bit weights, and where the bundle's graphs have other names, those of another version of torch.
    """
    manifest = bundle.manifest
    if "int8" in manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which are not those that were trained")
    net, other = (MODELS[manifest.model](manifest.config) for _ in range(2))
    state, known = net.state_dict(), dict[bytes, str]()
    for name, value in other.state_dict().items():
        if value.is_floating_point():
            value.uniform_(0.5, 1.5)
        elif value.dtype == torch.int8:
            value.random_(-127, 127)
        if value.is_floating_point() or value.dtype == torch.int8:
            known |= {part.numpy().tobytes(): name for part in (value, value.mT if value.dim() > 1 else value)}
    for role, (module, spec) in other.graphs().items():
        held = _tensors(bundle.read(manifest.graphs[role].file))
        for name, value in _tensors(export_graph(module, spec, {})).items():
            if (weight := known.get(value.tobytes())) is None:
                continue
            if name not in held or held[name].shape != value.shape:
                torch_of = manifest.parity.get("versions", {}).get("torch", "unknown")
                raise ExportError(f"bundle {bundle.path}, graph {role}: no tensor {name}; exported by torch {torch_of}")
            same = np.array_equal(value, other.state_dict()[weight].numpy())
            state[weight].copy_(torch.from_numpy(held[name] if same else held[name].T))
    for name in manifest.tables.keys() & state.keys():
        state[name].copy_(torch.from_numpy(bundle.table(name).copy()))
    for name, values in (("mean", manifest.motion.mean), ("scale", manifest.motion.std)):
        if len(state[name]):
            state[name].copy_(torch.from_numpy(values))
    return Run(manifest.source, net.eval())


def _tensors(data: bytes) -> dict[str, NDArray[Any]]:
    """The tensors of real numbers and bytes in a graph by name, those kept in 16 bits by that of their cast to 32."""
    graph = onnx.load_from_string(data).graph
    cast = {node.input[0]: node.output[0] for node in graph.node if node.op_type == "Cast"}
    found = {cast.get(one.name, one.name): numpy_helper.to_array(one) for one in graph.initializer}
    real = {name: value.astype(np.float32) for name, value in found.items() if value.dtype.kind == "f"}
    return real | {name: value for name, value in found.items() if value.dtype == np.int8}
