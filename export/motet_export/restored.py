"""From a bundle back to a training run with the weights of its graphs, to continue training."""

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
    """The run of a bundle, with the weights of its graphs; parameters used only in training are new.

    The exporter transposes some weights and renames some. To know which, a net of the same sizes with random weights is
    exported, too: a tensor of that graph with the numbers of a weight tells where the weight is. The bundle's graph has
    it in the tensor of the same name, or, if another version exported it, at the same place among tensors of its shape.
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
        stored = _renamed(_tensors(bundle.model(role)), net)
        random = _tensors(export_graph(module, spec, {}))
        _restore(state, other.state_dict(), stored, random, weight_names)
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
    pairs = _paired({tensor: random[tensor] for tensor in names}, stored, [*state])
    for tensor, value in pairs.items():
        name = names[tensor]
        weight = torch.tensor(value)
        like = random_state[name]
        if weight.numel() > like.numel():
            # a bias followed by zeros
            weight = weight[:, None, : like.shape[-1]]
        elif not np.array_equal(random[tensor], like.numpy()):
            weight = weight.mT
        # a scale of 0 is stored as the infinity by which the exporter divides
        state[name].copy_(torch.where(weight.isinf(), 0, weight))


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


def _paired(random: Tensors, stored: Tensors, weights: Iterable[str]) -> Tensors:
    """For each weight in a new graph the tensor of a bundle's graph; ExportError if the bundle lacks it."""
    if all(name in stored and stored[name].shape == value.shape for name, value in random.items()):
        return {name: stored[name] for name in random}
    # names that the exporter made up are numbered, and differ between versions: pair these in order, by shape
    suffixes = tuple(weights)
    kept_names = set()
    for name in random:
        if any(weight.endswith(name.removeprefix("net.")) for weight in suffixes):
            kept_names.add(name)
    others = [name for name in stored if name not in kept_names]
    pairs = {}
    for name, value in random.items():
        match = name
        if name not in kept_names:
            match = next((other for other in others if stored[other].shape == value.shape), name)
        if match not in stored:
            raise ExportError(f"the bundle's graph has no tensor {name}")
        pairs[name] = stored[match]
        others = [other for other in others if other != match]
    return pairs


def _tensors(data: bytes) -> Tensors:
    """The float and int8 tensors of a graph by name; a tensor stored in 16 bits by the name of its cast to 32."""
    graph = onnx.load_from_string(data).graph
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
