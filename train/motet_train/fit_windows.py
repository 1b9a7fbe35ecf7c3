"""The training loop of the published systems that predict: windows of motions, validated as they are used."""

import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from motet.files import write_whole
from motet_train.checkpoint import CHECKPOINT, LOG, WEIGHTS, read_state, seed_torch, to_bytes
from motet_train.models.predict.stepwise import Stepwise
from motet_train.runs import RunError

Draw = Callable[[np.random.Generator, int], Tensor]
"""Windows (B, L + N, D), normalised, of so many rows."""


@dataclass(frozen=True)
class Fitting:
    """How a system is trained.

    falling: the share of the steps, at the end, over which the learning rate falls linearly to zero; or decay: a factor
    for every so many steps. l2: the weight of the squared weights, not biases, in the loss. clip: the greatest norm of
    the gradient. adversary: the weight of the discriminator's opinion in the loss (Li et al. 2018, eq. 9). every: steps
    from one validation to the next; training ends when ``patience`` of them in a row brought nothing better. precision:
    of the products of matrices in training; what is trained is float32.
    """

    steps: int = 2000
    batch: int = 16
    optimiser: Literal["adam", "sgd"] = "adam"
    learning_rate: float = 2e-4
    falling: float = 0.0
    decay: tuple[float, int] | None = None
    l2: float = 0.0
    clip: float | None = None
    adversary: float = 0.0
    every: int = 100
    patience: int = 1000
    precision: Literal["float32", "bfloat16"] = "float32"


@dataclass
class Learner:
    """A system in training. judge: the discriminator of whole windows, where there is an adversary."""

    net: Stepwise
    fitting: Fitting
    judge: nn.Module | None = None
    log: list[dict[str, float]] = field(default_factory=list)

    def __post_init__(self) -> None:
        if (self.judge is None) != (self.fitting.adversary == 0):
            raise RunError("this system is not trained against an adversary")
        self.optimiser = _optimiser(self.net, self.fitting)
        self.judging = self.judge and _optimiser(self.judge, self.fitting)

    @property
    def parts(self) -> dict[str, Any]:
        """All that has a state."""
        found = {"net": self.net, "optimiser": self.optimiser, "judge": self.judge, "judging": self.judging}
        return {name: part for name, part in found.items() if part is not None}

    def step(self, windows: Tensor) -> float:
        """One step of the discriminator, where there is one, and one of the system; the system's loss."""
        half = self.fitting.precision == "bfloat16"
        with torch.autocast(windows.device.type, torch.bfloat16, enabled=half):
            loss = self._loss(windows) if self.judge is None else self._adversarial(windows, self.judge)
        _descend(self.optimiser, self.net, loss, self.fitting.clip)
        return loss.item()

    def _loss(self, windows: Tensor) -> Tensor:
        return self.net.system.loss(windows, self.net.seed_frames)

    def _adversarial(self, windows: Tensor, judge: nn.Module) -> Tensor:
        """The discriminator learns (eq. 8), then says what it thinks (eq. 9)."""
        predicted = self.net.system.imagine(windows, self.net.seed_frames)
        seed, truth = windows[:, : self.net.seed_frames], windows[:, self.net.seed_frames :]
        false = torch.cat([seed, predicted], dim=1)
        doubt = softplus(judge(false.detach()).float()) + softplus(-judge(windows).float())
        _descend(self.judging, judge, doubt.mean(), None)
        opinion = softplus(-judge(false).float()).mean()
        return self.net.system.error(predicted, truth) + self.fitting.adversary * opinion


