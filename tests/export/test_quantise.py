"""Weights in 8 bits: against the rounding written out, and with no product that processors compute differently."""

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from motet.bundle.bundle import Bundle
from motet.bundle.graph import OnnxGraph
from motet_export.exporter import quantised


def rounded(values: np.ndarray) -> np.ndarray:
    """Each row on 255 levels from minus its largest number to that, one number at a time."""
    found = values.astype(np.float32)
    for row in found.reshape(-1, found.shape[-1]):
        step = max(abs(number) for number in row) / np.float32(127)
        row[:] = [round(float(number / step)) * step for number in row]
    return found


@pytest.fixture(scope="module")
def step() -> tuple[Bundle, bytes]:
    bundle = Bundle.open("tdbn")
    return bundle, bundle.read("step.onnx")


def test_matrices_are_rounded_row_by_row_and_the_rest_is_as_it_was(step: tuple[Bundle, bytes]) -> None:
    bundle, exact = step
    naive = onnx.load_from_string(exact)
    for tensor in naive.graph.initializer:
        values = numpy_helper.to_array(tensor)
        if values.dtype == np.float32 and values.ndim > 1 and values.size >= 256:
            tensor.CopyFrom(numpy_helper.from_array(rounded(values), tensor.name))
    spec = bundle.graph("step").spec
    feeds = {t.name: t.example(np.random.default_rng(0), batch=3) for t in spec.inputs}
    found = OnnxGraph(quantised(exact), spec)(feeds)
    for name, value in OnnxGraph(naive.SerializeToString(), spec)(feeds).items():
        np.testing.assert_allclose(found[name], value, atol=1e-5)
        assert np.abs(found[name] - OnnxGraph(exact, spec)(feeds)[name]).max() > 1e-4  # which is more than rounding


def test_a_quarter_of_the_bytes_and_no_product_of_integers(step: tuple[Bundle, bytes]) -> None:
    """Those of 8 bits saturate on some processors; what has only the operators of the exact graph cannot."""
    exact, small = step[1], quantised(step[1])
    assert len(small) < 0.3 * len(exact)
    before, after = ({node.op_type for node in onnx.load_from_string(data).graph.node} for data in (exact, small))
    assert after == before | {"Cast", "Mul"}
    assert quantised(exact) == small


def test_vectors_rows_of_zeros_and_masks_stay(step: tuple[Bundle, bytes]) -> None:
    rng = np.random.default_rng(0)
    tensors = {
        "vector": rng.normal(size=(1, 300)),
        "zeros": np.zeros((2, 300)),
        "mask": np.where(rng.random((2, 300)) < 0.5, -np.inf, 1.5),
        "small": rng.normal(size=(5, 5)),
        "matrices": rng.normal(size=(2, 3, 100)),
    }
    given = [numpy_helper.from_array(value.astype(np.float32), name) for name, value in tensors.items()]
    nodes = [helper.make_node("Identity", [name], [f"{name}.out"]) for name in tensors]
    outputs = [helper.make_tensor_value_info(f"{n}.out", TensorProto.FLOAT, v.shape) for n, v in tensors.items()]
    graph = helper.make_graph(nodes, "all", [], outputs, given)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10)
    found = ReferenceEvaluator(quantised(model.SerializeToString())).run(None, {})
    for (name, value), array in zip(tensors.items(), found, strict=True):
        if name == "matrices":
            np.testing.assert_allclose(array, rounded(value), rtol=1e-5)
            assert 0 < np.abs(array - value).max() < np.abs(value).max() / 250
        else:
            np.testing.assert_array_equal(array, value.astype(np.float32))
