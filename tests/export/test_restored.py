"""A bundle as the training run that it came from: every weight is found again, whatever the exporter made of it."""

import re
from pathlib import Path
from typing import Any

import onnx
import pytest
import torch
from test_codes_export import run

from motet.bundle.bundle import Bundle
from motet_export.bundles import export_run, parity_of, renew_golden
from motet_export.exporter import ExportError, export_graph, round_weights
from motet_export.restored import restored
from motet_train.runs import Run

NEW = ("writer.masked", "num_batches_tracked")
"""What only training uses."""


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
    return restored(bundle)


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
    found = restored(bundle)
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
    check_equal(restored(commanded), given)


def test_8_bit_weights_are_not_those_that_were_trained(tmp_path: Path) -> None:
    export_run(run(), tmp_path / "codes.zip", int8=True)
    with pytest.raises(ExportError, match="8-bit weights"):
        restored(Bundle.open(tmp_path / "codes.zip"))


@pytest.mark.parametrize("swapped", [False, True])
def test_weights_that_are_numbered_otherwise_are_found_by_their_order(
    bundle: Bundle, again: Run, monkeypatch: pytest.MonkeyPatch, swapped: bool
) -> None:
    """As those of a net whose graph has changed since; in another order, what is found does not compute the same."""

    def otherwise(*given: Any) -> bytes:
        model = onnx.load_from_string(export_graph(*given))
        tensors = [*model.graph.initializer][:: -1 if swapped else 1]
        del model.graph.initializer[:]
        for tensor in tensors:
            tensor.name = re.sub(r"^val_", "other_", tensor.name)
            model.graph.initializer.append(tensor)
        return bytes(model.SerializeToString())

    monkeypatch.setattr("motet_export.restored.export_graph", otherwise)
    if swapped:
        with pytest.raises(ExportError, match="golden vectors"):
            restored(bundle)
    else:
        check_equal(restored(bundle), again)
