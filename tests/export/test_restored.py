"""A bundle as the training run that it came from: every weight is found again, whatever the exporter made of it."""

import pickle
import re
from pathlib import Path
from typing import Any

import onnx
import pytest
import torch
from small_runs import MOTION, language_run
from test_codes_export import run
from torch import nn

from motet.bundle.bundle import DEFAULT_BUNDLES, Bundle
from motet.bundle.graph import GraphSpec
from motet_export.bundles import export_run, parity_of, renew_golden
from motet_export.exporter import ExportError, export_graph, round_weights
from motet_export.restored import restored
from motet_train.runs import Run

NEW = ("writer.masked", "num_batches_tracked")
"""What only training uses."""

EXPORTED: dict[bytes, bytes] = {}
"""Graphs by what they were exported from."""


def export_once(module: nn.Module, spec: GraphSpec, metadata: dict[str, str]) -> bytes:
    """What export_graph makes, once for equal nets: it takes seconds."""
    weights = {name: value.numpy().tobytes() for name, value in module.state_dict().items()}
    key = pickle.dumps((spec, metadata, weights))
    if key not in EXPORTED:
        EXPORTED[key] = export_graph(module, spec, metadata)
    return EXPORTED[key]


def trained(bundle: Bundle, export: Any = export_once) -> Run:
    """The run of a bundle, by a net whose weights are the same random ones whenever its sizes are."""
    torch.manual_seed(1)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("motet_export.restored.export_graph", export)
        return restored(bundle)


@torch.no_grad()
def distinct() -> Run:
    """A run none of whose tensors are equal: those, as in new norms, would be exported once."""
    given = run()
    torch.manual_seed(0)
    for name, value in given.model.state_dict().items():
        if name in dict(given.model.named_parameters()) or "running" in name:
            value.add_(0.1 * torch.rand_like(value))
    return given


@pytest.fixture(scope="module")
def given() -> Run:
    return distinct()


@pytest.fixture(scope="module")
def bundle(given: Run, folder: Path) -> Bundle:
    export_run(given, folder / "codes.zip")
    return Bundle.open(folder / "codes.zip")


@pytest.fixture(scope="module")
def again(bundle: Bundle) -> Run:
    return trained(bundle)


def check_equal(found: Run, wanted: Run) -> None:
    state = found.model.state_dict()
    for name, value in wanted.model.state_dict().items():
        if not name.endswith(NEW):
            torch.testing.assert_close(state[name], value, rtol=0, atol=0, msg=name)


def test_every_weight_is_found_again(given: Run, bundle: Bundle, again: Run) -> None:
    assert again.manifest["training"] == given.manifest["training"]
    check_equal(again, given)
    parity_of(again, bundle)


def test_every_weight_of_16_bits_is_found_again(tmp_path: Path) -> None:
    run_of_16_bits = distinct()
    export_run(run_of_16_bits, tmp_path / "codes.zip", half=True)
    bundle = Bundle.open(tmp_path / "codes.zip")
    found = trained(bundle)
    round_weights(run_of_16_bits.model)
    check_equal(found, run_of_16_bits)
    parity_of(found, bundle)


def test_the_steps_of_commands_are_no_weights(given: Run, bundle: Bundle, tmp_path: Path) -> None:
    table = tmp_path / "commands.toml"
    table.write_text(
        '[[command]]\nsentence = "walk"\ntexts = ["walk"]\n'
        "[[command.motion]]\ncuts = [{ action = 0, take = 0, first = 2, stop = 8 }]\n"
    )
    renew_golden(bundle, tmp_path / "commanded.zip", table)
    commanded = Bundle.open(tmp_path / "commanded.zip")
    assert len(commanded.table("memory")) == len(bundle.table("memory")) + 7
    check_equal(trained(commanded), given)


def test_8_bit_weights_are_not_those_that_were_trained(tmp_path: Path) -> None:
    net = language_run("describe", MOTION, embedding=4, encoder_units=(5,), decoder_units=(6, 7))
    export_run(net, tmp_path / "describe.zip", int8=True)
    with pytest.raises(ExportError, match="8-bit weights"):
        restored(Bundle.open(tmp_path / "describe.zip"))


def test_weights_of_other_names_and_orders_are_found_where_they_are_used(bundle: Bundle, again: Run) -> None:
    """As those that another version of the exporter has numbered."""

    def otherwise(*given: Any) -> bytes:
        model = onnx.load_from_string(export_once(*given))
        renamed = {}
        tensors = [*model.graph.initializer][::-1]
        del model.graph.initializer[:]
        for tensor in tensors:
            renamed[tensor.name] = re.sub(r"^val_", "other_", tensor.name)
            tensor.name = renamed[tensor.name]
            model.graph.initializer.append(tensor)
        for node in model.graph.node:
            node.input[:] = [renamed.get(name, name) for name in node.input]
        return bytes(model.SerializeToString())

    check_equal(trained(bundle, otherwise), again)


def test_a_bundle_of_another_graph_is_refused(bundle: Bundle) -> None:
    def shorter(*given: Any) -> bytes:
        model = onnx.load_from_string(export_once(*given))
        del model.graph.node[-1]
        for number, tensor in enumerate(model.graph.initializer):
            tensor.name = f"other_{number}"
        return bytes(model.SerializeToString())

    with pytest.raises(ExportError, match="no tensor other_0 of shape"):
        trained(bundle, shorter)


def test_a_shipped_bundle_is_trained_on_from() -> None:
    """Weights of one direction, which are stored as matrices, and biases that are equal, which are stored once."""
    bundle = Bundle.open(DEFAULT_BUNDLES / "language-to-motion.zip")
    parity_of(restored(bundle), bundle)
