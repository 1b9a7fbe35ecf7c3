"""Contrastive divergence, and the body-part RBM that learns by it (thesis 3.1, 3.2, 4.1).

Letters in shapes: B rows of a mini-batch, N all rows, D visible units, H hidden units, R restarts.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

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
    """A layer that learns from rows, which are drawn with probabilities (N,); ascents: of its parameters, by name."""

    def __init__(self, net: nn.Module, learning: Learning, probabilities: Tensor, generator: torch.Generator) -> None:
        self.learning, self.probabilities, self.generator = learning, probabilities, generator
        self.ascents = {name: Ascent(value.data, learning.decay) for name, value in net.named_parameters()}

    def epoch(self, number: int) -> float:
        """Learn for an epoch, counted from 0; the mean squared error of the last reconstruction.

        DivergedError where the weights leave all bounds.
        """
        return self._learn(schedule(self.learning, number, self.probabilities, self.generator))

    @abstractmethod
    def _learn(self, epoch: Epoch) -> float: ...


class Stage(NamedTuple):
    """A layer's turn. begin: sets its first weights. layer: what learns, for weights that have begun.

    whole: whether the net is trained when it ends, so that it can be tried.
    """

    epochs: int
    begin: Callable[[], None]
    layer: Callable[[], Layer]
    whole: bool


def parameter(*shape: int) -> nn.Parameter:
    """Zeros that learn by contrastive divergence, without autograd."""
    return nn.Parameter(torch.zeros(*shape), requires_grad=False)


class RBM(nn.Module):
    """Unit-variance Gaussian visible and binary hidden units.

    mask: (D, H), 1 where a visible and a hidden unit are connected (thesis figure 4.2).
    restarts: R machines that learn side by side, in little more time than one; every shape then has R in front.
    """

    mask: Tensor

    def __init__(self, mask: Tensor, restarts: int | None = None) -> None:
        super().__init__()
        stack, row = ((), ()) if restarts is None else ((restarts,), (restarts, 1))
        self.register_buffer("mask", mask)
        self.weight = parameter(*stack, *mask.shape)
        self.visible_bias = parameter(*row, mask.shape[0])
        self.hidden_bias = parameter(*row, mask.shape[1])

    def encode(self, visible: Tensor, temperature: float) -> Tensor:
        """Visible (B, D) to probabilities of the hidden units (B, H)."""
        return torch.sigmoid(_affine(self.hidden_bias, visible, self.weight) / temperature)

    def decode(self, hidden: Tensor) -> Tensor:
        """Hidden (B, H) to the means of the visible units (B, D)."""
        return _affine(self.visible_bias, hidden, self.weight.mT)

    def take(self, stack: "RBM", number: int) -> None:
        """Become one of the restarts of ``stack``."""
        for own, others in zip(self.parameters(), stack.parameters(), strict=True):
            own.data.copy_(others.data[number].reshape(own.shape))


def _affine(bias: Tensor, rows: Tensor, weight: Tensor) -> Tensor:
    return torch.addmm(bias, rows, weight) if weight.ndim == 2 else torch.baddbmm(bias, rows, weight)


def block_mask(visible_parts: Sequence[int], hidden_per_part: int) -> Tensor:
    """A mask (D, H) from the body part of each visible unit; hidden units are ``hidden_per_part`` of each part."""
    parts = torch.arange(max(visible_parts) + 1).repeat_interleave(hidden_per_part)
    return (torch.tensor(visible_parts)[:, None] == parts).float()


class RBMLayer(Layer):
    """An RBM that learns normalised frames (N, D) by contrastive divergence (thesis 3.2).

    Hidden units are sampled in the positive phase; the reconstruction ends in a mean field.
    """

    def __init__(
        self, rbm: RBM, frames: Tensor, probabilities: Tensor, learning: Learning, generator: torch.Generator
    ) -> None:
        super().__init__(rbm, learning, probabilities, generator)
        self.rbm, self.frames = rbm, frames

    @torch.inference_mode()
    def _learn(self, epoch: Epoch) -> float:
        rbm, generator = self.rbm, self.generator
        stack = rbm.weight.shape[:-2]
        visible_units, hidden_units = rbm.mask.shape
        # one draw for a whole epoch: small draws cost more than the arithmetic
        shape = (len(epoch.batches), self.learning.steps + 1, *stack, self.learning.batch)
        uniform = torch.rand(*shape, hidden_units, generator=generator, device=generator.device)
        normal = torch.randn(*shape, visible_units, generator=generator, device=generator.device)
        for rows, noise, jitter in zip(epoch.batches, uniform, normal, strict=True):
            visible = self.frames[rows].expand(*stack, -1, -1)
            hidden = (noise[0] < rbm.encode(visible, epoch.temperature)).float()
            end, end_hidden = reconstruct(rbm, hidden, noise[1:], jitter[1:], epoch.temperature)
            self.ascents["weight"].contrast((visible, hidden), (end, end_hidden), epoch)
            rbm.weight.mul_(rbm.mask)
            self.ascents["visible_bias"].mean(visible - end, epoch)
            self.ascents["hidden_bias"].mean(hidden - end_hidden, epoch)
        return float((visible - end).square().mean())


def reconstruct(rbm: RBM, hidden: Tensor, noise: Tensor, jitter: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
    """From hidden samples (B, H): k times sample visible and hidden, then the means of both, (B, D) and (B, H).

    noise (k, B, H) is uniform in [0, 1), jitter (k, B, D) standard normal.
    """
    for uniform, normal in zip(noise, jitter, strict=True):
        visible = rbm.decode(hidden) + normal
        hidden = (uniform < rbm.encode(visible, temperature)).float()
    end = rbm.decode(hidden)
    return end, rbm.encode(end, temperature)
