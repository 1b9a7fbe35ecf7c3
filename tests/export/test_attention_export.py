"""Motion to language with attention as a bundle: parity, golden runs, and padding that is not seen.

tests/runtime/attentive.zip is the bundle ``place``.
"""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from small_runs import MOTION, check_parity, language_run

from motet.bundle.bundle import Bundle
from motet.bundle.graph import GraphSpec
from motet.decode.beam import score_words
from motet.errors import BundleError
from motet.models.describe import DescribeModel
from motet.models.load import load
from motet.text.vocabulary import SPECIALS
from motet_export.bundles import export_run
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter


def run() -> Run:
    made = language_run("describe", MOTION, embedding=4, encoder_units=(5, 4), decoder_units=(6, 7), attention=True)
    net = made.model
    with torch.no_grad():
        # sharp enough that what a word attends to decides which one it is, and no bias of 0
        net.attention.weight *= 20
        net.output.weight *= 10
        for name, parameter in net.named_parameters():
            if name.endswith("bias"):
                parameter.uniform_(-0.1, 0.1)
    defaults = {"beams": 5, "max_words": 8, "draws": 30, "temperature": 1.0}
    return Run({**made.manifest, "name": "attentive", "version": "1", "defaults": defaults}, net)


@pytest.fixture(scope="module")
def place(folder: Path) -> Path:
    export_run(run(), folder / "attentive.zip")
    return folder / "attentive.zip"


@pytest.fixture(scope="module")
def model(place: Path) -> DescribeModel:
    loaded = load(place)
    assert isinstance(loaded, DescribeModel)
    return loaded


def test_a_bundle_computes_what_torch_does(place: Path) -> None:
    bundle = Bundle.open(place)
    rungs = {"encoder.one_step", "encoder.far", "step.one_step", "step.far", "step.carried", "runs"}
    check_parity(bundle, run(), rungs, share=1.0)
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