def fit_windows(
    learner: Learner,
    draw: Draw,
    validate: Callable[[], float],
    seed: int,
    folder: Path,
    progress: Callable[[int, float], object] = lambda steps, loss: None,
) -> None:
    """Train; the system comes back with the weights of the best validation.

    After every ``fitting.every`` steps the existing ``folder`` holds ``log.jsonl``, the best weights so far and a
    checkpoint, each written whole. Where there is a checkpoint training goes on after it, on the CPU to the same bits
    as if it had never stopped.
    RunError where the loss is no longer finite, or the checkpoint cannot be read or is another system's.
    """
    fitting, log = learner.fitting, learner.log
    _resume(folder / CHECKPOINT, learner)
    while not _done(log, fitting):
        chunk, started = len(log), time.perf_counter()
        seed_torch(seed, chunk)
        rng = np.random.default_rng((seed, chunk))
        losses = []
        learner.net.train()
        for step in range(chunk * fitting.every, min(fitting.steps, (chunk + 1) * fitting.every)):
            for group in learner.optimiser.param_groups:
                group["lr"] = rate(fitting, step)
            learner.net.system.progress(step / fitting.steps)
            losses.append(learner.step(draw(rng, fitting.batch)))
            progress(step + 1, losses[-1])
        seconds = time.perf_counter() - started
        learner.net.eval()
        _keep(learner, folder, _line(step + 1, losses, validate(), seconds))
    learner.net.load_state_dict(read_state(folder / WEIGHTS))
    learner.net.eval()


def rate(fitting: Fitting, step: int) -> float:
    """The learning rate of a step, counted from 0."""
    if fitting.decay is not None:
        return fitting.learning_rate * fitting.decay[0] ** (step // fitting.decay[1])
    falling = fitting.falling * fitting.steps
    return fitting.learning_rate * (min(1.0, (fitting.steps - step) / falling) if falling else 1.0)


def best(log: list[dict[str, float]]) -> dict[str, float]:
    """The line whose weights are kept."""
    return min(log, key=lambda line: line["validation_error"])


def _done(log: list[dict[str, float]], fitting: Fitting) -> bool:
    if not log:
        return False
    return log[-1]["step"] >= fitting.steps or len(log) - 1 - log.index(best(log)) >= fitting.patience


def _optimiser(module: nn.Module, fitting: Fitting) -> torch.optim.Optimizer:
    # added to the loss, l2 times the squared weights is a decay of twice as much
    kinds: Mapping[str, Callable[..., torch.optim.Optimizer]] = {"adam": torch.optim.Adam, "sgd": torch.optim.SGD}
    weights = [parameter for parameter in module.parameters() if parameter.ndim > 1]
    biases = [parameter for parameter in module.parameters() if parameter.ndim <= 1]
    groups: list[dict[str, Any]] = [{"params": weights, "weight_decay": 2 * fitting.l2}, {"params": biases}]
    return kinds[fitting.optimiser](groups, lr=fitting.learning_rate)


def _descend(optimiser: Any, module: nn.Module, loss: Tensor, clip: float | None) -> None:
    if not torch.isfinite(loss):
        raise RunError("the loss is no longer finite: start again with a lower learning rate or another seed")
    optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    if clip is not None:
        nn.utils.clip_grad_norm_(module.parameters(), clip)
    optimiser.step()


def _line(step: int, losses: list[float], validation: float, seconds: float) -> dict[str, float]:
    return {
        "step": step,
        "loss": round(float(np.mean(losses)), 6),
        "validation_error": round(validation, 6),
        "seconds": round(seconds, 1),
        "steps_per_second": round(len(losses) / seconds, 3),
    }


def _keep(learner: Learner, folder: Path, line: dict[str, float]) -> None:
    """Write it down, the checkpoint last: until that is there, these steps count as not done."""
    learner.log.append(line)
    if best(learner.log) is line:
        write_whole(folder / WEIGHTS, to_bytes(learner.net.state_dict()))
    write_whole(folder / LOG, "".join(json.dumps(entry) + "\n" for entry in learner.log))
    states = {name: part.state_dict() for name, part in learner.parts.items()}
    write_whole(folder / CHECKPOINT, to_bytes({"log": learner.log, "states": states}))


def _resume(path: Path, learner: Learner) -> None:
    if not path.exists():
        return
    saved = read_state(path)
    try:
        for name, part in learner.parts.items():
            part.load_state_dict(saved["states"][name])
        learner.log.extend(saved["log"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise RunError(f"the checkpoint {path} is not of this training: {error}") from error
