"""The check of graphs against ONNX's own definition: real graphs of each kind, and every field that could hide one."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
from onnx import TensorProto, helper, numpy_helper

from motet.bundle.graph_safety import MESSAGES, check_graph
from motet.errors import BundleError

PROTOS = {
    "model": onnx.ModelProto,
    "opset": onnx.OperatorSetIdProto,
    "graph": onnx.GraphProto,
    "node": onnx.NodeProto,
    "attribute": onnx.AttributeProto,
    "sparse": onnx.SparseTensorProto,
    "tensor": onnx.TensorProto,
}
SECRET = np.array([7.0], np.float32)


def outside(name: str) -> TensorProto:
    """A float32 (1,) whose number is in the file secret.bin."""
    tensor = TensorProto(name=name, data_type=TensorProto.FLOAT, dims=[1], data_location=TensorProto.EXTERNAL)
    tensor.external_data.add(key="location", value="secret.bin")
    return tensor


def info(name: str, kind: int = TensorProto.FLOAT, shape: tuple[int, ...] = (1,)) -> onnx.ValueInfoProto:
    return helper.make_tensor_value_info(name, kind, shape)


def model(nodes: list[onnx.NodeProto], tensors: list[TensorProto] | None = None) -> onnx.ModelProto:
    graph = helper.make_graph(nodes, "main", [info("x")], [info("y")], tensors or [])
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)


def plain() -> onnx.ModelProto:
    return model([helper.make_node("Add", ["x", "w"], ["y"], "sum")], [outside("w")])


def constant() -> onnx.ModelProto:
    nodes = [helper.make_node("Constant", [], ["w"], "hidden", value=outside("v"))]
    return model([*nodes, helper.make_node("Add", ["x", "w"], ["y"])])


def _branch(name: str, *tensors: TensorProto) -> onnx.GraphProto:
    return helper.make_graph(
        [helper.make_node("Identity", [tensors[0].name], ["out"])], name, [], [info("out")], tensors
    )


def conditional() -> onnx.ModelProto:
    branches = {
        "then_branch": _branch("then", outside("w")),
        "else_branch": _branch("else", numpy_helper.from_array(SECRET, "v")),
    }
    true = numpy_helper.from_array(np.array(True), "true")
    return model([helper.make_node("If", ["true"], ["y"], "choice", **branches)], [true])


def scan() -> onnx.ModelProto:
    body = helper.make_graph(
        [helper.make_node("Add", ["s", "w"], ["t"]), helper.make_node("Identity", ["i"], ["o"])],
        "body",
        [info("s"), info("i", shape=())],
        [info("t"), info("o", shape=())],
        [outside("w")],
    )
    return model([helper.make_node("Scan", ["x", "x"], ["y", "_"], "walk", body=body, num_scan_inputs=1)])


def loop() -> onnx.ModelProto:
    body = helper.make_graph(
        [helper.make_node("Add", ["s", "w"], ["t"]), helper.make_node("Identity", ["c"], ["d"])],
        "body",
        [info("i", TensorProto.INT64, ()), info("c", TensorProto.BOOL, ()), info("s")],
        [info("d", TensorProto.BOOL, ()), info("t")],
        [outside("w")],
    )
    tensors = [numpy_helper.from_array(np.array(1), "n"), numpy_helper.from_array(np.array(True), "true")]
    return model([helper.make_node("Loop", ["n", "true", "x"], ["y"], "again", body=body)], tensors)


def function() -> onnx.ModelProto:
    body = [helper.make_node("Constant", [], ["w"], value=outside("v")), helper.make_node("Add", ["a", "w"], ["b"])]
    found = model([helper.make_node("own", ["x"], ["y"], domain="mine")])
    found.opset_import.add(domain="mine", version=1)
    found.functions.append(helper.make_function("mine", "own", ["a"], ["b"], body, [helper.make_opsetid("", 18)]))
    return found


@pytest.mark.parametrize("build", [plain, constant, conditional, scan, function])
def test_data_outside_is_refused_wherever_it_hides(
    build: Callable[[], onnx.ModelProto], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each graph is one that onnx's own checker takes; ONNX Runtime itself is the proof that the danger is real."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "secret.bin").write_bytes(SECRET.tobytes())
    found = build()
    onnx.checker.check_model(found)
    if build is plain:
        options = onnxruntime.SessionOptions()
        options.graph_optimization_level = onnxruntime.GraphOptimizationLevel.ORT_DISABLE_ALL
        session = onnxruntime.InferenceSession(found.SerializeToString(), options, ["CPUExecutionProvider"])
        assert session.run(["y"], {"x": np.zeros(1, np.float32)})[0] == SECRET
    with pytest.raises(BundleError, match=r"has its data in another file|holds functions|of the domain 'mine'"):
        check_graph(found.SerializeToString())
    for tensor in _tensors(found.graph):
        tensor.CopyFrom(numpy_helper.from_array(SECRET, tensor.name))
    if build is not function:
        check_graph(found.SerializeToString())


def test_a_loop_is_refused() -> None:
    with pytest.raises(BundleError, match="node 'again' may never end"):
        check_graph(loop().SerializeToString())


def _tensors(graph: onnx.GraphProto) -> list[TensorProto]:
    found = list(graph.initializer)
    for attribute in (attribute for node in graph.node for attribute in node.attribute):
        found += [attribute.t] if attribute.HasField("t") else []
        found += _tensors(attribute.g) if attribute.HasField("g") else []
    return found


def test_a_foreign_operator_is_refused() -> None:
    found = model([helper.make_node("Gelu", ["x"], ["y"], "curve", domain="com.microsoft")])
    with pytest.raises(BundleError, match=r"node 'curve' needs operators of the domain 'com.microsoft'"):
        check_graph(found.SerializeToString())


@pytest.mark.parametrize("kind", MESSAGES)
def test_no_field_of_onnx_can_hide_a_tensor_or_a_node(kind: str) -> None:
    """By ONNX's descriptors: a plain field holds neither, however deep, and nested ones are what the table says."""

    def holds(message: object, seen: frozenset[str] = frozenset()) -> bool:
        if message is None or message.full_name in seen:  # type: ignore[attr-defined]
            return False
        if message.name in {"TensorProto", "NodeProto", "SparseTensorProto"}:  # type: ignore[attr-defined]
            return True
        inner = seen | {message.full_name}  # type: ignore[attr-defined]
        return any(holds(field.message_type, inner) for field in message.fields)  # type: ignore[attr-defined]

    known = {field.number: field for field in PROTOS[kind].DESCRIPTOR.fields}
    assert not [known[n].name for n in MESSAGES[kind].plain if holds(known[n].message_type)]
    for number, inner in MESSAGES[kind].nested.items():
        assert known[number].message_type.name == PROTOS[inner].DESCRIPTOR.name
    for number, name in ((MESSAGES[kind].name, "name"), (MESSAGES[kind].domain, "domain")):
        assert not number or known[number].name == name
