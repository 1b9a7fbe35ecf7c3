"""A graph that could reach outside of its bytes never becomes a session."""

from pathlib import Path

import numpy as np
import onnxruntime
import pytest
from wire import EXTERNAL, doubling, field, graph, model, node, tensor, varint

from motet.bundle.graph import GraphSpec, OnnxGraph, SessionOptions, TensorSpec
from motet.bundle.graph_safety import MAX_FIELDS, MAX_TEXT, check_graph
from motet.errors import BundleError

SPEC = GraphSpec((TensorSpec("x", ("batch", 3)),), (TensorSpec("y", ("batch", 3)),))
TWICE = node("Mul", ["x", "w"], ["y"])


def test_a_graph_by_hand_runs() -> None:
    found = OnnxGraph(doubling(), SPEC)({"x": np.ones((2, 3), np.float32)})
    np.testing.assert_array_equal(found["y"], np.full((2, 3), 2.0))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 1e38, -1e10])
def test_outputs_that_are_not_finite_are_refused(value: float) -> None:
    lying = OnnxGraph(doubling(weight=tensor("w", values=np.full(3, value, np.float32).tobytes())), SPEC)
    with pytest.raises(BundleError, match="the graph's output 'y' is not finite"):
        lying({"x": np.ones((2, 3), np.float32)})


def body(inner: bytes, number: int = 6) -> bytes:
    """An attribute that holds a message: by default a graph."""
    return field(5, field(1, "body") + field(number, inner))


@pytest.mark.parametrize(
    ("bad", "reason"),
    [
        (doubling(weight=tensor("w", EXTERNAL, values=b"")), "the graph, tensor 'w' has its data in another file"),
        (doubling(weight=tensor("w", field(14, 1))), "tensor 'w' has its data in another file"),
        (doubling(weight=tensor("w", field(14, 2**32 + 1))), "tensor 'w' has its data in another file"),
        (doubling(weight=tensor("w", field(14, b"\1"))), "tensor 'w' has its data in another file"),
        (
            doubling(body(graph([], [tensor("inner", EXTERNAL)]))),
            "node 'the_Mul', attribute 'body', graph 'main', tensor 'inner' has its data in another file",
        ),
        (doubling(body(graph([], [tensor("inner", EXTERNAL)]), 11)), "tensor 'inner' has its data in another file"),
        (doubling(body(tensor("value", EXTERNAL), 5)), "attribute 'body', tensor 'value' has its data"),
        (doubling(body(tensor("value", EXTERNAL), 10)), "attribute 'body', tensor 'value' has its data"),
        (doubling(body(field(1, tensor("sparse", EXTERNAL)), 22)), "tensor 'sparse' has its data in another file"),
        (doubling(body(field(2, tensor("places", EXTERNAL)), 23)), "tensor 'places' has its data in another file"),
        (
            model(graph([TWICE], [tensor("w")]) + field(15, field(1, tensor("s", EXTERNAL)))),
            "tensor 's' has its data in another file",
        ),
        (model(graph([TWICE], [tensor("w")]), field(7, field(5, tensor("w", EXTERNAL)))), "'w' has its data in"),
        (doubling(field(7, "com.microsoft")), "node 'the_Mul' needs operators of the domain 'com.microsoft'"),
        (model(graph([TWICE], [tensor("w")]), field(8, field(1, "my.own"))), "operators of the domain 'my.own'"),
        (model(graph([TWICE], [tensor("w")]), field(25, field(1, "f"))), "the graph holds functions"),
        (model(graph([TWICE], [tensor("w")]), field(20, b"")), "holds training information"),
        (model(graph([TWICE], [tensor("w")]), field(99, b"")), "has the unknown field 99"),
        (doubling()[:-1], "truncated"),
        (doubling() + b"\x0b", "wire type 3"),
        (doubling() + b"\0", "invalid number"),
        (doubling() + varint(1 << 35) + b"\0", "invalid number"),
        (doubling() + b"\xff" * 10, "unterminated"),
        (doubling() + field(7, 1), "a number where a message belongs"),
        (doubling(field(7, b"\xff")), "is not UTF-8"),
        (bytes(1000), "invalid number"),
        (model(graph([node("Loop", ["n", "c", "x"], ["y"])], [])), "node 'the_Loop' may never end"),
        (doubling(body(graph([node("Loop", ["n", "c", "x"], ["y"])], []))), "node 'the_Loop' may never end"),
        (doubling() + field(6, "a" * (MAX_TEXT + 1)), "the graph has a text of 1048577 bytes"),
        (doubling(weight=tensor("w", field(12, "a" * (MAX_TEXT + 1)))), "'w' has a text of 1048577 bytes"),
        (b"\x12\x06abORTM" + doubling(), "ONNX Runtime's own format"),
    ],
)
def test_what_reaches_outside_is_refused(
    bad: bytes, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "weights.bin").write_bytes(np.full(3, 7, np.float32).tobytes())
    monkeypatch.chdir(tmp_path)  # where ONNX Runtime would find what the graph names
    with pytest.raises(BundleError, match=reason):
        OnnxGraph(bad, SPEC)


def test_a_session_takes_no_model_but_onnx(tmp_path: Path) -> None:
    """ONNX Runtime would find out the format by itself, and take its own, which nothing has checked."""
    options = onnxruntime.SessionOptions()
    options.optimized_model_filepath = str(tmp_path / "own")
    options.add_session_config_entry("session.save_model_format", "ORT")
    onnxruntime.InferenceSession(doubling(), options, ["CPUExecutionProvider"])
    own = (tmp_path / "own").read_bytes()
    assert own[4:8] == b"ORTM"
    onnxruntime.InferenceSession(own, providers=["CPUExecutionProvider"])
    with pytest.raises(Exception, match=r"(?i)protobuf parsing failed"):
        SessionOptions().session(own)


def test_nesting_and_size_are_bounded() -> None:
    inner = graph([TWICE], [tensor("w")])
    for _ in range(40):
        inner = graph([node("If", ["c"], ["y"], body(inner))], [])
    with pytest.raises(BundleError, match="nested more than 64"):
        check_graph(model(inner))
    with pytest.raises(BundleError, match=f"more than {MAX_FIELDS} fields"):
        check_graph(model(field(1, b"") * (MAX_FIELDS + 1)))
