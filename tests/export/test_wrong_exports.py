"""Exports that are wrong in one place: parity and the golden vectors notice each that changes an answer."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
import torch
from language_models import CHANNELS, FPS, SKELETON, UNITS
from onnx import numpy_helper
from small_runs import WORDS, language_bundles, language_run

from motet.bundle.bundle import Bundle, write_bundle
from motet.errors import BundleError
from motet.models.load import load, verify
from motet_export.bundles import parity_of
from motet_export.decoded import whole_runs
from motet_export.exporter import ExportError
from motet_export.parity import check_runs
from motet_train.runs import Run

pytestmark = pytest.mark.slow  # torch's exporter
MOTION = {
    "representation": "root_angles",
    "channels": list(CHANNELS),
    "units": list(UNITS),
    "fps": FPS,
    "mean": [0.5, 0.0, 0.1, 0.85, 0.0, 0.0, 3.0, -2.0],
    "std": [0.6, 0.1, 0.7, 0.05, 0.1, 0.1, 8.0, 9.0],
    "skeleton": SKELETON.to_json(),
}

Model = onnx.ModelProto
Fault = Callable[[Model], None]


def run(verb: str) -> Run:
    made = language_run(verb, MOTION, embedding=8, encoder_units=(6,), decoder_units=(8, 8))
    with torch.no_grad():
        for parameter in made.model.parameters():
            parameter.mul_(2.0)  # as far from linear as a trained net
    return made


@pytest.fixture(scope="module")
def bundles(folder: Path) -> dict[str, Path]:
    return language_bundles(run, folder)


def written(good: Bundle, path: Path, role: str | None, fault: Fault | None, **manifest: Any) -> Bundle:
    """The bundle with a fault in a graph, or another manifest; its golden vectors stay."""
    files = {name: good.read(name) for name in good.manifest.files}
    if role is not None and fault is not None:
        model = onnx.load_from_string(files[f"{role}.onnx"])
        fault(model)
        onnx.checker.check_model(model)
        files[f"{role}.onnx"] = model.SerializeToString()
    write_bundle(path, {**good.manifest.source, **manifest}, files)
    return Bundle.open(path)


def caught(verb: str, wrong: Bundle) -> tuple[bool, bool]:
    """Whether parity and the golden vectors notice."""
    noticed = []
    for check in (lambda: parity_of(run(verb), wrong), lambda: verify(wrong)):
        try:
            check()
            noticed.append(False)
        except (ExportError, BundleError):
            noticed.append(True)
    return noticed[0], noticed[1]


def weight(name: str, change: Callable[[np.ndarray], None]) -> Fault:
    """Change the weight of a name as a matrix of two dimensions."""

    def fault(model: Model) -> None:
        (tensor,) = [one for one in model.graph.initializer if one.name.endswith(name)]
        values = numpy_helper.to_array(tensor).copy()
        change(values.reshape(-1, values.shape[-1]))
        tensor.CopyFrom(numpy_helper.from_array(values, tensor.name))

    return fault


def exchanged(values: np.ndarray) -> None:
    values[0, 0], values[1, 1] = values[1, 1], values[0, 0]


def columns_exchanged(values: np.ndarray) -> None:
    values[:, [0, 1]] = values[:, [1, 0]]


def raised(values: np.ndarray) -> None:
    values[0, 3] += np.float32(1e-3)


def scaled(values: np.ndarray) -> None:
    values *= np.float32(1 + 1e-3)


def nodes(graph: onnx.GraphProto) -> Iterator[onnx.NodeProto]:
    """Of a graph and of those in it."""
    for node in graph.node:
        yield node
        for attribute in node.attribute:
            if attribute.type == onnx.AttributeProto.GRAPH:
                yield from nodes(attribute.g)


def other_operation(old: str, new: str) -> Fault:
    def fault(model: Model) -> None:
        found = [node for node in nodes(model.graph) if node.op_type == old]
        found[0].op_type = new

    return fault


def epsilon(value: float) -> Fault:
    def fault(model: Model) -> None:
        found = [node for node in nodes(model.graph) if node.op_type == "LayerNormalization"]
        assert found
        for node in found:
            (attribute,) = [one for one in node.attribute if one.name == "epsilon"]
            attribute.f = value

    return fault


def clamp_lost(model: Model) -> None:
    found = [node for node in model.graph.node if node.op_type == "Clip"]
    assert found
    for node in found:
        node.op_type = "Identity"
        del node.input[1:]


def stale(model: Model) -> None:
    for node in model.graph.node:
        for names in (node.input, node.output):
            for place, name in enumerate(names):
                names[place] = "true_state" if name == "next_state" else name
    model.graph.node.append(onnx.helper.make_node("Identity", ["state"], ["next_state"]))


FAULTS: list[tuple[str, str, str, Fault]] = [
    ("two weights exchanged", "describe", "step", weight("layers.1.weight", exchanged)),
    ("two columns exchanged", "describe", "step", weight("embedding.weight", columns_exchanged)),
    ("a bias + 1e-3", "describe", "step", weight("layers.0.bias", raised)),
    ("a bias + 1e-3, frames", "generate", "step", weight("layers.0.bias", raised)),
    ("a matrix x (1 + 1e-3)", "describe", "step", weight("output.weight", scaled)),
    ("a matrix x (1 + 1e-3), frames", "generate", "step", weight("head.linear.weight", scaled)),
    ("layer norm, 1e-3 for 1e-5", "generate", "encoder", epsilon(1e-3)),
    ("layer norm, 1e-12 for 1e-5", "generate", "encoder", epsilon(1e-12)),
    ("a stale state", "describe", "step", stale),
    ("a stale state, frames", "generate", "step", stale),
    ("Sigmoid for Tanh", "describe", "step", other_operation("Tanh", "Sigmoid")),
    ("Relu for Softplus", "generate", "step", other_operation("Softplus", "Relu")),
    ("the clamp lost", "describe", "encoder", clamp_lost),
]


@pytest.mark.parametrize(("verb", "role", "fault"), [one[1:] for one in FAULTS], ids=[one[0] for one in FAULTS])
def test_a_wrong_graph_is_noticed(bundles: dict[str, Path], tmp_path: Path, verb: str, role: str, fault: Fault) -> None:
    wrong = written(Bundle.open(bundles[verb]), tmp_path / "wrong.zip", role, fault)
    assert caught(verb, wrong) == (True, True)


def swapped(values: Any, one: int, other: int) -> list[Any]:
    found = list(values)
    found[one], found[other] = found[other], found[one]
    return found


MEANINGS: dict[str, dict[str, Any]] = {
    "two words exchanged": {"vocabulary": swapped(WORDS, -3, -2)},
    "left and right exchanged": {"motion": MOTION | {"channels": swapped(CHANNELS, 6, 7)}},
    "another rate": {"motion": MOTION | {"fps": 120.0}},
    "a mean moved by ten deviations": {"motion": MOTION | {"mean": [6.5, *MOTION["mean"][1:]]}},
    "a wider channel": {"motion": MOTION | {"std": [*MOTION["std"][:-1], 9.1]}},
    "longer bones": {"motion": MOTION | {"skeleton": MOTION["skeleton"] | {"metres_per_unit": 1.1}}},
}


@pytest.mark.parametrize("verb", ["describe", "generate"])
@pytest.mark.parametrize("change", MEANINGS.values(), ids=list(MEANINGS))
def test_a_wrong_manifest_is_noticed(
    bundles: dict[str, Path], tmp_path: Path, verb: str, change: dict[str, Any]
) -> None:
    wrong = written(Bundle.open(bundles[verb]), tmp_path / "wrong.zip", None, None, **change)
    assert caught(verb, wrong) == (True, True)


@pytest.mark.parametrize("verb", ["describe", "generate"])
def test_the_right_export_passes(bundles: dict[str, Path], tmp_path: Path, verb: str) -> None:
    good = written(Bundle.open(bundles[verb]), tmp_path / "good.zip", None, None)
    assert caught(verb, good) == (False, False)


@pytest.mark.parametrize("verb", ["describe", "generate"])
def test_whole_runs_alone_see_other_words_and_channels(bundles: dict[str, Path], tmp_path: Path, verb: str) -> None:
    """Also where nobody compares manifests: what is decoded is read by the run's words and places."""
    good = Bundle.open(bundles[verb])
    for name, change in MEANINGS.items():
        if verb == "describe" and name not in ("two words exchanged", "left and right exchanged"):
            continue  # a sentence does not depend on what the manifest says of rate and statistics
        wrong = written(good, tmp_path / f"{name.replace(' ', '-')}.zip", None, None, **change)
        with pytest.raises(ExportError, match=r"parity runs|does not have the expected shape"):
            check_runs(whole_runs(load(wrong.path), run(verb).bundle_model()))
