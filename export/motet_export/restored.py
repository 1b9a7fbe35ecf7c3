"""From a bundle back to a training run with the weights of its graphs, to continue training."""

from collections.abc import Iterator
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
    """The run of a bundle, with the weights of its graphs; parameters used only in training are new.

    The exporter transposes some weights and renames some. To know which, a net of the same sizes with random weights is
    exported, too: a tensor of that graph with the numbers of a weight tells where the weight is. The bundle's graph has
    it as the same input of the same operation, or, if it has other operations, in the tensor of the same name.
    ExportError for 8-bit weights, if a graph lacks a weight, and if the run does not compute the bundle's golden
    vectors.
    """
    manifest = bundle.manifest
    if "int8" in manifest.parity:
        raise ExportError(f"bundle {bundle.path} has 8-bit weights, which are not those that were trained")
    # a net to fill, and one of random weights that tells where they are
    net = MODELS[manifest.model](manifest.config)
    other = MODELS[manifest.model](manifest.config)
    state = net.state_dict()
    _copy_arrays(state, bundle)
    weight_names = _randomised(other)
    for role, (module, spec) in other.graphs().items():
        stored_graph = onnx.load_from_string(bundle.model(role)).graph
        random_graph = onnx.load_from_string(export_graph(module, spec, {})).graph
        tensors = _tensors(stored_graph)
        stored = _renamed(tensors, net) | _in_their_places(stored_graph, random_graph, tensors)
        _restore(state, other.state_dict(), stored, _tensors(random_graph), weight_names)
    # it must compute what the bundle does
    run = Run(manifest.source, net.eval())
    _check(run, bundle)
    return run


def _renamed(tensors: Tensors, net: Net) -> Tensors:
    """Tensors of a graph by the names that weights have today."""
    renamed = {}
    for name, value in tensors.items():
        weight = name.removeprefix("net.")
        renamed[name.removesuffix(weight) + net.current_name(weight)] = value
    return renamed


def _copy_arrays(state: dict[str, torch.Tensor], bundle: Bundle) -> None:
    """Copy the normalisation and the tables, which are not in graphs; of a memory without the steps of commands, which
    follow those of the net."""
    motion = bundle.manifest.motion
    for name, values in (("mean", motion.mean), ("scale", motion.std)):
        if len(state[name]) == len(values):
            state[name].copy_(torch.from_numpy(values))
    for name in bundle.manifest.tables.keys() & state.keys():
        state[name].copy_(torch.from_numpy(bundle.table(name)[: len(state[name])].copy()))


def _restore(
    state: dict[str, torch.Tensor],
    random_state: dict[str, torch.Tensor],
    stored: Tensors,
    random: Tensors,
    weight_names: dict[bytes, str],
) -> None:
    """Copy the weights in the stored tensors of a graph into ``state``.

    random: the tensors of the same graph exported with the weights ``random_state``.
    """
    names = {}
    for tensor, value in random.items():
        if value.tobytes() in weight_names:
            names[tensor] = weight_names[value.tobytes()]
    for tensor, name in names.items():
        if tensor not in stored or stored[tensor].shape != random[tensor].shape:
            raise ExportError(f"the bundle's graph has no tensor {tensor} of shape {random[tensor].shape}")
        weight = _as_in_net(stored[tensor], random[tensor], random_state[name])
        # a scale of 0 is stored as the infinity by which the exporter divides
        state[name].copy_(torch.where(weight.isinf(), 0, weight))


def _as_in_net(tensor: NDArray[Any], random: NDArray[Any], like: torch.Tensor) -> torch.Tensor:
    """A tensor of a bundle's graph in the form of a net's weight. like: that weight, where it is random; random: what
    the exporter makes of it."""
    weight = torch.tensor(tensor)
    if weight.numel() > like.numel():
        # a bias followed by zeros
        return weight[:, None, : like.shape[-1]]
    if np.array_equal(random.ravel(), like.numpy().ravel()):
        return weight.reshape(like.shape)
    return weight.reshape(like.mT.shape).mT


def _check(run: Run, bundle: Bundle) -> None:
    """ExportError if a run does not compute the golden vectors of its bundle."""
    golden = bundle.manifest.golden
    assert golden is not None
    try:
        replay(run.bundle_model(), bundle.read(golden.file), golden)
    except BundleError as error:
        raise ExportError(f"bundle {bundle.path} does not contain all weights: {error}") from error


def _randomised(net: Net) -> dict[bytes, str]:
    """Randomise the weights of a net; their names by their bytes, in each form in which they may be exported.

    These are as they are, transposed, and, for biases, followed by zeros, because a GRU has two biases.
    """
    names: dict[bytes, str] = {}
    for name, value in net.state_dict().items():
        if value.is_floating_point():
            value.uniform_(0.5, 1.5)
        elif value.dtype == torch.int8:
            value.random_(-127, 127)
        else:
            continue
        forms = [value]
        if value.dim() > 1:
            forms += [value.mT, torch.cat([value, 0 * value], dim=-1)]
        for form in forms:
            names[form.numpy().tobytes()] = name
    return names


def _in_their_places(stored_graph: onnx.GraphProto, random_graph: onnx.GraphProto, stored: Tensors) -> Tensors:
    """By the name of each input of a random graph the tensor that the bundle's graph has in its place; none if their
    operations differ. Equal tensors are stored once, so that some weights are not there by their own names."""
    stored_inputs = list(_inputs(stored_graph))
    random_inputs = list(_inputs(random_graph))
    if [operation for operation, _ in stored_inputs] != [operation for operation, _ in random_inputs]:
        return {}
    places: Tensors = {}
    for (_, stored_name), (_, random_name) in zip(stored_inputs, random_inputs, strict=True):
        if stored_name in stored:
            places[random_name] = stored[stored_name]
    return places


def _inputs(graph: onnx.GraphProto) -> Iterator[tuple[str, str]]:
    """The operation and the name of each input in a graph and in the graphs within it, but for the inputs of casts,
    which weights of 16 bits have."""
    for node in graph.node:
        if node.op_type != "Cast":
            yield from ((node.op_type, name) for name in node.input)
        for attribute in node.attribute:
            yield from _inputs(attribute.g)


def _tensors(graph: onnx.GraphProto) -> Tensors:
    """The float and int8 tensors of a graph by name; a tensor stored in 16 bits by the name of its cast to 32."""
    cast_names = {node.input[0]: node.output[0] for node in graph.node if node.op_type == "Cast"}
    floats: Tensors = {}
    bytes_: Tensors = {}
    for tensor in graph.initializer:
        name = cast_names.get(tensor.name, tensor.name).replace("shared.net.", "net.")
        value = numpy_helper.to_array(tensor)
        if value.dtype.kind == "f":
            floats[name] = value.astype(np.float32)
        elif value.dtype == np.int8:
            bytes_[name] = value
    return floats | bytes_
