"""bfloat16 only where the processor has it: what the system says of it, and what a command then does and writes."""

import json
import os
import platform
from pathlib import Path

import pytest
import torch
from test_predict_data import write_files
from trainings import done, refused

from motet_train.run_folder import has_bfloat16
from motet_train.settings import read_settings

CPUINFO = Path("/proc/cpuinfo")


@pytest.mark.skipif(
    platform.machine() != "x86_64" or not CPUINFO.exists(), reason="where Linux says what an x86 processor has"
)
def test_the_answer_is_the_systems_but_where_torch_is_held_down() -> None:
    held_down = "ONEDNN_MAX_CPU_ISA" in os.environ
    assert has_bfloat16("cpu") == ("avx512_bf16" in CPUINFO.read_text().split() and not held_down)


@pytest.mark.skipif(not has_bfloat16("cpu"), reason="this processor has no products in bfloat16")
def test_where_it_is_yes_a_recurrent_layer_runs() -> None:
    layer, x = torch.nn.LSTM(8, 8), torch.randn(5, 2, 8)
    with torch.autocast("cpu", torch.bfloat16):
        found = layer(x)[0]
    found.float().sum().backward()
    torch.testing.assert_close(found.float(), layer(x)[0], atol=0.02, rtol=0.05)


def test_what_torch_does_not_answer_is_a_no(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.ops, "mkldnn", None)
    assert not has_bfloat16("cpu")


@pytest.mark.parametrize(("has", "used"), [(False, "float32"), (True, "bfloat16")])
def test_a_run_says_and_records_what_it_is_trained_in(
    has: bool, used: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    files, out = write_files(tmp_path / "files", actions=("walking",)), tmp_path / "run"
    (tmp_path / "small.toml").write_text("[model]\nhidden = 8\n")
    settings = ("--steps", 2, "--config", tmp_path / "small.toml", "--precision", "bfloat16")
    command = ("train", "predict", "--data", files, *settings, "--out", out)
    monkeypatch.setattr("motet_train.run_folder.has_bfloat16", lambda device: has)
    result = done(*command)
    assert result.output.count("cpu has no products in bfloat16: training in float32") == (not has)
    assert json.loads((out / "run.json").read_text())["training"]["recipe"]["precision"] == used
    assert read_settings(out / "run.toml")[1]["training"]["precision"] == used
    monkeypatch.setattr("motet_train.run_folder.has_bfloat16", lambda device: not has)
    refused("other settings, so cannot be resumed: precision", *command, "--resume")
