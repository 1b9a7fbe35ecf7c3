"""Smaller weights: 16 bits give the very same numbers, 8 bits those of the rounding written out, on every processor."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator
from torch import nn
from trainings import done

from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import GraphSpec, OnnxGraph, TensorSpec
from motet.models.load import load_as, verify
from motet.papers.tdbn_control import TdbnModel
from motet_export.exporter import export_graph, halved, quantised, round_weights

SPEC = GraphSpec((TensorSpec("x", ("batch", 64)),), (TensorSpec("y", ("batch", 8)),))


class Net(nn.Module):
    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(64, 256), nn.ReLU(), nn.Linear(256, 8))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        found: torch.Tensor = self.layers(x)
        return found


@pytest.mark.slow
def test_rounded_weights_are_kept_in_half_the_bytes_and_give_the_same() -> None:
    torch.manual_seed(0)
    net = Net()
    exact = net.layers[0].weight.detach().clone()
    round_weights(net)
    assert 0 < (net.layers[0].weight - exact).abs().max() < 2**-11
    data = export_graph(net, SPEC, {"motet": "test"})
    small = halved(data)
    assert len(small) < 0.6 * len(data)
    x = np.random.default_rng(0).normal(size=(5, 64)).astype(np.float32)
    np.testing.assert_array_equal(OnnxGraph(small, SPEC)({"x": x})["y"], OnnxGraph(data, SPEC)({"x": x})["y"])


@pytest.mark.slow
def test_weights_that_would_lose_something_stay_as_they_are() -> None:
    torch.manual_seed(0)
    data = export_graph(Net(), SPEC, {"motet": "test"})
    assert len(halved(data)) > 0.9 * len(data)


@pytest.mark.slow
def test_a_bundle_is_written_anew_with_half_the_weights(tmp_path: Path) -> None:
    exact = list_bundles()["tdbn"]
    done("export", exact, "--half", "-o", tmp_path / "half.zip")
    assert (tmp_path / "half.zip").stat().st_size < 0.62 * exact.stat().st_size
    small = load_as(TdbnModel, tmp_path / "half.zip")
    assert small.manifest.parity["weights"] == "float16"
    assert small.manifest.quality == load_as(TdbnModel, exact).manifest.quality
    frames = [model.run("walk 1s", smooth=False).values for model in (small, load_as(TdbnModel, exact))]
    assert 0 < np.abs(frames[0][:, 3:] - frames[1][:, 3:]).mean() < 0.5  # degrees
    assert max(verify(Bundle.open(tmp_path / "half.zip")).errors.values()) == 0


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


def test_a_bundle_is_written_anew_with_the_same_weights(tmp_path: Path) -> None:
    before = Bundle.open("tdbn")
    done("export", before.path, "--golden", "-o", tmp_path / "again.zip")
    again = Bundle.open(tmp_path / "again.zip")
    assert max(verify(again).errors.values()) == 0
    assert {**again.manifest.source, "files": 0} == {**before.manifest.source, "files": 0}
    for role in before.manifest.graphs:
        old, new = (onnx.load_from_string(bundle.model(role)).graph.initializer for bundle in (before, again))
        assert [(one.name, one.raw_data) for one in new] == [(one.name, one.raw_data) for one in old]
