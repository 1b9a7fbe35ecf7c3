"""The training loop of both nets between motion and language (Plappert et al. 2017, section 5.2)."""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
import torch
from torch import Tensor, nn

from motet.files import write_whole
from motet_train.checkpoint import CHECKPOINT, LOG, WEIGHTS, read_state, seed_torch, to_bytes
from motet_train.data.batches import Examples
from motet_train.models.language.batch import Batch
from motet_train.runs import RunError

Progress = Callable[[int, int], object]
"""Called after each step with the epoch, from 1, and the number of epochs."""


@dataclass(frozen=True)
class Fitting:
    """How a net is trained: Adam with Nesterov momentum, the gradient's norm clipped (table 1).

    clip: the greatest norm of the gradient. offsets, windows: how many down-sampling offsets of each motion are visited
    in an epoch, and frames of each, see :meth:`motet_train.data.batches.Examples.epoch`. decay: the share of the
    epochs, at the end, over which the learning rate falls linearly to zero. keep: the weights of the "best" validation
    loss, or the "last".
    """

    clip: float
    epochs: int = 100
    batch: int = 128
    learning_rate: float = 1e-3
    offsets: int | None = None
    windows: tuple[int, int] | None = None
    decay: float = 0.0
    keep: Literal["best", "last"] = "best"


@dataclass
class Fitted:
    """What has been done so far. log: for each epoch the line of ``log.jsonl``."""

    keep: Literal["best", "last"]
    log: list[dict[str, float]] = field(default_factory=list)

    @property
    def kept(self) -> dict[str, float]:
        """The line of the epoch whose weights are kept."""
        return self.log[-1] if self.keep == "last" else min(self.log, key=lambda line: line["validation_loss"])


def fit(
    net: nn.Module,
    data: tuple[Examples, Examples],
    fitting: Fitting,
    seed: int,
    folder: Path,
    device: str = "cpu",
    progress: Progress = lambda epoch, epochs: None,
) -> Fitted:
    """Train ``net`` on ``data`` (training, validation); it comes back with the weights to keep.

    net: has a method ``losses``, which gives the loss of every active step of a batch, (N,).

    After each epoch the existing ``folder`` holds ``log.jsonl``, the weights to keep and a checkpoint, each written
    whole. Where there is a checkpoint, training goes on after it, on the CPU to the same bits as if it had never
    stopped: an epoch's random numbers depend on the seed and the number of the epoch alone.
    RunError where the checkpoint cannot be read or is another net's.
    """
    net.to(device)
    optimiser = torch.optim.NAdam(net.parameters(), lr=fitting.learning_rate)
    fitted = _resume(folder / CHECKPOINT, net, optimiser, fitting.keep)
    for epoch in range(len(fitted.log) + 1, fitting.epochs + 1):
        seed_torch(seed, epoch)
        for group in optimiser.param_groups:
            group["lr"] = rate(fitting, epoch)
        batches = data[0].epoch(np.random.default_rng((seed, epoch)), fitting.batch, fitting.offsets, fitting.windows)
        started = time.perf_counter()
        losses = []
        net.train()
        for batch in batches:
            losses.append(_step(net, optimiser, batch.to(device), fitting.clip))
            progress(epoch, fitting.epochs)
        seconds = time.perf_counter() - started
        _keep(net, optimiser, fitted, folder, _line(epoch, losses, validate(net, data[1], fitting, device), seconds))
    net.load_state_dict(read_state(folder / WEIGHTS))
    net.cpu().eval()
    return fitted


def rate(fitting: Fitting, epoch: int) -> float:
    """The learning rate of an epoch, counted from 1."""
    falling = fitting.decay * fitting.epochs
    return fitting.learning_rate * (min(1.0, (fitting.epochs + 1 - epoch) / falling) if falling else 1.0)


@torch.no_grad()
def validate(net: nn.Module, examples: Examples, fitting: Fitting, device: str = "cpu") -> float:
    """The mean loss of a step, over every sentence of every motion, of which the longest window counts."""
    net.eval()
    total, count = 0.0, 0
    for batch in examples.everything(fitting.batch, fitting.windows and fitting.windows[1]):
        losses = net.losses(batch.to(device))  # type: ignore[operator]
        total, count = total + float(losses.double().sum()), count + len(losses)
    return total / count


def _step(net: nn.Module, optimiser: torch.optim.Optimizer, batch: Batch, clip: float) -> tuple[float, int]:
    """One step of gradient descent; the mean loss and how many steps of sequences it is the mean of."""
    losses: Tensor = net.losses(batch)  # type: ignore[operator]
    loss = losses.mean()
    if not torch.isfinite(loss):
        raise RunError("the loss is no longer finite: start again with a lower learning rate or another seed")
    optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    nn.utils.clip_grad_norm_(net.parameters(), clip)
    optimiser.step()
    return loss.item(), len(losses)


def _line(epoch: int, losses: list[tuple[float, int]], validation: float, seconds: float) -> dict[str, float]:
    values, counts = np.transpose(losses)
    return {
        "epoch": epoch,
        "train_loss": round(float(np.average(values, weights=counts)), 6),
        "validation_loss": round(validation, 6),
        "seconds": round(seconds, 3),
        "steps_per_second": round(len(losses) / seconds, 3),
    }


def _keep(
    net: nn.Module, optimiser: torch.optim.Optimizer, fitted: Fitted, folder: Path, line: dict[str, float]
) -> None:
    """Write the epoch down, its checkpoint last: until that is there, the epoch counts as not done."""
    fitted.log.append(line)
    if fitted.kept is line:
        write_whole(folder / WEIGHTS, to_bytes(net.state_dict()))
    write_whole(folder / LOG, "".join(json.dumps(line) + "\n" for line in fitted.log))
    state = {"net": net.state_dict(), "optimiser": optimiser.state_dict(), "log": fitted.log}
    write_whole(folder / CHECKPOINT, to_bytes(state))


def _resume(path: Path, net: nn.Module, optimiser: torch.optim.Optimizer, keep: Literal["best", "last"]) -> Fitted:
    if not path.exists():
        return Fitted(keep)
    state = read_state(path)
    try:
        net.load_state_dict(state["net"])
        optimiser.load_state_dict(state["optimiser"])
        return Fitted(keep, state["log"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise RunError(f"the checkpoint {path} is not of this training: {error}") from error
