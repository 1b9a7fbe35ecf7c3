"""The recurrent systems' encoder and step as ONNX graphs: what torch computes, call by call and over a free run."""

from collections.abc import Callable

import numpy as np
import onnx
import pytest
import torch

from motet.bundle.graph import OnnxGraph
from motet.predict.free_run import free_run
from motet_export.exporter import apart, export_graph
from motet_export.parity import check_carried, check_one_step
from motet_train.papers.li2018.recurrent import (
    LSTMAE,
    RRNN,
    EncoderRecurrentDecoder,
    ERDConfig,
    LSTMAEConfig,
    RRNNConfig,
)
from motet_train.papers.li2018.stepwise import Stepwise, System
from motet_train.runs import TorchGraph

pytestmark = pytest.mark.slow  # torch's exporter

SEED, CHANNELS = 6, 7
KEPT = (0, 1, 3, 4, 6)
SYSTEMS: dict[str, Callable[[], System]] = {
    "rrnn": lambda: RRNN(RRNNConfig(5, 9)),
    "erd": lambda: EncoderRecurrentDecoder(ERDConfig(5, (7, 6), 2, 8, (7, 4))),
    "lstm_3lr, filtered": lambda: LSTMAE(LSTMAEConfig(5, (7,), 2, 6, autoencoder=(9, 4, 9))),
}


@pytest.mark.parametrize("kind", SYSTEMS)
def test_graphs_compute_what_torch_computes(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    net = Stepwise(SYSTEMS[kind](), CHANNELS, KEPT, SEED).eval()
    net.mean += torch.randn(5)
    net.scale += torch.rand(5)
    graphs = net.graphs()
    files = {role: export_graph(module, spec, {"role": role}) for role, (module, spec) in graphs.items()}
    assert not {"Scan", "Loop", "If"} & {node.op_type for node in onnx.load_from_string(files["step"]).graph.node}
    # weights of both graphs are stored once
    monkeypatch.setattr("motet_export.exporter.SMALLEST_SHARED", 64)
    rest, weights = apart(files)
    shared = {tensor.name for tensor in onnx.load_from_string(weights).graph.initializer}
    left = [{tensor.name for tensor in onnx.load_from_string(data).graph.initializer} for data in rest.values()]
    assert len(shared) >= 3
    assert not shared & (left[0] | left[1])
    assert apart(rest) == (rest, b"")
    pairs = {}
    for role, (module, spec) in graphs.items():
        pairs[role] = OnnxGraph(rest[role] + weights, spec), TorchGraph(module, spec)
        check_one_step(role, *pairs[role])
    check_carried(*pairs["step"])
    seed = np.random.default_rng(0).normal(size=(3, SEED, CHANNELS)).astype(np.float32)
    found, expected = (free_run(*run, seed, 20, 10) for run in zip(pairs["encoder"], pairs["step"], strict=True))
    np.testing.assert_allclose(found, expected, atol=1e-5)
    again = free_run(pairs["encoder"][0], pairs["step"][0], seed, 10, 10)
    with torch.no_grad():
        np.testing.assert_allclose(again, net(torch.from_numpy(seed), 10).numpy(), atol=1e-5)
    np.testing.assert_array_equal(found[:, :, [2, 5]], np.repeat(seed[:, -1:, [2, 5]], 20, axis=1))
