"""Export a torch module to an ONNX graph that keeps a contract, with weights in 32, 16 or 8 bits."""

import gc
import logging
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper
from torch import nn

from motet.bundle.graph import Floats, GraphSpec
from motet.bundle.graph_safety import check_graph
from motet.errors import BundleError, MotetError

SMALLEST_QUANTISED = 256
"""Smallest number of elements of a tensor that is stored in fewer bits."""

SMALLEST_SHARED = 1 << 16
"""Smallest number of bytes of a weight that several graphs share."""

Content = tuple[int, tuple[int, ...], bytes]
"""The type, shape and bytes of a tensor."""

Small = tuple[NDArray[Any], Floats | None]
"""A tensor in a smaller type, and the factors by which its numbers are multiplied when it is loaded."""


class ExportError(MotetError, RuntimeError):
    """A model that does not export, or whose graph does not compute the same as torch."""


def export_graph(module: nn.Module, spec: GraphSpec, metadata: Mapping[str, str]) -> bytes:
    """Export ``module``, whose forward takes and returns the tensors of ``spec`` in order, as ONNX bytes.

    Dynamic axes are those that the contract names. ``metadata`` goes into the graph so that a single file is
    identifiable. ExportError if the result is not a self-contained, valid ONNX model.
    """
    rng = np.random.default_rng(0)
    # a batch of 2: torch would take an axis of size 1 for a constant
    example = {tensor.name: torch.from_numpy(tensor.example(rng, batch=2)) for tensor in spec.inputs}
    _sources_read_once()
    # gradients off: torch does not export a scan over weights that ask for them
    with warnings.catch_warnings(action="ignore"), _log_silenced(), _no_collection(), torch.no_grad():
        program = torch.onnx.export(
            module.eval(),
            (),
            kwargs=example,
            input_names=[tensor.name for tensor in spec.inputs],
            output_names=[tensor.name for tensor in spec.outputs],
            dynamic_shapes=_dynamic_axes(spec),
            dynamo=True,
            external_data=False,
            opset_version=18,
            verbose=False,
        )
    if program is None:
        raise ExportError("torch gave no ONNX program")
    return self_contained(program.model_proto, metadata)


def _dynamic_axes(spec: GraphSpec) -> dict[str, Any]:
    """The dynamic axes of each input; axes of one name have the same size."""
    dims: dict[str, Any] = {}
    shapes: dict[str, Any] = {}
    for tensor in spec.inputs:
        names = {axis: name for axis, name in enumerate(tensor.shape) if isinstance(name, str)}
        shapes[tensor.name] = {axis: dims.setdefault(name, torch.export.Dim(name)) for axis, name in names.items()}
    return shapes


