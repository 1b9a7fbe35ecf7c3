"""Motion to language with attention as a bundle: parity, golden runs, and padding that is not seen.

tests/runtime/attentive.zip is the bundle ``place``.
"""

from dataclasses import asdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from motet.bundle.bundle import Bundle
from motet.bundle.graph import GraphSpec
from motet.decode.beam import score_words
from motet.errors import BundleError
from motet.models.describe import DescribeModel
from motet.models.load import load, verify
from motet.text.vocabulary import NEW_MODEL_RULES, SPECIALS
from motet_export.bundles import export_run, parity_of
from motet_train.models.motion_to_language import MotionToLanguage, MotionToLanguageConfig
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

D = 3
WORDS = [*SPECIALS, "a", "person", "walks", "runs", "left", "right", "slowly"]
MOTION = {
    "representation": "angles",
    "channels": ["hip", "knee", "ankle"],
    "units": ["rad"] * D,
    "fps": 10.0,
    "mean": [0.1, 0.2, 0.3],
    "std": [0.5, 1.0, 2.0],
    "skeleton": None,
}


def run() -> Run:
    torch.manual_seed(0)
    config = MotionToLanguageConfig(D, len(WORDS), (5, 4), (6, 7), 4, attention=True)
    net = MotionToLanguage(config)
    with torch.no_grad():
        # sharp enough that what a word attends to decides which one it is, and no bias of 0
        net.attention.weight *= 20
        net.output.weight *= 10
        for name, parameter in net.named_parameters():
            if name.endswith("bias"):
                parameter.uniform_(-0.1, 0.1)
    net.mean.copy_(torch.tensor(MOTION["mean"]))
    net.scale.copy_(torch.tensor(MOTION["std"]))
    manifest = {
        "name": "attentive",
        "version": "1",
        "verb": "describe",
        "model": "motion-to-language",
        "loop": "beam",
        "motion": MOTION,
        "text": NEW_MODEL_RULES.to_json(),
        "vocabulary": WORDS,
        "config": asdict(config),
        "defaults": {"beams": 5, "max_words": 8, "draws": 30, "temperature": 1.0},
        "licence": {},
        "training": {},
    }
    return Run(manifest, net.train())


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("attention") / "attentive.zip"
    export_run(run(), path)
    return path


@pytest.fixture(scope="module")
def model(place: Path) -> DescribeModel:
    loaded = load(place)
    assert isinstance(loaded, DescribeModel)
    return loaded


def test_a_bundle_computes_what_torch_does(place: Path) -> None:
    bundle = Bundle.open(place)
    assert max(verify(bundle).errors.values()) < 1e-5
    report = bundle.manifest.parity
    again = parity_of(run(), bundle)
    for rung in ("encoder.one_step", "encoder.far", "step.one_step", "step.far", "step.carried", "runs"):
        assert report[rung]["error"] < report[rung]["bound"]
        assert again[rung] == report[rung]
    step = bundle.manifest.graphs["step"].spec
    assert [tensor.name for tensor in step.inputs] == ["word", "context", "states", "lengths", "state"]
    assert step.input("states").shape == ("batch", "time", 8)


def test_padding_is_not_seen(place: Path, model: DescribeModel) -> None:
    step = Bundle.open(place).graph("step")
    rng = np.random.default_rng(3)
    contexts: dict[str, NDArray[Any]] = {
        "context": rng.normal(size=(2, 8)).astype(np.float32),
        "states": rng.normal(size=(2, 9, 8)).astype(np.float32),
        "lengths": np.array([9, 4]),
    }
    start, end = (model.vocabulary.ids[word] for word in SPECIALS[1:3])
    words = np.array([[start, 6, 5, end]] * 2)
    scores = score_words(step, contexts, np.arange(2), words)
    contexts["states"][1, 4:] = 1e3
    assert np.array_equal(score_words(step, contexts, np.arange(2), words), scores)
    contexts["states"][1, 3] += 1
    assert not np.array_equal(score_words(step, contexts, np.arange(2), words), scores)


def test_a_step_that_attends_to_what_no_encoder_gives_is_refused(model: DescribeModel) -> None:
    spec = model.graphs["encoder"].spec
    encoder: Any = SimpleNamespace(spec=GraphSpec(spec.inputs, spec.outputs[:1]))
    with pytest.raises(BundleError, match="'states' is neither supplied nor fed back"):
        DescribeModel(model.manifest, {**model.graphs, "encoder": encoder})
