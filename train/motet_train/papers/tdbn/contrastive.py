"""Contrastive divergence: what RBM and CRBM share of their learning (thesis 3.2).

Letters in shapes: B rows of a mini-batch, N all rows, D visible units, H hidden units.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from motet.errors import MotetError


class DivergedError(MotetError, ArithmeticError):
    """Training that diverged."""


@dataclass(frozen=True)
class Learning:
    """How one layer is trained."""

    epochs: int
    rate: float = 1e-3
    final_rate: float = 1.0
    """The rate of the last epoch over that of the first, geometric between."""
    batch: int = 20
    momentum: float = 0.9
    momentum_after: int = 5
    """Epochs without momentum."""
    decay: float = 2e-6
    steps: int = 1
    """k of CD-k: Gibbs steps of the reconstruction."""
    temperature: tuple[float, float] = (1.0, 0.6)
    """Of the sigmoids in the first and the last epoch, geometric between."""


@dataclass(frozen=True)
class Epoch:
    """One epoch of the schedule: learning rate, momentum, temperature, and row numbers (batches, B)."""

    rate: float
    momentum: float
    temperature: float
    batches: Tensor


def schedule(learning: Learning, number: int, probabilities: Tensor, generator: torch.Generator) -> Epoch:
    """One epoch, counted from 0; rows are drawn with the given probabilities (N,), about N of them."""
    first, last = learning.temperature
    updates = max(1, len(probabilities) // learning.batch)
    done = number / max(1, learning.epochs - 1)
    momentum = learning.momentum if number >= learning.momentum_after else 0.0
    rows = torch.multinomial(probabilities, updates * learning.batch, replacement=True, generator=generator)
    rate, temperature = learning.rate * learning.final_rate**done, first * (last / first) ** done
    return Epoch(rate, momentum, temperature, rows.view(updates, learning.batch))


def balanced(weights: Sequence[Tensor]) -> Tensor:
    """Probabilities (N,) to draw each row: a motion uniformly, then one of its rows by that motion's weights.

    So a long motion weighs no more than a short one (thesis 5.3: no bias to one gait).
    """
    return torch.cat([weight / weight.sum() for weight in weights]) / len(weights)


class Ascent:
    """Gradient ascent with momentum and decay on one parameter, in place.

    The parameter may be a stack of R; then the rows of what it climbs along have R in front.
    """

    def __init__(self, value: Tensor, decay: float) -> None:
        self.value, self.decay = value, decay
        self.velocity = torch.zeros_like(value)

    def outer(self, left: Tensor, right: Tensor, epoch: Epoch) -> None:
        """Climb along the mean of left^T right, (B, N) and (B, M)."""
        self._add(left, right, epoch.momentum, epoch.rate / left.shape[-2])
        self._climb(epoch)

    def contrast(self, data: tuple[Tensor, Tensor], model: tuple[Tensor, Tensor], epoch: Epoch) -> None:
        """Climb along <v h>data - <v h>model, each given as its two factors (B, N), (B, M)."""
        step = epoch.rate / data[0].shape[-2]
        self._add(*model, epoch.momentum, -step)
        self._add(*data, 1.0, step)
        self._climb(epoch)

    def mean(self, rows: Tensor, epoch: Epoch) -> None:
        """Climb along the mean of rows (B, N): a bias, which does not decay."""
        total = rows.sum(-2, keepdim=self.value.ndim > 1)
        self.velocity.mul_(epoch.momentum).add_(total, alpha=epoch.rate / rows.shape[-2])
        self.value.add_(self.velocity)

    def _add(self, left: Tensor, right: Tensor, momentum: float, step: float) -> None:
        add = self.velocity.addmm_ if left.ndim == 2 else self.velocity.baddbmm_
        add(left.mT, right, beta=momentum, alpha=step)

    def _climb(self, epoch: Epoch) -> None:
        self.value.mul_(1.0 - epoch.rate * self.decay).add_(self.velocity)


class Layer(ABC):
    """A layer that learns. probabilities: (N,), to draw each row. ascents: of its parameters, by name."""

    def __init__(
        self, learning: Learning, probabilities: Tensor, ascents: Mapping[str, Ascent], generator: torch.Generator
    ) -> None:
        self.learning, self.probabilities, self.ascents, self.generator = learning, probabilities, ascents, generator

    def epoch(self, number: int) -> float:
        """Learn for an epoch, counted from 0; the mean squared error of the last reconstruction.

        DivergedError where the weights leave all bounds.
        """
        return self.learn(schedule(self.learning, number, self.probabilities, self.generator))

    @abstractmethod
    def learn(self, epoch: Epoch) -> float:
        """Visit the epoch's batches; the mean squared error of the last reconstruction."""


class Stage(NamedTuple):
    """A layer's turn. begin: sets its first weights. layer: what learns, for weights that have begun.

    whole: whether the net is trained when it ends, so that it can be tried.
    """

    epochs: int
    begin: Callable[[], None]
    layer: Callable[[], Layer]
    whole: bool


def parameter(*shape: int) -> torch.nn.Parameter:
    """Zeros that learn by contrastive divergence, without autograd."""
    return torch.nn.Parameter(torch.zeros(*shape), requires_grad=False)
