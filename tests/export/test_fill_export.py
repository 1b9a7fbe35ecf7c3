"""The net that fills gaps as an ONNX bundle: what torch computes, for gaps and sides of any length."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch
from codes_data import humanoid_contract

from motet.bundle.bundle import Bundle
from motet.models.load import load, verify
from motet.predict.fill import FillModel
from motet.representation.placed import PLACED_CHANNELS
from motet_export.bundles import export_run, parity_of
from motet_export.parity import sides
from motet_train.models.filler import Filler, FillerConfig
from motet_train.models.kinematics import tree_of
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

CONTRACT = humanoid_contract()


def run() -> Run:
    torch.manual_seed(0)
    net = Filler(FillerConfig(PLACED_CHANNELS, tree_of(CONTRACT), width=16, layers=2, heads=2, inner=16, waves=2))
    torch.nn.init.normal_(net.outward.weight, std=0.1)
    named = {"name": "small-fill", "verb": "fill", "model": "gap-filler", "loop": "between"}
    known = {"config": asdict(net.config), "defaults": {"context": 20, "least": 4, "longest": 60}}
    return Run({**named, **known, "motion": CONTRACT.to_json(), "licence": {}, "training": {}}, net)


@pytest.fixture(scope="module")
def bundle(folder: Path) -> Path:
    export_run(run(), folder / "fill.zip")
    return folder / "fill.zip"


def test_the_bundle_computes_what_torch_does(bundle: Path) -> None:
    model, torch_graph = load(bundle), run().torch_graphs()["filler"]
    assert isinstance(model, FillModel)
    rng = np.random.default_rng(1)
    for before, gap, behind in ((20, 30, 20), (4, 1, 7), (2, 60, 20)):
        given = {
            name: rng.normal(size=(2, count, PLACED_CHANNELS)).astype(np.float32)
            for name, count in (("past", before), ("plain", gap), ("after", behind))
        }
        found = model.graphs["filler"](given)["filled"]
        assert np.abs(found - given["plain"]).max() > 0.01
        np.testing.assert_allclose(found, torch_graph(given)["filled"], atol=1e-5)


def test_the_golden_vectors_are_a_whole_gap(bundle: Path) -> None:
    opened = Bundle.open(bundle)
    assert opened.manifest.golden.run == {"frames": 15}
    assert set(verify(opened).errors) == {"filler", "meaning", "run"}
    assert parity_of(run(), opened)["runs"]["error"] < 1e-5


def test_frames_beyond_the_context_are_not_seen(bundle: Path) -> None:
    model = load(bundle)
    past, after = sides(CONTRACT, np.random.default_rng(2), 20)
    one = model.frames_between(past, after, 12)
    again = model.frames_between(np.concatenate([past[:3] + 1, past]), after, 12)  # beyond what it sees
    np.testing.assert_array_equal(one, again)
