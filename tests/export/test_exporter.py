"""The exporter and the ladder on a model small enough to see through."""

import numpy as np
import onnx
import pytest
import torch
from test_real_graph_safety import info
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec, OnnxGraph, TensorSpec
from motet_export.exporter import ExportError, export_graph, halved, round_weights, self_contained
from motet_export.parity import check_carried, check_one_step, error
from motet_train.runs import TorchGraph

pytestmark = pytest.mark.slow  # torch's exporter

SPEC = GraphSpec(
    inputs=(TensorSpec("state", ("batch", 4)), TensorSpec("push", ("batch", 3))),
    outputs=(TensorSpec("frame", ("batch", 2)), TensorSpec("next_state", ("batch", 4))),
    feedback={"state": "next_state"},
)


class Cell(nn.Module):
    """A leaky recurrent unit with an output."""

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.turn, self.push, self.out = nn.Linear(4, 4), nn.Linear(3, 4), nn.Linear(4, 2)

    def forward(self, state: Tensor, push: Tensor) -> tuple[Tensor, Tensor]:
        state = torch.tanh(self.turn(state) + self.push(push))
        return self.out(state), state


@pytest.fixture(scope="module")
def exported() -> bytes:
    return export_graph(Cell(), SPEC, {"motet": "test", "role": "step"})


def test_a_graph_is_dynamic_annotated_and_stripped(exported: bytes) -> None:
    model = onnx.load_from_string(exported)
    assert model.ir_version <= 8
    assert [(i.domain, i.version) for i in model.opset_import] == [("", 18)]
    assert {p.key: p.value for p in model.metadata_props} == {"motet": "test", "role": "step"}
    assert not any(node.metadata_props or node.doc_string for node in model.graph.node)
    assert b".py" not in exported
    assert exported == export_graph(Cell(), SPEC, {"motet": "test", "role": "step"})


def test_a_graph_computes_what_torch_computes_at_any_batch(exported: bytes) -> None:
    pair = OnnxGraph(exported, SPEC), TorchGraph(Cell(), SPEC)
    assert check_one_step("step", *pair)["error"] <= 1e-6
    assert check_carried(*pair)["error"] <= 1e-5


def test_another_model_fails_the_ladder(exported: bytes) -> None:
    cell, graph = Cell(), OnnxGraph(exported, SPEC)
    with torch.no_grad():
        cell.turn.weight += 1e-3
    with pytest.raises(ExportError, match="one_step"):
        check_one_step("step", graph, TorchGraph(cell, SPEC))
    with pytest.raises(ExportError, match="carried"):
        check_carried(graph, TorchGraph(cell, SPEC))


def test_the_contract_is_the_first_rung(exported: bytes) -> None:
    other = GraphSpec(SPEC.inputs, SPEC.outputs)
    with pytest.raises(ExportError, match="contracts differ"):
        check_one_step("step", OnnxGraph(exported, SPEC), TorchGraph(Cell(), other))


def test_what_is_not_finite_has_no_error() -> None:
    with pytest.raises(ExportError, match="not finite"):
        error({"a": np.array([np.nan])}, {"a": np.array([0.0])})


class Stacked(nn.Module):
    """Products with a stack of one matrix: of a stack of rows, and of the rows alone, whose product gets an axis."""

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(0)
        self.packed, self.spread = nn.Parameter(torch.randn(1, 4, 4)), nn.Parameter(torch.randn(1, 3, 4))

    def forward(self, state: Tensor, push: Tensor) -> tuple[Tensor, Tensor]:
        next_state = (state[None] @ self.packed + push @ self.spread)[0]
        return next_state[:, :2], next_state


@pytest.mark.parametrize("half", [False, True])
def test_a_stack_of_one_matrix_is_stored_as_a_matrix(half: bool) -> None:
    # large enough to be stored in 16 bits
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("motet_export.exporter.SMALLEST_QUANTISED", 12)
        net = Stacked()
        round_weights(net)
        data = export_graph(net, SPEC, {})
        if half:
            data = halved(data)
    shapes = {tensor.name: list(tensor.dims) for tensor in onnx.load_from_string(data).graph.initializer}
    ending = ".small" if half else ""
    assert shapes[f"packed{ending}"] == [4, 4]
    assert shapes[f"spread{ending}"] == [1, 3, 4]
    assert check_one_step("step", OnnxGraph(data, SPEC), TorchGraph(net, SPEC))["error"] <= 1e-6


def test_the_bodies_of_loops_are_stripped(exported: bytes) -> None:
    helper = onnx.helper
    steps = [helper.make_node("Add", ["state", "x"], ["sum"]), helper.make_node("Identity", ["sum"], ["y"])]
    body = helper.make_graph(steps, "body", [info("state"), info("x")], [info("sum"), info("y")])
    body.node[0].metadata_props.add(key="pkg.torch.onnx.stack_trace", value='File "/home/me/net.py", line 1')
    scan = helper.make_node("Scan", ["start", "xs"], ["last", "ys"], num_scan_inputs=1, body=body)
    inputs = [info("start"), info("xs", shape=(5, 1))]
    outputs = [info("last"), info("ys", shape=(5, 1))]
    graph = helper.make_graph([scan], "graph", inputs, outputs)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    assert b".py" in model.SerializeToString()
    assert b".py" not in self_contained(model, {})
