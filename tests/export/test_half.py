"""Weights in 16 bits: half the size, and the very same numbers out."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from click.testing import CliRunner
from torch import nn

from motet.bundle.bundle import Bundle, list_bundles
from motet.bundle.graph import GraphSpec, OnnxGraph, TensorSpec
from motet.cli import main
from motet.models.load import load_as, verify
from motet.papers.tdbn_control import TdbnModel
from motet_export.exporter import export_graph, halved, round_weights

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
    done = CliRunner().invoke(main, ["export", str(exact), "--half", "-o", str(tmp_path / "half.zip")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "half.zip").stat().st_size < 0.62 * exact.stat().st_size
    small = load_as(TdbnModel, tmp_path / "half.zip")
    assert small.manifest.parity["weights"] == "float16"
    assert small.manifest.quality == load_as(TdbnModel, exact).manifest.quality
    frames = [model.run("walk 1s", smooth=False).values for model in (small, load_as(TdbnModel, exact))]
    assert 0 < np.abs(frames[0][:, 3:] - frames[1][:, 3:]).mean() < 0.5  # degrees
    assert max(verify(Bundle.open(tmp_path / "half.zip")).errors.values()) == 0


def test_a_bundle_is_written_anew_with_the_same_weights(tmp_path: Path) -> None:
    before = Bundle.open("tdbn")
    done = CliRunner().invoke(main, ["export", str(before.path), "--golden", "-o", str(tmp_path / "again.zip")])
    assert done.exit_code == 0, done.output
    again = Bundle.open(tmp_path / "again.zip")
    assert max(verify(again).errors.values()) == 0
    assert {**again.manifest.source, "files": 0} == {**before.manifest.source, "files": 0}
    for role in before.manifest.graphs:
        old, new = (onnx.load_from_string(bundle.model(role)).graph.initializer for bundle in (before, again))
        assert [(one.name, one.raw_data) for one in new] == [(one.name, one.raw_data) for one in old]
