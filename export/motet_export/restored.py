"""From a bundle back to a training run: the weights that its graphs hold, to train on from them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import numpy_helper

from motet.bundle.bundle import Bundle
from motet.bundle.golden import replay
from motet.errors import BundleError
from motet_export.exporter import ExportError, export_graph
from motet_train.models.net import Net
from motet_train.runs import MODELS, Run

Tensors = dict[str, NDArray[Any]]


@torch.no_grad()
def restored(bundle: Bundle) -> Run:
    """The run of a bundle, its weights as the graphs hold them; what only training uses is new.

    The exporter turns some weights around and gives them names of its own. So a net of the same sizes with random
    weights is exported, too: where a weight is found there, the bundle's is in the tensor of the same name, or, where
    nets of another version were exported, in the same place among those of its shape. ExportError for 8-bit weights,
    where a graph lacks a weight, and where the run does not compute the bundle's golden vectors.
    """
    manifest = bundle.manifest
    if "int8" in manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which are not those that were trained")
    net, other = (MODELS[manifest.model](manifest.config) for _ in range(2))
    state, known = net.state_dict(), _drawn(other)
    for name, values in (("mean", manifest.motion.mean), ("scale", manifest.motion.std)):
        if len(state[name]) == len(values):
            state[name].copy_(torch.from_numpy(values))
    for role, (module, spec) in other.graphs().items():
        held, drawn = _tensors(bundle.read(manifest.graphs[role].file)), _tensors(export_graph(module, spec, {}))
        found = {name: known[value.tobytes()] for name, value in drawn.items() if value.tobytes() in known}
        for name, value in _paired({name: drawn[name] for name in found}, held, [*state]).items():
            weight, like = torch.tensor(value), other.state_dict()[found[name]]
            if weight.numel() > like.numel():
                weight = weight[:, None, : like.shape[-1]]
            elif not np.array_equal(drawn[name], like.numpy()):
                weight = weight.mT
            state[found[name]].copy_(torch.where(weight.isinf(), 0, weight))  # what a scale of 0 is divided by
    for name in manifest.tables.keys() & state.keys():
        state[name].copy_(torch.from_numpy(bundle.table(name).copy()))
    run = Run(manifest.source, net.eval())
    assert manifest.golden is not None
    try:
        replay(run.bundle_model(), bundle.read(manifest.golden.file), manifest.golden)
    except BundleError as error:
        raise ExportError(f"bundle {bundle.path}: the weights found are not all: {error}") from error
    return run


def _drawn(net: Net) -> dict[bytes, str]:
    """The weights of a net, set at random, those turned around, and those of biases followed by zeros (a GRU has two
    biases), with their names."""
    known = dict[bytes, str]()
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            value.uniform_(0.5, 1.5)
        elif value.dtype == torch.int8:
            value.random_(-127, 127)
        if value.is_floating_point() or value.dtype == torch.int8:
            forms = (value, value.mT, torch.cat([value, 0 * value], dim=-1)) if value.dim() > 1 else (value,)
            known |= {form.numpy().tobytes(): name for form in forms}
    return known


def _paired(drawn: Tensors, held: Tensors, weights: Iterable[str]) -> Tensors:
    """For each of the weights drawn in a new graph the tensor of a bundle's graph; ExportError where one lacks it."""
    if all(name in held and held[name].shape == value.shape for name, value in drawn.items()):
        return {name: held[name] for name in drawn}
    own = {name for name in drawn if any(weight.endswith(name.removeprefix("net.")) for weight in weights)}
    others, found = [name for name in held if name not in own], {}
    for name, value in drawn.items():
        match = name if name in own else next((one for one in others if held[one].shape == value.shape), name)
        if match not in held:
            raise ExportError(f"the bundle's graph has no tensor {name}")
        found[name], others = held[match], [one for one in others if one != match]
    return found


def _tensors(data: bytes) -> Tensors:
    """The tensors of real numbers and bytes in a graph by name, those kept in 16 bits by that of their cast to 32."""
    graph = onnx.load_from_string(data).graph
    cast = {node.input[0]: node.output[0] for node in graph.node if node.op_type == "Cast"}
    found = {cast.get(one.name, one.name): numpy_helper.to_array(one) for one in graph.initializer}
    real = {name: value.astype(np.float32) for name, value in found.items() if value.dtype.kind == "f"}
    return real | {name: value for name, value in found.items() if value.dtype == np.int8}
