"""The convolutional predictor as an ONNX bundle: the runtime's free run gives what torch gives."""

from pathlib import Path

import numpy as np
import pytest
import torch
from predict_manifest import predict_manifest

from motet.models.load import load
from motet.predict.model import PredictModel
from motet_export.bundles import export_run
from motet_train.papers.li2018 import from_config
from motet_train.papers.li2018.stepwise import Stepwise
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

CHANNELS = 48
KEPT = range(3, 48)


def test_the_bundle_predicts_what_torch_predicts(tmp_path: Path) -> None:
    torch.manual_seed(0)
    system = {"dimensions": 45, "filters": [3, 4, 5], "units": 8}
    config = {"channels": CHANNELS, "kept": list(KEPT), "seed_frames": 50, "system": system}
    net = from_config("convseq2seq", config)
    net.mean.copy_(torch.randn(45)), net.scale.copy_(torch.rand(45) + 0.5)
    run = Run({**predict_manifest("convseq2seq", 16, 25), "config": config}, net)
    export_run(run, tmp_path / "x.zip")
    bundle = load(tmp_path / "x.zip")
    assert isinstance(bundle, PredictModel)
    assert isinstance(run.model, Stepwise)
    seeds = np.random.default_rng(0).normal(size=(3, 50, CHANNELS)).astype(np.float32)
    found = bundle.next_frames(seeds)
    with torch.no_grad():
        np.testing.assert_allclose(found, run.model(torch.from_numpy(seeds), 25), atol=1e-4)
    np.testing.assert_array_equal(found[:, :, :3], np.repeat(seeds[:, -1:, :3], 25, axis=1))
    np.testing.assert_array_equal(bundle.next_frames(seeds[:1])[0], found[0])
