"""The published predictors as ONNX graphs: what torch computes, call by call, over a free run, and in a bundle."""

from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from predict_manifest import predict_manifest

from motet.bundle.graph import OnnxGraph
from motet.models.load import load
from motet.predict.free_run import free_run
from motet.predict.model import PredictModel
from motet_export.bundles import export_run
from motet_export.exporter import apart, export_graph
from motet_export.parity import check_carried, check_one_step
from motet_train.papers.li2018 import from_config, srnn
from motet_train.papers.li2018.recurrent import (
    LSTMAE,
    RRNN,
    EncoderRecurrentDecoder,
    LSTM3LRConfig,
    LSTMAEConfig,
    RRNNConfig,
)
from motet_train.papers.li2018.stepwise import Stepwise, System
from motet_train.runs import Run, TorchGraph

pytestmark = pytest.mark.slow  # torch's exporter

SEED, CHANNELS = 6, 7
KEPT = (0, 1, 3, 4, 6)
LSTMS_OF_SRNN = len(srnn.EDGES) + len(srnn.NODES)
SYSTEMS: dict[str, Callable[[], System]] = {
    "rrnn": lambda: RRNN(RRNNConfig(5, 9)),
    "erd": lambda: EncoderRecurrentDecoder(LSTM3LRConfig(5, (7, 6), 2, 8, (7, 4), rectified=True)),
    "lstm_3lr, filtered": lambda: LSTMAE(LSTMAEConfig(5, (7,), 2, 6, autoencoder=(9, 4, 9))),
    "srnn": lambda: srnn.SRNN(srnn.Config(9, ((8, 0, 4), (1, 2), (5, 6), (3,), (7,)), linear=6, units=5, narrow=4)),
}


@pytest.mark.parametrize("kind", SYSTEMS)
def test_graphs_compute_what_torch_computes(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    torch.manual_seed(0)
    channels, kept = (11, (0, 1, 2, 4, 5, 6, 7, 9, 10)) if kind == "srnn" else (CHANNELS, KEPT)
    net = Stepwise(SYSTEMS[kind](), channels, kept, SEED).eval()
    net.mean += torch.randn(len(kept))
    net.scale += torch.rand(len(kept))
    if kind == "srnn":
        for parameter in net.parameters():
            parameter.data += 0.1 * torch.randn_like(parameter)
    graphs = net.graphs()
    files = {role: export_graph(module, spec, {"role": role}) for role, (module, spec) in graphs.items()}
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
        data = rest[role] + weights
        nodes = Counter(node.op_type for node in onnx.load_from_string(data).graph.node)
        if kind == "srnn":
            assert nodes["LSTM"] == LSTMS_OF_SRNN
        if kind == "srnn" or role == "step":
            assert not {"Scan", "Loop", "If"} & nodes.keys()
        pairs[role] = OnnxGraph(data, spec), TorchGraph(module, spec)
        check_one_step(role, *pairs[role])
    check_carried(*pairs["step"])
    for rows in (1, 3):
        seed = np.random.default_rng(0).normal(size=(rows, SEED, channels)).astype(np.float32)
        found, expected = (free_run(*run, seed, 20, 10) for run in zip(pairs["encoder"], pairs["step"], strict=True))
        np.testing.assert_allclose(found, expected, atol=1e-5)
        again = free_run(pairs["encoder"][0], pairs["step"][0], seed, 25, 25)
        with torch.no_grad():
            np.testing.assert_allclose(again, net(torch.from_numpy(seed), 25).numpy(), atol=1e-5)
        dropped = [channel for channel in range(channels) if channel not in kept]
        np.testing.assert_array_equal(found[:, :, dropped], np.repeat(seed[:, -1:, dropped], 20, axis=1))


def test_a_bundle_of_the_convolutional_one_predicts_what_torch_predicts(tmp_path: Path) -> None:
    torch.manual_seed(0)
    system = {"dimensions": 45, "filters": [3, 4, 5], "units": 8}
    config = {"channels": 48, "kept": list(range(3, 48)), "seed_frames": 50, "system": system}
    net = from_config("convseq2seq", config)
    net.mean.copy_(torch.randn(45)), net.scale.copy_(torch.rand(45) + 0.5)
    export_run(Run({**predict_manifest("convseq2seq", 16, 25), "config": config}, net), tmp_path / "x.zip")
    bundle = load(tmp_path / "x.zip")
    assert isinstance(bundle, PredictModel)
    seeds = np.random.default_rng(0).normal(size=(3, 50, 48)).astype(np.float32)
    found = bundle.next_frames(seeds)
    with torch.no_grad():
        np.testing.assert_allclose(found, net(torch.from_numpy(seeds), 25), atol=1e-4)
    np.testing.assert_array_equal(found[:, :, :3], np.repeat(seeds[:, -1:, :3], 25, axis=1))
    np.testing.assert_array_equal(bundle.next_frames(seeds[:1])[0], found[0])
