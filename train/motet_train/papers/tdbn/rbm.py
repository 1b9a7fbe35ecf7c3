"""RBM and CRBM, and contrastive divergence, by which both learn (thesis 3.1, 3.2, 4.1).

Letters in shapes: B rows of a mini-batch, N all rows, D visible units, H hidden units, R restarts; of the CRBM, which
stands on the codes of an RBM, H visible units, K taps, C control units, F free hidden units.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import torch
from torch import Tensor, nn

from motet.errors import MotetError


class DivergedError(MotetError, ArithmeticError):
    """Training that diverged."""


@dataclass(frozen=True)
class Learning:
    """How one layer is trained.

    final_rate: the rate of the last epoch over that of the first. momentum_after: epochs without momentum. steps: k of
    CD-k, Gibbs steps of the reconstruction. temperature: of the sigmoids in the first and the last epoch. Between the
    first and the last epoch both are geometric.
    """

    epochs: int
    rate: float = 1e-3
    final_rate: float = 1.0
    batch: int = 20
    momentum: float = 0.9
    momentum_after: int = 5
    decay: float = 2e-6
    steps: int = 1
    temperature: tuple[float, float] = (1.0, 0.6)


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


class CRBM(nn.Module):
    """Visible units driven by the past and by a second hidden layer (figure 3.5).

    The second hidden layer is C control units, which are given, and F free units, which are inferred. Visible units
    are binary, or with ``taylor`` real with unit variance, and then the past drives the free units too (Taylor 2007).
    """

    free_past_weight: nn.Parameter | None

    def __init__(self, visible: int, taps: int, control: int, free: int, taylor: bool = False) -> None:
        super().__init__()
        self.control_units, self.free_units, self.gaussian = control, free, taylor
        self.past_weight = parameter(taps * visible, visible)
        self.hidden_weight = parameter(control + free, visible)
        self.visible_bias = parameter(visible)
        self.hidden_bias = parameter(control + free)
        self.register_parameter("free_past_weight", parameter(taps * visible, free) if taylor else None)

    def drive(self, past: Tensor, control: Tensor) -> Tensor:
        """What the past (B, K H) and the control units (B, C) put on the visible units (B, H)."""
        given = torch.addmm(self.visible_bias, past, self.past_weight)
        return torch.addmm(given, control, self.hidden_weight[: self.control_units])

    def visible(self, drive: Tensor, free: Tensor, temperature: Tensor | float) -> Tensor:
        """Means of the visible units (B, H) given what drives them (B, H) and the free units (B, F)."""
        total = torch.addmm(drive, free, self.hidden_weight[self.control_units :]) if self.free_units else drive
        return total if self.gaussian else torch.sigmoid(total / temperature)

    def control(self, visible: Tensor, temperature: Tensor | float) -> Tensor:
        """Probabilities of the control units (B, C) given the visible units (B, H)."""
        units = self.control_units
        total = torch.addmm(self.hidden_bias[:units], visible, self.hidden_weight[:units].T)
        return torch.sigmoid(total / temperature)

    def free(self, visible: Tensor, past: Tensor, temperature: Tensor | float) -> Tensor:
        """Probabilities of the free units (B, F) given the visible units (B, H) and the past (B, K H)."""
        units = self.control_units
        total = torch.addmm(self.hidden_bias[units:], visible, self.hidden_weight[units:].T)
        if self.free_past_weight is not None:
            total = torch.addmm(total, past, self.free_past_weight)
        return torch.sigmoid(total / temperature)


class Transitions(NamedTuple):
    """What a CRBM learns from: past (N, K H), visible (N, H), control (N, C), and probabilities (N,) to draw each.

    Where the net makes some of its past itself, there are as many frames and controls more, before those.
    """

    past: Tensor
    visible: Tensor
    control: Tensor
    probabilities: Tensor


def transitions(
    codes: Sequence[Sequence[Tensor]],
    controls: Sequence[Sequence[Tensor]],
    taps: int,
    onsets: Sequence[float],
    own: int = 0,
) -> Transitions:
    """Cut the sequences (T, H) of each group, such as those of a label, into windows of K past frames and the next one.

    controls: the control units (T, C) of each sequence's frames. onsets: for each group how many times as often the
    first window of a sequence is drawn as its last, geometric between: a motion that ends has to be entered at its
    start. own: how many frames more there are before, and how many controls, see :class:`Past`.
    """
    reach = taps + own
    every = torch.cat([sequence.unfold(0, reach + 1, 1) for found in codes for sequence in found]).transpose(1, 2)
    told = torch.cat([units[taps:].unfold(0, own + 1, 1) for found in controls for units in found])
    weights = [
        torch.cat([onset ** torch.linspace(1, 0, len(sequence) - reach) for sequence in found])
        for onset, found in zip(onsets, codes, strict=True)
    ]
    control = told.transpose(1, 2).flatten(1)
    return Transitions(every[:, :reach].flatten(1), every[:, reach], control, balanced(weights))


@dataclass(frozen=True)
class Past:
    """How a CRBM learns from its past (Taylor 2007).

    noise: standard deviation of Gaussian noise on it, so that the net learns the way back to its data. rate: of the
    weights from the past to the visible units over that of the others. own: of so many frames before the one that is
    learned, the net makes the last ones itself, any number of them, and so learns the way back from where it strays, as
    DAgger does (Ross 2011).
    """

    noise: float = 0.0
    rate: float = 1.0
    own: int = 0


class CRBMLayer(Layer):
    """A CRBM that learns by contrastive divergence with the past held fixed (thesis 3.2, 5.2).

    clamped: control units keep their values in the reconstruction; else they are inferred from it (thesis 5.3).
    """

    def __init__(
        self, crbm: CRBM, data: Transitions, learning: Learning, generator: torch.Generator, clamped: bool, recall: Past
    ) -> None:
        super().__init__(crbm, learning, data.probabilities, generator)
        self.crbm, self.data, self.clamped, self.recall = crbm, data, clamped, recall

    @torch.no_grad()
    def _learn(self, epoch: Epoch) -> float:
        for rows in epoch.batches:
            error = self._update(self.data.past[rows], self.data.visible[rows], self.data.control[rows], epoch)
        if not self.crbm.past_weight.abs().max() <= 1000:  # normally weights stay near 1
            raise DivergedError("training diverged: the CRBM has weights beyond 1000")
        return float(error.square().mean())

    def _update(self, past: Tensor, visible: Tensor, control: Tensor, epoch: Epoch) -> Tensor:
        crbm, recall, generator, climb = self.crbm, self.recall, self.generator, self.ascents
        if recall.noise:
            past = past + recall.noise * torch.randn(past.shape, generator=generator, device=past.device)
        if recall.own:
            past, control = self._own(past, control, epoch.temperature)
        free = self._sampled(visible, past, epoch.temperature)
        drive, begun = crbm.drive(past, control), free
        for _ in range(self.learning.steps - 1 if crbm.free_units else 0):  # Gibbs steps
            begun = self._sampled(crbm.visible(drive, begun, epoch.temperature), past, epoch.temperature)
        end = crbm.visible(drive, begun, epoch.temperature)
        end_free = crbm.free(end, past, epoch.temperature)
        end_control = control if self.clamped else crbm.control(end, epoch.temperature)
        hidden, end_hidden = torch.cat([control, free], 1), torch.cat([end_control, end_free], 1)
        climb["past_weight"].outer(past, visible - end, replace(epoch, rate=epoch.rate * recall.rate))
        if crbm.free_past_weight is not None:
            climb["free_past_weight"].outer(past, free - end_free, epoch)
        climb["hidden_weight"].contrast((hidden, visible), (end_hidden, end), epoch)
        climb["hidden_bias"].mean(hidden - end_hidden, epoch)
        climb["visible_bias"].mean(visible - end, epoch)
        return visible - end

    def _own(self, past: Tensor, control: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
        """A past (B, K H) that ends with frames of the net's own, and the control (B, C) of the frame after it."""
        crbm, own = self.crbm, self.recall.own
        told = control.view(len(control), own + 1, -1).unbind(1)
        frames = past.view(len(past), -1, len(crbm.visible_bias))
        start = int(torch.randint(own + 1, (1,), generator=self.generator, device=self.generator.device))
        history = frames[:, start : start + frames.shape[1] - own]
        for units in told[start:-1]:
            before = history.flatten(1)
            free = crbm.free(history[:, -1], before, temperature)
            new = crbm.visible(crbm.drive(before, units), free, temperature)
            history = torch.cat([history[:, 1:], new[:, None]], dim=1)
        return history.flatten(1), told[-1]

    def _sampled(self, visible: Tensor, past: Tensor, temperature: float) -> Tensor:
        """Free units (B, F)."""
        free = self.crbm.free(visible, past, temperature)
        if not self.crbm.free_units:
            return free
        # not torch.bernoulli: learning that blows up is noticed at the end of its epoch
        return (torch.rand(free.shape, generator=self.generator, device=free.device) < free).to(free.dtype)
