"""The structural RNN's encoder and step as ONNX graphs: what torch computes, over a free run."""

import numpy as np
import onnx
import pytest
import torch

from motet.bundle.graph import OnnxGraph
from motet.predict.free_run import free_run
from motet_export.exporter import export_graph
from motet_train.papers.li2018.srnn import EDGES, NODES, SRNN, Config
from motet_train.papers.li2018.stepwise import Stepwise
from motet_train.runs import TorchGraph

pytestmark = pytest.mark.slow  # torch's exporter

SEED, CHANNELS = 7, 11
KEPT = (0, 1, 2, 4, 5, 6, 7, 9, 10)
CONFIG = Config(9, ((8, 0, 4), (1, 2), (5, 6), (3,), (7,)), linear=6, units=5, narrow=4)


@pytest.fixture(scope="module")
def net() -> Stepwise:
    torch.manual_seed(0)
    net = Stepwise(SRNN(CONFIG), CHANNELS, KEPT, SEED)
    net.mean += torch.randn(9)
    net.scale += torch.rand(9)
    for parameter in net.parameters():
        parameter.data += 0.1 * torch.randn_like(parameter)
    return net


@pytest.fixture(scope="module")
def exported(net: Stepwise) -> dict[str, bytes]:
    return {role: export_graph(module, spec, {"role": role}) for role, (module, spec) in net.graphs().items()}


@pytest.mark.parametrize("rows", [1, 3])
def test_a_free_run_is_that_of_torch(net: Stepwise, exported: dict[str, bytes], rows: int) -> None:
    graphs = net.graphs()
    seed = np.random.default_rng(0).normal(size=(rows, SEED, CHANNELS)).astype(np.float32)
    onnx_pair = [OnnxGraph(exported[role], graphs[role][1]) for role in ("encoder", "step")]
    torch_pair = [TorchGraph(*graphs[role]) for role in ("encoder", "step")]
    found = free_run(onnx_pair[0], onnx_pair[1], seed, 25, 25)
    np.testing.assert_allclose(found, free_run(torch_pair[0], torch_pair[1], seed, 25, 25), atol=1e-5)
    with torch.no_grad():
        np.testing.assert_allclose(found, net(torch.from_numpy(seed), 25).numpy(), atol=1e-5)


def test_each_rnn_is_one_node_of_either_graph(exported: dict[str, bytes]) -> None:
    for data in exported.values():
        kinds = [node.op_type for node in onnx.load_from_string(data).graph.node]
        assert kinds.count("LSTM") == len(EDGES) + len(NODES)
        assert not {"Scan", "Loop", "If"} & set(kinds)
