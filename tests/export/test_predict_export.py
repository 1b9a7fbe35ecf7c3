"""A predictor as an ONNX bundle: what torch computes, for one figure and for many."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from predict_manifest import predict_manifest

from motet.models.load import load
from motet.predict.model import PredictModel
from motet_export.bundles import export_run
from motet_train.models.figure_predictor import FigurePredictor, FigurePredictorConfig
from motet_train.models.kinematics import VectorFigure
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

CHANNELS = 9


@pytest.fixture(scope="module")
def run() -> Run:
    torch.manual_seed(0)
    bones = ((0, 1, 0), (0, 0.3, 0), (0.1, 0.2, 0))
    figure = VectorFigure((-1, 0, 1), bones, (0, 1), (6, 7, 8), tuple(range(6)), partners=(0, 1, 2))
    config = FigurePredictorConfig(
        CHANNELS,
        figure,
        frames=6,
        hidden=12,
        doubts=True,
    )
    net = FigurePredictor(config)
    with torch.no_grad():
        for parameter in net.parameters():
            parameter.add_(0.03 * torch.randn_like(parameter))
    net.doubt.weight.uniform_(-0.5, 0.5)
    return Run({**predict_manifest("figure-trajectory", 3, 6), "config": asdict(config)}, net)


def test_the_bundle_predicts_what_torch_predicts(run: Run, tmp_path: Path) -> None:
    report = export_run(run, tmp_path / "x.zip")
    assert set(report["runs"]) >= {"horizon", "beyond"}
    for name, rung in report.items():
        if "bound" in rung:
            # bones that are aimed at points amplify rounding
            bound = {"encoder.one_step": 3e-4, "runs": 1e-4}.get(name, 1e-5)
            assert rung["error"] <= (rung["bound"] if name.endswith(".far") else bound), name
    bundle, torch_model = load(tmp_path / "x.zip"), run.bundle_model()
    assert isinstance(bundle, PredictModel)
    seeds = 0.3 * np.random.default_rng(0).normal(size=(7, 10, CHANNELS))
    np.testing.assert_allclose(bundle.next_frames(seeds, 15), torch_model.next_frames(seeds, 15), rtol=1e-4, atol=1e-4)
    np.testing.assert_array_equal(bundle.next_frames(seeds[:1], 15)[0], bundle.next_frames(seeds, 15)[0])
    motion = bundle.contract.features(seeds[0])
    found = bundle.predict(motion, append=True)
    assert (len(found), found.channels) == (16, motion.channels)
    np.testing.assert_allclose(found.values[10:], bundle.next_frames(seeds[:1])[0], atol=1e-6)
    errors = bundle.expected_errors([bundle.contract.features(seed) for seed in seeds])
    np.testing.assert_allclose(errors, 100 * net_errors(run, seeds), rtol=1e-4)
    np.testing.assert_array_equal(bundle.expected_errors(motion), errors[0])


@torch.no_grad()
def net_errors(run: Run, seeds: NDArray[np.float64]) -> NDArray[np.float32]:
    """What torch expects, in metres."""
    frames = torch.from_numpy(seeds.astype(np.float32))
    found: NDArray[np.float32] = run.model.expected_error(frames, *run.model.with_disagreement(frames)).numpy()
    return found
