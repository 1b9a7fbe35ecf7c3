"""8-bit weights: a bundle of a quarter of the size, and what that changes in complete runs."""

import logging
import tempfile
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from onnxruntime.quantization import QuantType, quantize_dynamic

from motet.bundle.graph import Graph
from motet.bundle.manifest import Manifest
from motet_export.decoded import whole_runs
from motet_export.exporter import self_contained

OPERATORS = ["MatMul", "Gemm", "Gather"]
"""Products, and the look-up of word vectors."""


def quantised(model: bytes) -> bytes:
    """An exported graph with weights of products in int8; what goes into a product is quantised as it comes."""
    proto = onnx.load_from_string(model)
    metadata = {entry.key: entry.value for entry in proto.metadata_props}
    del proto.graph.value_info[:]  # the quantiser turns weights round, and the shapes noted here would contradict it
    logging.getLogger().addFilter(_without_advice)  # that each graph be pre-processed, which the exporter did
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "int8.onnx"
            # a scan's body is a graph within the graph; without the notes on shapes some types are not found
            options = {"EnableSubgraph": True, "DefaultTensorType": onnx.TensorProto.FLOAT}
            quantize_dynamic(
                proto, path, op_types_to_quantize=OPERATORS, weight_type=QuantType.QInt8, extra_options=options
            )
            return self_contained(onnx.load(path), {**metadata, "weights": "int8"})
    finally:
        logging.getLogger().removeFilter(_without_advice)


def difference(manifest: Manifest, int8: Mapping[str, Graph], exact: Mapping[str, Graph]) -> dict[str, float]:
    """What int8 changes in the runs of the parity ladder, for the manifest.

    "<run>.equal": share of the decoded sentences that are the same. "<run>.score": mean |difference| of the
    log-likelihoods of known pairs, in units of their mean |value|. "<run>.frames", where nothing but frames is decoded:
    their mean |difference|.
    """
    report: dict[str, float] = {}
    for name, run in whole_runs(manifest, int8, exact).items():
        found, expected = run()
        if "words" in found and found["words"].shape == expected["words"].shape:
            report[f"{name}.equal"] = float((found["words"] == expected["words"]).all(axis=1).mean())
        if "scores" in found:
            off = np.abs(found["scores"] - expected["scores"]).mean() / np.abs(expected["scores"]).mean()
            report[f"{name}.score"] = float(off)
        if set(found) == {"frames"}:
            report[f"{name}.frames"] = float(np.abs(found["frames"] - expected["frames"]).mean())
    return report


def _without_advice(record: logging.LogRecord) -> bool:
    return "pre-processing before quantization" not in record.getMessage()
