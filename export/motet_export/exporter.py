"""From a torch module to the bytes of an ONNX graph that keeps a contract; all settings of the exporter are here."""

import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

import numpy as np
import onnx
import torch
from torch import nn

from motet.bundle.graph import GraphSpec
from motet.bundle.graph_safety import check_graph
from motet.errors import BundleError, MotetError

OPSET = 18
MAX_IR_VERSION = 8
"""The first IR version that has the opset, which every ONNX Runtime from 1.14 on reads."""


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
    # gradients off: torch does not export a scan over weights that ask for them
    with warnings.catch_warnings(), _log_silenced(), torch.no_grad():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            module.eval(),
            (),
            kwargs=example,
            input_names=[tensor.name for tensor in spec.inputs],
            output_names=[tensor.name for tensor in spec.outputs],
            dynamic_shapes=_dynamic_shapes(spec),
            dynamo=True,
            external_data=False,
            opset_version=OPSET,
            verbose=False,
        )
    if program is None:
        raise ExportError("torch gave no ONNX program")
    return self_contained(program.model_proto, metadata)


def self_contained(model: onnx.ModelProto, metadata: Mapping[str, str]) -> bytes:
    """Strip what names the building machine, annotate, check; the bytes of a model that needs no other file."""
    strip(model)
    del model.metadata_props[:]
    for key, value in metadata.items():
        model.metadata_props.add(key=key, value=value)
    model.ir_version = min(model.ir_version, MAX_IR_VERSION)
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


def strip(model: onnx.ModelProto) -> None:
    """Remove doc strings and node metadata, which hold source paths of the building machine."""
    graph = model.graph
    model.doc_string = graph.doc_string = ""
    for items in (graph.node, graph.initializer, graph.input, graph.output, graph.value_info):
        for item in items:
            item.doc_string = ""
            del item.metadata_props[:]
    del graph.metadata_props[:]


def _dynamic_shapes(spec: GraphSpec) -> dict[str, dict[int, torch.export.Dim]]:
    names = {axis for tensor in spec.inputs for axis in tensor.shape if isinstance(axis, str)}
    axes = {name: torch.export.Dim(name) for name in names}
    return {
        tensor.name: {i: axes[axis] for i, axis in enumerate(tensor.shape) if isinstance(axis, str)}
        for tensor in spec.inputs
    }


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
