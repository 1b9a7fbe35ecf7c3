"""Two processes, started by torchrun, give what one gives with the same global batches."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import torch
from language_data import small_store
from test_trainer import EPOCHS, adversarial, regression
from trainings import done, log_of

from motet_train import distributed
from motet_train.trainer import train

SMALL = """
epochs = 3
batch = 5  # of 16 motions: the last batch of an epoch has one, so that one process has nothing to do
[model]
encoder_units = [4, 4]
decoder_units = [6, 6]
dropout = 0.0
"""
NETS = {
    "describe": "embedding = 4\nframe_noise = 0.0",
    "mixture": "embedding = 4\ncomponents = 2\nfeed_noise = 0.0\nframe_dropout = 0.0\n[visits]\noffsets = 2",
}


def torchrun(*arguments: object) -> None:
    start = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--standalone"]
    ended = subprocess.run([*start, *map(str, arguments)], check=False, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr


def nearly_same(one: Path, other: Path) -> None:
    states = [torch.load(path / "weights.pt", weights_only=True) for path in (one, other)]
    for name, value in states[0].items():
        torch.testing.assert_close(value, states[1][name], atol=2e-5, rtol=1e-4)
    for first, second in zip(log_of(one), log_of(other), strict=True):
        assert first["loss"] == pytest.approx(second["loss"], rel=1e-4)
        assert first.get("validation", 0) == pytest.approx(second.get("validation", 0), rel=1e-4)


@pytest.mark.parametrize(
    ("verb", "more", "parts"), [("describe", "", 1), ("mixture", "", 1), ("describe", "\nsummary = 0.0", 2)]
)
def test_the_command_gives_the_same_run(verb: str, more: str, parts: int, tmp_path: Path) -> None:
    small_store(tmp_path)
    settings = tmp_path / "small.toml"
    settings.write_text(SMALL + NETS[verb] + more)
    command = ("train", verb, "--data", tmp_path / "store", "--config", settings, "--out")
    done(*command, tmp_path / "one")
    if parts > 1:
        settings.write_text(f"{settings.read_text()}\n[training]\naccumulate = {parts}\n")
    torchrun("-m", "motet", *command, tmp_path / "two")
    nearly_same(tmp_path / "one", tmp_path / "two")
    training = json.loads((tmp_path / "two" / "run.json").read_text())["training"]
    assert (training["processes"], training["recipe"]["batch"]) == (2, 5)


def both(folder: Path) -> None:
    """Train what has no command of its own here, without dropout."""
    for name, learner in (("average", regression(EPOCHS)), ("adversary", adversarial())):
        for net in (learner.net, learner.parts.get("judge", learner.net)):
            for module in net.modules():
                if isinstance(module, torch.nn.Dropout):
                    module.p = 0.0
        if distributed.rank() == 0:
            (folder / name).mkdir(parents=True)
        train(learner, 3, folder / name)


def test_an_adversary_is_taught_by_all_processes(tmp_path: Path) -> None:
    both(tmp_path / "one")
    torchrun(__file__, tmp_path / "two")
    for name in ("average", "adversary"):
        nearly_same(tmp_path / "one" / name, tmp_path / "two" / name)
        states = (
            torch.load(tmp_path / p / name / "checkpoint.pt", weights_only=True)["states"] for p in ("one", "two")
        )
        first, second = (state.get("judge", {}) for state in states)
        for key, value in first.items():
            torch.testing.assert_close(value, second[key], atol=2e-5, rtol=1e-4)


def test_alone_there_is_one_process() -> None:
    assert (distributed.rank(), distributed.count()) == (0, 1)
    assert distributed.summed([1.0, 2.0], torch.device("cpu")) == [1.0, 2.0]


if __name__ == "__main__":
    with distributed.processes("cpu"):
        both(Path(sys.argv[1]))
