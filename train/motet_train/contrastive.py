"""Contrastive divergence: what RBM and CRBM share of their learning (thesis 3.2).

Letters in shapes: B rows of a mini-batch, N all rows, D visible units, H hidden units.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

Progress = Callable[[str, int, int], None]
"""Called after each epoch with the layer's name, the epochs done and their number."""


@dataclass(frozen=True)
class Learning:
    """How one layer learns."""

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


def epochs(learning: Learning, probabilities: Tensor, generator: torch.Generator) -> Iterator[Epoch]:
    """The schedule; rows are drawn with the given probabilities (N,), about N of them in an epoch."""
    first, last = learning.temperature
    updates = max(1, len(probabilities) // learning.batch)
    for epoch in range(learning.epochs):
        done = epoch / max(1, learning.epochs - 1)
        momentum = learning.momentum if epoch >= learning.momentum_after else 0.0
        rows = torch.multinomial(probabilities, updates * learning.batch, replacement=True, generator=generator)
        rate, temperature = learning.rate * learning.final_rate**done, first * (last / first) ** done
        yield Epoch(rate, momentum, temperature, rows.view(updates, learning.batch))


def balanced(weights: Sequence[Tensor]) -> Tensor:
    """Probabilities (N,) to draw each row: a motion uniformly, then one of its rows by that motion's weights.

    So a long motion weighs no more than a short one (thesis 5.3: no bias to one gait).
    """
    return torch.cat([weight / weight.sum() for weight in weights]) / len(weights)


class Ascent:
    """Gradient ascent with momentum and decay on one parameter, in place."""

    def __init__(self, value: Tensor, decay: float) -> None:
        self.value, self.decay = value, decay
        self.velocity = torch.zeros_like(value)

    def outer(self, left: Tensor, right: Tensor, epoch: Epoch) -> None:
        """Climb along the mean of left^T right, (B, N) and (B, M)."""
        self.velocity.addmm_(left.T, right, beta=epoch.momentum, alpha=epoch.rate / len(left))
        self._climb(epoch)

    def contrast(self, data: tuple[Tensor, Tensor], model: tuple[Tensor, Tensor], epoch: Epoch) -> None:
        """Climb along <v h>data - <v h>model, each given as its two factors (B, N), (B, M)."""
        step = epoch.rate / len(data[0])
        self.velocity.addmm_(model[0].T, model[1], beta=epoch.momentum, alpha=-step)
        self.velocity.addmm_(data[0].T, data[1], alpha=step)
        self._climb(epoch)

    def mean(self, rows: Tensor, epoch: Epoch) -> None:
        """Climb along the mean of rows (B, N): a bias, which does not decay."""
        self.velocity.mul_(epoch.momentum).add_(rows.sum(0), alpha=epoch.rate / len(rows))
        self.value.add_(self.velocity)

    def _climb(self, epoch: Epoch) -> None:
        self.value.mul_(1.0 - epoch.rate * self.decay).add_(self.velocity)


def parameter(*shape: int) -> torch.nn.Parameter:
    """Zeros that learn by contrastive divergence, without autograd."""
    return torch.nn.Parameter(torch.zeros(*shape), requires_grad=False)
