"""Commands as users start them, and what their runs leave."""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from click.testing import CliRunner, Result
from torch import Tensor

from motet.cli import main
from motet_train.models.net import Net
from motet_train.runs import MODELS, Run
from motet_train.trainer import LOG


def motet(*arguments: object) -> Result:
    """What a command does."""
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def done(*arguments: object) -> Result:
    """What a command does that succeeds."""
    result = motet(*arguments)
    assert result.exit_code == 0, result.output or result.exception
    return result


def refused(reason: str, *arguments: object) -> None:
    """Check that a command is refused for a reason."""
    result = motet(*arguments)
    assert (result.exit_code, reason in result.stderr) == (2, True), result.output


def trained(command: str, settings: str, data: Path, out: Path, *options: object) -> Run:
    """The run of a training command with the settings of a file."""
    config = out.parent / f"{command}.toml"
    config.write_text(settings)
    done("train", command, "--data", data, "--out", out, "--config", config, *options)
    return Run.load(out)


def log_of(run: Path) -> list[dict[str, Any]]:
    """The lines of the log in a run's folder."""
    return [json.loads(line) for line in (run / LOG).read_text().splitlines()]


def same(first: Mapping[str, Tensor], second: Mapping[str, Tensor]) -> bool:
    """Whether two nets have the same weights, to the bit."""
    return first.keys() == second.keys() and all(torch.equal(first[name], second[name]) for name in first)


def rebuilt(name: str, net: Net) -> Net:
    """A net from its configuration as a manifest has it, with the same weights."""
    again = MODELS[name](json.loads(json.dumps(asdict(net.config))))
    assert type(again) is type(net)
    again.load_state_dict(net.state_dict())
    return again.eval()


def check_resumed(train: Callable[..., Run], folder: Path, *early: object) -> Run:
    """Training that ends early and goes on gives the same to the bit as at once, and another seed something else.

    train: a run in a folder with options; early: those of a shorter one. Returns the whole run.
    """
    whole = train(folder / "whole")
    train(folder / "parts", *early)
    assert same(whole.model.state_dict(), train(folder / "parts", "--resume").model.state_dict())
    assert not same(whole.model.state_dict(), train(folder / "other", "--seed", 1).model.state_dict())
    return whole
