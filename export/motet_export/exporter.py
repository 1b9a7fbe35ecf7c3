"""From a torch module to the bytes of an ONNX graph that keeps a contract, its weights in 32 bits, 16 or 8."""

import logging
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
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

LEAST = 256
"""Numbers of a tensor that is worth it."""

Small = tuple[NDArray[Any], Floats | None]
"""A tensor in a smaller type, and what its numbers are to be multiplied by."""


class ExportError(MotetError, RuntimeError):
    """A model that does not export, or whose graph does not compute what torch computes."""


def export_graph(module: nn.Module, spec: GraphSpec, metadata: Mapping[str, str]) -> bytes:
    """Export ``module``, whose forward takes and gives the tensors of ``spec`` in order, as ONNX bytes.

    Dynamic axes are those that the contract names. ``metadata`` goes into the graph so that a single file is
    identifiable. Raises ExportError where the result is not a self-contained, valid ONNX model.
    """
    rng = np.random.default_rng(0)
    # a batch of 2: torch would take an axis of size 1 for a constant
    example = {tensor.name: torch.from_numpy(tensor.example(rng, batch=2)) for tensor in spec.inputs}
    dims = {name: torch.export.Dim(name) for one in spec.inputs for name in one.shape if isinstance(name, str)}
    shapes = {one.name: {n: dims[name] for n, name in enumerate(one.shape) if name in dims} for one in spec.inputs}
    # gradients off: torch does not export a scan over weights that ask for them
    with warnings.catch_warnings(), _log_silenced(), torch.no_grad():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            module.eval(),
            (),
            kwargs=example,
            input_names=[tensor.name for tensor in spec.inputs],
            output_names=[tensor.name for tensor in spec.outputs],
            dynamic_shapes=shapes,
            dynamo=True,
            external_data=False,
            opset_version=18,
            verbose=False,
        )
    if program is None:
        raise ExportError("torch gave no ONNX program")
    return self_contained(program.model_proto, metadata)


@contextmanager
def _log_silenced() -> Iterator[None]:
    """Only errors of the exporter are logged."""
    loggers = [logging.getLogger(name) for name in ("torch.onnx", "onnxscript", "onnx_ir")]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def self_contained(model: onnx.ModelProto, metadata: Mapping[str, str]) -> bytes:
    """Strip what names the building machine, annotate, check; the bytes of a model that needs no other file."""
    graph = model.graph
    model.doc_string = graph.doc_string = ""
    # doc strings and metadata of nodes hold source paths
    for items in (graph.node, graph.initializer, graph.input, graph.output, graph.value_info):
        for item in items:
            item.doc_string = ""
            del item.metadata_props[:]
    del graph.metadata_props[:], model.metadata_props[:]
    for key, value in metadata.items():
        model.metadata_props.add(key=key, value=value)
    # the first IR version that has the opset, which every ONNX Runtime from 1.14 on reads
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
