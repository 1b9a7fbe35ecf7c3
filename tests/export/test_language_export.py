"""Both directions between motion and language as ONNX bundles: what torch computes, for sequences of any length."""

from pathlib import Path

import numpy as np
import pytest
import torch
from small_runs import MOTION, WORDS, check_parity, check_rows_alone, language_bundles, language_run

from motet.bundle.bundle import Bundle
from motet.models.load import load, verify
from motet.representation.contract import Z_LIMIT
from motet_export.bundles import export_run, parity_of
from motet_export.exporter import ExportError
from motet_export.parity import example
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter

D = len(MOTION["channels"])
BELOW = {"words": len(WORDS), "word": len(WORDS)}


def run(verb: str) -> Run:
    """Of which the describing net never saw its last channel move."""
    motion = MOTION | {"std": [0.5, 1.0, 0.0]} if verb == "describe" else MOTION
    return language_run(verb, motion, embedding=4, encoder_units=(5,), decoder_units=(6, 7))


@pytest.fixture(scope="module")
def bundles(folder: Path) -> dict[str, Path]:
    return language_bundles(run, folder)


@pytest.mark.parametrize("verb", ["describe", "generate"])
def test_a_bundle_keeps_its_contracts_and_carries_its_parity(bundles: dict[str, Path], verb: str) -> None:
    bundle = Bundle.open(bundles[verb])
    assert verify(bundle).files == ("encoder.onnx", "golden.npz", "step.onnx")
    check_parity(bundle, run(verb), {"encoder.one_step", "step.one_step", "step.carried", "runs"})
    names = {"describe": {"greedy", "beam", "scores"}, "generate": {"samples", "beam", "scores"}}[verb]
    assert names < bundle.manifest.parity["runs"].keys()


@pytest.mark.parametrize("verb", ["describe", "generate"])
def test_a_row_of_a_padded_batch_gets_what_it_gets_alone(bundles: dict[str, Path], verb: str) -> None:
    graph = Bundle.open(bundles[verb]).graph("encoder")
    check_rows_alone(graph, BELOW)
    feeds = example(graph.spec, np.random.default_rng(0), batch=6, below=BELOW)
    padded, output = graph.spec.inputs[0].name, graph.spec.outputs[0].name
    longer = {**feeds, padded: np.concatenate([feeds[padded], np.zeros_like(feeds[padded])], axis=1)}
    np.testing.assert_allclose(graph(longer)[output], graph(feeds)[output], atol=1e-6)


def test_normalisation_is_inside_the_encoder_of_motions(bundles: dict[str, Path]) -> None:
    net = run("describe").model.eval()
    frames = np.random.default_rng(0).normal(size=(2, 9, D)).astype(np.float32)
    frames[0, 3, 1] = 1e6
    lengths = np.array([9, 9])
    found = Bundle.open(bundles["describe"]).graph("encoder")({"frames": frames, "lengths": lengths})["context"]
    normal = load(bundles["describe"]).contract.normalised(frames)
    assert (np.abs(normal).max(), np.abs(normal[..., 2]).max()) == (Z_LIMIT, 0)
    with torch.no_grad():
        flagged = torch.cat([torch.tensor(normal).float(), torch.ones(2, 9, 1)], dim=-1)
        expected = net.encoder(flagged, torch.tensor(lengths))
    np.testing.assert_allclose(found, expected, atol=1e-5)


def test_a_description_scores_what_its_beam_says(bundles: dict[str, Path]) -> None:
    model = load(bundles["describe"])
    motion = model.contract.features(np.random.default_rng(0).normal(size=(20, D)))
    for found in model.describe(motion, beams=5):
        if found.text:
            assert model.score(motion, found.text) == pytest.approx(found.log_probability, abs=1e-4)


def test_a_generated_motion_scores_what_its_beam_says(bundles: dict[str, Path]) -> None:
    model = load(bundles["generate"])
    for found in model.generate("a person walks", hypotheses=4, candidates=2, seed=3):
        if len(found.frames) > 1:
            score = model.score("a person walks", model.contract.features(found.frames))
            assert score == pytest.approx(found.log_likelihood, rel=1e-3, abs=1e-2)


def test_graphs_are_plain_and_hold_no_dropout(bundles: dict[str, Path]) -> None:
    for verb, place in bundles.items():
        bundle = Bundle.open(place)
        for role in ("encoder", "step"):
            data = bundle.read(f"{role}.onnx")
            assert b"Dropout" not in data, (verb, role)
            assert (b"Scan" in data) == ((verb, role) == ("generate", "encoder")), (verb, role)


def test_a_model_that_differs_leaves_no_bundle(
    bundles: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stale, other = Bundle.open(bundles["describe"]), run("describe")
    with torch.no_grad():
        other.model.output.bias += 1e-3 * torch.arange(len(WORDS))
    monkeypatch.setattr("motet_export.bundles.export_graph", lambda _, __, label: stale.read(f"{label['role']}.onnx"))
    with pytest.raises(ExportError, match=r"step.one_step"):
        export_run(other, tmp_path / "bundle.zip")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("verb", ["describe", "generate"])
def test_weights_of_8_bits_load_and_their_difference_is_noted(
    bundles: dict[str, Path], verb: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exact = Bundle.open(bundles[verb])
    monkeypatch.setattr("motet_export.bundles.export_graph", lambda _, __, label: exact.read(f"{label['role']}.onnx"))
    report = export_run(run(verb), tmp_path / "int8.zip", int8=True)
    bundle = Bundle.open(tmp_path / "int8.zip")
    assert bundle.manifest.parity["int8"] == report["int8"]
    assert 0 < report["int8"]["scores.score"] < 0.05
    assert all(b"MatMulInteger" not in bundle.read(f"{role}.onnx") for role in bundle.manifest.graphs)
    assert max(verify(bundle).errors.values()) < 1e-5
    with pytest.raises(ExportError, match="8-bit"):
        parity_of(run(verb), bundle)
    with pytest.raises(ExportError, match="--int8 or with --half"):
        export_run(run(verb), tmp_path / "both.zip", int8=True, half=True)