@contextmanager
def _log_silenced() -> Iterator[None]:
    """Silence the exporter's log but for errors."""
    loggers = [logging.getLogger(name) for name in ("torch.onnx", "onnxscript", "onnx_ir")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@cache
def _sources_read_once() -> None:
    """Keep what is read of the sources of torch's 500 functions in ONNX: that takes a second, for every graph anew.

    Exports are the same without it, as they are with a version of onnxscript that has no such class.
    """
    from onnxscript import values

    functions = getattr(values, "TracedOnnxFunction", None)
    read = getattr(getattr(functions, "function_ir", None), "fget", None)
    if functions is not None and read is not None:
        functions.function_ir = property(cache(read))


@contextmanager
def _no_collection() -> Iterator[None]:
    """Without Python's search for garbage: an export makes millions of small objects that are needed to its end."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


def self_contained(model: onnx.ModelProto, metadata: Mapping[str, str]) -> bytes:
    """Strip paths of the building machine, add metadata, check, and serialise a model that needs no other file."""
    model.doc_string = ""
    del model.metadata_props[:]
    _strip(model.graph)
    _flatten(model.graph, _ranks(model))
    for key, value in metadata.items():
        model.metadata_props.add(key=key, value=value)
    # the first IR version with this opset, which every ONNX Runtime from 1.14 on reads
    model.ir_version = min(model.ir_version, 8)
    try:
        onnx.checker.check_model(model, full_check=True)
    except (onnx.checker.ValidationError, onnx.shape_inference.InferenceError) as error:
        raise ExportError(f"the exported graph is not valid ONNX: {error}") from error
    data: bytes = model.SerializeToString(deterministic=True)
    try:
        check_graph(data)
    except BundleError as error:
        raise ExportError(f"the exported graph would be refused: {error}") from error
    return data


def _strip(graph: onnx.GraphProto) -> None:
    """Remove doc strings and metadata, which hold source paths, from a graph and the bodies of its Scan and If."""
    for part in _with_bodies(graph):
        for items in ([part], part.node, part.initializer, part.input, part.output, part.value_info):
            for item in items:
                item.doc_string = ""
                del item.metadata_props[:]
        for node in part.node:
            for attribute in node.attribute:
                attribute.doc_string = ""


def _with_bodies(graph: onnx.GraphProto) -> Iterator[onnx.GraphProto]:
    """A graph and the bodies of its Scan and If, however deep."""
    yield graph
    for node in graph.node:
        for attribute in node.attribute:
            for body in (attribute.g, *attribute.graphs):
                if body.node:
                    yield from _with_bodies(body)


def _flatten(graph: onnx.GraphProto, ranks: Mapping[str, int]) -> None:
    """Store the weights (1, I, O) of products as (I, O): when it loads a graph, ONNX Runtime packs only matrices.

    ranks: the number of axes of each tensor in between. A factor of three axes or more keeps them in the product.
    """
    # the tensors by the names that nodes read them by: those in 16 bits by the name of their cast
    tensors = {tensor.name: tensor for tensor in graph.initializer}
    for node in graph.node:
        if node.op_type == "Cast" and node.input[0] in tensors:
            tensors[node.output[0]] = tensors[node.input[0]]
    for name in _factors(graph.node, ranks) & tensors.keys():
        if len(tensors[name].dims) == 3 and tensors[name].dims[0] == 1:
            del tensors[name].dims[0]
    # shapes that were inferred before
    kept = [value for value in graph.value_info if value.name not in tensors]
    del graph.value_info[:]
    graph.value_info.extend(kept)


def _factors(nodes: Iterable[onnx.NodeProto], ranks: Mapping[str, int]) -> set[str]:
    """What nodes read only as the second factor of a product whose first one has three axes or more."""
    factors: set[str] = set()
    others: set[str] = set()
    for node in nodes:
        is_product = node.op_type == "MatMul" and ranks.get(node.input[0], 0) > 2
        (factors if is_product else others).update(node.input[1:])
        if node.op_type != "Cast":
            others.add(node.input[0] if node.input else "")
        for attribute in node.attribute:
            for inner in attribute.g.node:
                others.update(inner.input)
    return factors - others


def _ranks(model: onnx.ModelProto) -> dict[str, int]:
    """The number of axes of each tensor between a graph's inputs and outputs."""
    values = onnx.shape_inference.infer_shapes(model).graph.value_info
    return {value.name: len(value.type.tensor_type.shape.dim) for value in values}


def renewed(model: bytes) -> bytes:
    """A graph as it would be stored today, with the same weights."""
    return _stored(model, lambda _: None)


def apart(models: Mapping[str, bytes]) -> tuple[dict[str, bytes], bytes]:
    """Graphs by name without the weights that several of them hold, and these as a model of their own; b"" for none.

    The bytes of such a graph with those of the weights behind them are the whole graph: protocol buffers merge.
    """
    protos = {name: onnx.load_from_string(model) for name, model in models.items()}
    shared = _shared(protos.values())
    weights = onnx.ModelProto()
    names: dict[Content, str] = {}
    for proto in protos.values():
        for tensor in [tensor for tensor in proto.graph.initializer if _content(tensor) in shared]:
            new = names.setdefault(_content(tensor), f"shared.{tensor.name}")
            proto.graph.initializer.remove(tensor)
            _rename(proto.graph, tensor.name, new)
    for content, name in names.items():
        weights.graph.initializer.add(name=name, data_type=content[0], dims=content[1], raw_data=content[2])
    rest = {name: proto.SerializeToString(deterministic=True) for name, proto in protos.items()}
    return rest, weights.SerializeToString(deterministic=True)


def _shared(models: Iterable[onnx.ModelProto]) -> set[Content]:
    """The large weights that several models hold, whatever they call them: the exporter makes up names."""
    holders = Counter[Content]()
    for model in models:
        holders.update({_content(tensor) for tensor in model.graph.initializer})
    return {content for content, count in holders.items() if count > 1 and len(content[-1]) >= SMALLEST_SHARED}


def _content(tensor: onnx.TensorProto) -> Content:
    return tensor.data_type, tuple(tensor.dims), tensor.raw_data


def _rename(graph: onnx.GraphProto, old: str, new: str) -> None:
    """Give a weight another name in all nodes that read it."""
    for part in _with_bodies(graph):
        for node in part.node:
            node.input[:] = [new if name == old else name for name in node.input]


@torch.no_grad()
def round_weights(net: nn.Module) -> None:
    """Round a net's weights to half precision, so that its graphs can be stored in 16 bits without loss."""
    for parameter in net.parameters():
        if parameter.numel() >= SMALLEST_QUANTISED:
            parameter.copy_(parameter.half().float())


def halved(model: bytes, rounded: bool = False) -> bytes:
    """A graph that stores those weights in 16 bits that lose nothing by it; they are cast to 32 when it is loaded.

    rounded: store all weights in 16 bits that are in their range.
    """

    def smaller(values: Floats) -> Small | None:
        with np.errstate(over="ignore"):
            half = values.astype(np.float16)
        kept = np.isfinite(half).all() if rounded else np.array_equal(half.astype(np.float32), values)
        return (half, None) if kept else None

    return _stored(model, smaller)


def quantised(model: bytes) -> bytes:
    """An exported graph that stores its matrices in int8, each row with a scale of its own; vectors stay in float32.

    Products stay in float32, too: products of 8 bits saturate on processors without VNNI, so that results would differ
    between machines, and a row's result would depend on the other rows of its batch.
    """

    def smaller(values: Floats) -> Small | None:
        if values.squeeze().ndim < 2 or not np.isfinite(values).all():
            return None
        scale = np.abs(values).max(axis=-1, keepdims=True) / np.float32(127)
        scale[scale == 0] = 1
        return np.rint(values / scale).astype(np.int8), scale

    return _stored(model, smaller, weights="int8")


def _stored(model: bytes, smaller: Callable[[Floats], Small | None], **label: str) -> bytes:
    """A graph whose large float32 tensors are stored as ``smaller`` makes them, or unchanged where that is None.

    ONNX Runtime casts and scales them once, when it loads the graph. label: more metadata.
    """
    proto = onnx.load_from_string(model)
    nodes = []
    # the new nodes come first: a graph's nodes are sorted by dependence
    for tensor in list(proto.graph.initializer):
        if tensor.data_type != TensorProto.FLOAT or np.prod(tensor.dims) < SMALLEST_QUANTISED:
            continue
        stored = smaller(numpy_helper.to_array(tensor))
        if stored is not None:
            nodes += _replace_tensor(proto.graph, tensor, *stored)
    nodes += proto.graph.node
    del proto.graph.node[:]
    proto.graph.node.extend(nodes)
    metadata = {prop.key: prop.value for prop in proto.metadata_props}
    return self_contained(proto, {**metadata, **label})


def _replace_tensor(
    graph: onnx.GraphProto, tensor: onnx.TensorProto, small: NDArray[Any], scale: Floats | None
) -> list[onnx.NodeProto]:
    """Store a tensor in a smaller type; the nodes that compute the original one from it."""
    name = tensor.name
    small_name = f"{name}.small"
    tensor.CopyFrom(numpy_helper.from_array(small, small_name))
    cast_name = name if scale is None else f"{name}.cast"
    nodes = [helper.make_node("Cast", [small_name], [cast_name], to=TensorProto.FLOAT)]
    if scale is not None:
        scale_name = f"{name}.scale"
        graph.initializer.append(numpy_helper.from_array(scale, scale_name))
        nodes.append(helper.make_node("Mul", [cast_name, scale_name], [name]))
    return nodes
