"""The joint embedding as an ONNX bundle: what torch computes, for sequences of any length."""

from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import torch
from small_runs import WORDS, check_parity, check_rows_alone

from motet.bundle.bundle import Bundle
from motet.figures.humanoid.bones import HUMANOID
from motet.models.load import load, verify
from motet.representation.contract import MotionContract
from motet.representation.root_block import ROOT_BLOCK, ROOT_BLOCK_UNITS
from motet.search.model import SearchModel
from motet.text.vocabulary import NEW_MODEL_RULES
from motet_export.bundles import export_run
from motet_export.parity import walks
from motet_train.models.joint_embedding import JointEmbedding, JointEmbeddingConfig
from motet_train.models.kinematics import figure_of
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter
JOINTS = ("spine", "leftUpperLeg", "rightUpperLeg")
CHANNELS = (*ROOT_BLOCK, *(f"{joint}.r{axis}" for joint in JOINTS for axis in "xyz"))
D = len(CHANNELS)
CONTRACT = MotionContract(
    "root_angles", CHANNELS, (*ROOT_BLOCK_UNITS, *("deg",) * 9), 10.0, np.zeros(D), np.full(D, 10.0), HUMANOID
)


def run() -> Run:
    torch.manual_seed(0)
    net = JointEmbedding(JointEmbeddingConfig(D, len(WORDS), figure_of(CONTRACT), embedding=8, vector=6))
    net.measure_by(CONTRACT.mean, CONTRACT.std)
    frames = torch.from_numpy(walks(CONTRACT, np.random.default_rng(0), 50, 20))
    net.see_by(net.statistics(frames, torch.full((50,), 20)))
    named = {"name": "small-search", "verb": "search", "model": "joint-embedding", "loop": "nearest"}
    words = {"text": NEW_MODEL_RULES.to_json(), "vocabulary": WORDS}
    known = {"config": asdict(net.config), "defaults": {"count": 5}, "motion": CONTRACT.to_json()}
    return Run({**named, **words, **known, "licence": {}, "training": {}}, net)


@pytest.fixture(scope="module")
def bundle(folder: Path) -> Path:
    export_run(run(), folder / "search.zip")
    return folder / "search.zip"


def test_a_bundle_keeps_its_contracts_and_carries_its_parity(bundle: Path) -> None:
    opened = Bundle.open(bundle)
    assert verify(opened).files == ("golden.npz", "motion.onnx", "text.onnx")
    rungs = {"motion.one_step", "text.one_step", "motion.far", "text.far", "runs"}
    assert {name for name in opened.manifest.parity if "." in name or name == "runs"} == rungs
    check_parity(opened, run(), rungs, share=1.0)


@pytest.mark.parametrize("role", ["motion", "text"])
def test_a_row_of_a_padded_batch_gets_what_it_gets_alone(bundle: Path, role: str) -> None:
    check_rows_alone(Bundle.open(bundle).graph(role), {"words": len(WORDS), "word": len(WORDS)})


def test_a_loaded_bundle_gives_what_the_net_gives(bundle: Path) -> None:
    model, net = load(bundle), run().model.eval()
    assert isinstance(model, SearchModel)
    frames = walks(CONTRACT, np.random.default_rng(1), 3, 25)
    found = model.embed([model.contract.features(row) for row in frames])
    with torch.no_grad():
        expected = net.embed_motion(torch.from_numpy(frames), torch.full((3,), 25))
        said = net.embed_text(torch.tensor([[4, 5, 6]]), torch.tensor([3]))
    np.testing.assert_allclose(found, expected, rtol=1e-5, atol=1e-6)  # processors round sums differently
    np.testing.assert_allclose(model.embed_text("a person walks"), said[0], atol=1e-6)
