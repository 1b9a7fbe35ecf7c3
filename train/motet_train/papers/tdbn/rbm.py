"""RBM, CRBM, and contrastive divergence, by which both learn (thesis 3.1, 3.2, 4.1).

Letters in shapes: B rows of a mini-batch, N all rows, D visible units, H hidden units, R restarts. The CRBM stands on
the codes of an RBM: it has H visible units, K taps, C control units and F free hidden units.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from typing import NamedTuple

import torch
from torch import Tensor, nn

from motet.errors import MotetError


class DivergedError(MotetError, ArithmeticError):
    """Training that diverged."""


@dataclass(frozen=True)
class Learning:
    """Settings of the training of one layer.

    final_rate: learning rate of the last epoch relative to the first. momentum_after: first epochs without momentum.
    steps: k of CD-k, reconstructions of the visible units; 1 is the procedure of thesis 3.2. temperature: of the
    sigmoids in the first and the last epoch. Rate and temperature change geometrically between these.
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
    updates = max(1, len(probabilities) // learning.batch)
    rows = torch.multinomial(probabilities, updates * learning.batch, replacement=True, generator=generator)
    momentum = learning.momentum if number >= learning.momentum_after else 0.0
    # rate and temperature fall geometrically with the share of the epochs that is done
    done = number / max(1, learning.epochs - 1)
    first, last = learning.temperature
    rate = learning.rate * learning.final_rate**done
    temperature = first * (last / first) ** done
    return Epoch(rate, momentum, temperature, rows.view(updates, learning.batch))


def balanced(weights: Sequence[Tensor]) -> Tensor:
    """Probabilities (N,) of rows: a motion is drawn uniformly, and one of its rows by that motion's weights.

    A long motion thus weighs no more than a short one (thesis 5.3: no bias to one gait).
    """
    return torch.cat([weight / weight.sum() for weight in weights]) / len(weights)


class Ascent:
    """Gradient ascent with momentum and weight decay on one parameter, in place.

    The parameter may be a stack of R; then the factors of its gradient have R in front.
    """

    def __init__(self, value: Tensor, decay: float) -> None:
        self.value = value
        self.decay = decay
        self.velocity = torch.zeros_like(value)

    def outer(self, left: Tensor, right: Tensor, epoch: Epoch) -> None:
        """Step along the mean over rows of left^T right, (B, N) and (B, M)."""
        self._add(left, right, epoch.momentum, epoch.rate / left.shape[-2])
        self._climb(epoch)

    def contrast(self, data: tuple[Tensor, Tensor], model: tuple[Tensor, Tensor], epoch: Epoch) -> None:
        """Step along <v h>data - <v h>model (thesis 3.2), each as its two factors (B, N), (B, M)."""
        step = epoch.rate / data[0].shape[-2]
        self._add(*model, epoch.momentum, -step)
        self._add(*data, 1.0, step)
        self._climb(epoch)

    def mean(self, rows: Tensor, epoch: Epoch) -> None:
        """Step along the mean of rows (B, N): for a bias, which does not decay."""
        total = rows.sum(-2, keepdim=self.value.ndim > 1)
        self.velocity.mul_(epoch.momentum).add_(total, alpha=epoch.rate / rows.shape[-2])
        self.value.add_(self.velocity)

    def _add(self, left: Tensor, right: Tensor, momentum: float, step: float) -> None:
        add = self.velocity.addmm_ if left.ndim == 2 else self.velocity.baddbmm_
        add(left.mT, right, beta=momentum, alpha=step)

    def _climb(self, epoch: Epoch) -> None:
        self.value.mul_(1.0 - epoch.rate * self.decay).add_(self.velocity)


class Layer(ABC):
    """A layer that learns from rows drawn with probabilities (N,). ascents: one for each parameter, by name."""

    def __init__(self, net: nn.Module, learning: Learning, probabilities: Tensor, generator: torch.Generator) -> None:
        self.learning = learning
        self.probabilities = probabilities
        self.generator = generator
        self.ascents = {name: Ascent(value.data, learning.decay) for name, value in net.named_parameters()}

    @abstractmethod
    def epoch(self, number: int) -> float:
        """Learn for an epoch, counted from 0, and return the mean squared error of the last reconstruction.

        DivergedError if weights grow without bound.
        """


class Stage(NamedTuple):
    """The training of one layer.

    begin: initialises its weights. layer: makes the layer for initialised weights. whole: whether the net is complete
    at its end, and can be tried.
    """

    epochs: int
    begin: Callable[[], None]
    layer: Callable[[], Layer]
    whole: bool


def parameter(*shape: int) -> nn.Parameter:
    """A parameter of zeros that learns by contrastive divergence, without autograd."""
    return nn.Parameter(torch.zeros(*shape), requires_grad=False)


class RBM(nn.Module):
    """Restricted Boltzmann machine with unit-variance Gaussian visible and binary hidden units (thesis 3.1).

    mask: (D, H), 1 where a visible and a hidden unit are connected (thesis figure 4.2). restarts: R machines that learn
    side by side, in little more time than one; every shape then has R in front.
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
        for value, stacked in zip(self.parameters(), stack.parameters(), strict=True):
            value.data.copy_(stacked.data[number].reshape(value.shape))


def _affine(bias: Tensor, rows: Tensor, weight: Tensor) -> Tensor:
    return torch.addmm(bias, rows, weight) if weight.ndim == 2 else torch.baddbmm(bias, rows, weight)


def block_mask(visible_parts: Sequence[int], hidden_per_part: int) -> Tensor:
    """A mask (D, H) from the body part of each visible unit, with ``hidden_per_part`` hidden units for each part."""
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
        self.rbm = rbm
        self.frames = frames

    @torch.inference_mode()
    def epoch(self, number: int) -> float:
        """As in any :class:`Layer`."""
        epoch = schedule(self.learning, number, self.probabilities, self.generator)
        # one draw for a whole epoch: small draws cost more than the arithmetic
        uniform, normal = self._noise(len(epoch.batches))
        for rows, noise, jitter in zip(epoch.batches, uniform, normal, strict=True):
            error = self._update(rows, noise, jitter, epoch)
        return float(error.square().mean())

    def _noise(self, batches: int) -> tuple[Tensor, Tensor]:
        """Uniform numbers (batches, k, [R,] B, H), and normal ones (batches, k, [R,] B, D)."""
        generator = self.generator
        stack = self.rbm.weight.shape[:-2]
        visible_units, hidden_units = self.rbm.mask.shape
        shape = (batches, self.learning.steps, *stack, self.learning.batch)
        uniform = torch.rand(*shape, hidden_units, generator=generator, device=generator.device)
        normal = torch.randn(*shape, visible_units, generator=generator, device=generator.device)
        return uniform, normal

    def _update(self, rows: Tensor, noise: Tensor, jitter: Tensor, epoch: Epoch) -> Tensor:
        """Learn from one mini-batch by CD-k; the error of the reconstruction ([R,] B, D)."""
        rbm = self.rbm
        # positive phase: hidden units sampled from the data
        visible = self.frames[rows].expand(*rbm.weight.shape[:-2], -1, -1)
        hidden = (noise[0] < rbm.encode(visible, epoch.temperature)).float()
        # negative phase: the k-th reconstruction
        end, end_hidden = reconstruct(rbm, hidden, noise[1:], jitter[1:], epoch.temperature)
        # step along the difference of their statistics; units of different body parts stay unconnected
        self.ascents["weight"].contrast((visible, hidden), (end, end_hidden), epoch)
        rbm.weight.mul_(rbm.mask)
        self.ascents["visible_bias"].mean(visible - end, epoch)
        self.ascents["hidden_bias"].mean(hidden - end_hidden, epoch)
        return visible - end


def reconstruct(rbm: RBM, hidden: Tensor, noise: Tensor, jitter: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
    """From hidden samples (B, H), sample visible and hidden units k - 1 times; the means of both, (B, D) and (B, H).

    noise (k - 1, B, H) is uniform in [0, 1), jitter (k - 1, B, D) standard normal.
    """
    for uniform, normal in zip(noise, jitter, strict=True):
        visible = rbm.decode(hidden) + normal
        hidden = (uniform < rbm.encode(visible, temperature)).float()
    end = rbm.decode(hidden)
    return end, rbm.encode(end, temperature)


class CRBM(nn.Module):
    """Conditional RBM: visible units driven by the past and by a second hidden layer (thesis figure 3.5).

    The second hidden layer is C control units, which are set, and F free units, which are inferred. Visible units are
    binary, or, with ``taylor``, real with unit variance; then the past also drives the free units (Taylor 2007).
    """

    free_past_weight: nn.Parameter | None

    def __init__(self, visible: int, taps: int, control: int, free: int, taylor: bool = False) -> None:
        super().__init__()
        self.control_units = control
        self.free_units = free
        self.gaussian = taylor
        self.past_weight = parameter(taps * visible, visible)
        self.hidden_weight = parameter(control + free, visible)
        self.visible_bias = parameter(visible)
        self.hidden_bias = parameter(control + free)
        self.register_parameter("free_past_weight", parameter(taps * visible, free) if taylor else None)

    def drive(self, past: Tensor, control: Tensor) -> Tensor:
        """Input of the visible units (B, H) from the past (B, K H) and the control units (B, C): dynamic biases."""
        from_past = torch.addmm(self.visible_bias, past, self.past_weight)
        return torch.addmm(from_past, control, self.hidden_weight[: self.control_units])

    def visible(self, drive: Tensor, free: Tensor, temperature: Tensor | float) -> Tensor:
        """Means of the visible units (B, H) given their drive (B, H) and the free units (B, F)."""
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
    """Training data of a CRBM: past (N, K H), visible (N, H), control (N, C), and probabilities (N,) of the rows.

    rival: (N, C) the mean control of the other motions that repeat, or the row's control where there is none. repeats:
    (N,) whether the row's motion repeats. If the net makes some of its past itself, that many frames and controls more
    come before these.
    """

    past: Tensor
    visible: Tensor
    control: Tensor
    probabilities: Tensor
    rival: Tensor
    repeats: Tensor


def transitions(
    codes: Sequence[Sequence[Tensor]],
    controls: Sequence[Sequence[Tensor]],
    taps: int,
    onsets: Sequence[float],
    extra: int = 0,
) -> Transitions:
    """Cut the sequences (T, H) of each group, such as those of a label, into windows of K past frames and the next one.

    controls: the control units (T, C) of each sequence's frames. onsets: for each group how many times as often the
    first window of a sequence is drawn as its last, geometric between: a motion that ends must be entered at its
    start; 1 for a motion that repeats. extra: number of additional frames and controls before these, see :class:`Past`.
    """
    # windows of past codes with the next one, and of the controls beside them
    reach = taps + extra
    windows = [sequence.unfold(0, reach + 1, 1) for sequence in chain.from_iterable(codes)]
    units = [track[taps:].unfold(0, extra + 1, 1) for track in chain.from_iterable(controls)]
    every = torch.cat(windows).transpose(1, 2)
    control = torch.cat(units).transpose(1, 2).flatten(1)
    # rare onsets weigh more, and pasts of other labels stand in for some body parts
    weights = [_window_weights(group, reach, onset) for group, onset in zip(codes, onsets, strict=True)]
    rival, repeats = _rivals(control, list(map(len, weights)), [onset == 1 for onset in onsets])
    return Transitions(every[:, :reach].flatten(1), every[:, reach], control, balanced(weights), rival, repeats)


def _rivals(control: Tensor, counts: Sequence[int], repeating: Sequence[bool]) -> tuple[Tensor, Tensor]:
    """rival and repeats of :class:`Transitions`, from the control (N, C) of all windows and their number by group."""
    of_groups = torch.split_with_sizes(control, counts)
    rival = []
    for number, of_group in enumerate(of_groups):
        others = []
        for other, repeats in enumerate(repeating):
            if repeats and other != number:
                others.append(of_groups[other].mean(0))
        has_rival = repeating[number] and bool(others)
        rival.append(torch.stack(others).mean(0).expand_as(of_group) if has_rival else of_group)
    return torch.cat(rival), torch.tensor(repeating, device=control.device).repeat_interleave(torch.tensor(counts))


def _window_weights(sequences: Sequence[Tensor], reach: int, onset: float) -> Tensor:
    """Weights of the windows of a group, falling geometrically along each sequence from ``onset`` to 1."""
    return torch.cat([onset ** torch.linspace(1, 0, len(sequence) - reach) for sequence in sequences])


@dataclass(frozen=True)
class Past:
    """The use of the past in the training of a CRBM (Taylor 2007).

    noise: standard deviation of Gaussian noise on the past, so that the net learns to return to its data. rate: of the
    weights from the past to the visible units, relative to the others. unrolled: of this many frames before the one to
    learn, the net makes a random number of the last ones itself, and so learns to return from where it strays, as in
    DAgger (Ross 2011).

    Windows of motions that repeat, such as gaits, may borrow from others. borrowed: the probability with which the past
    of a body part is that of a window drawn at random. The net so learns to take a body along whose parts move
    differently, instead of letting it rest between two gaits. block: codes of a body part. rival: the largest share of
    the control of the other motions that repeat; the share is uniform. The net so learns to keep its gait under a
    control that is not pure.
    """

    noise: float = 0.0
    rate: float = 1.0
    unrolled: int = 0
    borrowed: float = 0.0
    block: int = 1
    rival: float = 0.0


class CRBMLayer(Layer):
    """A CRBM that learns by contrastive divergence with the past held fixed (thesis 3.2, 5.2).

    clamped: control units keep their values in the reconstruction; otherwise they are inferred from it (thesis 5.3).
    """

    def __init__(
        self,
        crbm: CRBM,
        data: Transitions,
        learning: Learning,
        generator: torch.Generator,
        clamped: bool,
        recall: Past,
    ) -> None:
        super().__init__(crbm, learning, data.probabilities, generator)
        self.crbm = crbm
        self.data = data
        self.clamped = clamped
        self.recall = recall

    @torch.no_grad()
    def epoch(self, number: int) -> float:
        """As in any :class:`Layer`."""
        epoch = schedule(self.learning, number, self.probabilities, self.generator)
        for rows in epoch.batches:
            past, control = self._windows(rows)
            error = self._update(past, self.data.visible[rows], control, epoch)
        if not self.crbm.past_weight.abs().max() <= 1000:  # normally weights stay near 1
            raise DivergedError("training diverged: the CRBM has weights beyond 1000")
        return float(error.square().mean())

    def _windows(self, rows: Tensor) -> tuple[Tensor, Tensor]:
        """Past (B, K H) and control (B, C) of windows (B,), with what they borrow, see :class:`Past`."""
        past = self.data.past[rows]
        control = self.data.control[rows]
        if not self.recall.borrowed and not self.recall.rival:
            return past, control
        share = self.recall.rival * torch.rand(len(rows), 1, generator=self.generator, device=past.device)
        return self._borrowed_past(rows, past), torch.lerp(control, self.data.rival[rows], share)

    def _borrowed_past(self, rows: Tensor, past: Tensor) -> Tensor:
        """The past (B, K H) of windows (B,), of some body parts another window's in all its frames."""
        codes = len(self.crbm.visible_bias)
        block = self.recall.block
        others = torch.multinomial(self.probabilities, len(rows), replacement=True, generator=self.generator)
        chances = torch.rand(len(rows), codes // block, generator=self.generator, device=past.device)
        of_part = (chances < self.recall.borrowed) & self.data.repeats[rows, None]
        of_code = of_part.repeat_interleave(block, dim=1).repeat(1, past.shape[1] // codes)
        return torch.where(of_code, self.data.past[others], past)

    def _update(self, past: Tensor, visible: Tensor, control: Tensor, epoch: Epoch) -> Tensor:
        """Learn from one mini-batch by CD-k; the error of the reconstruction (B, H)."""
        crbm = self.crbm
        past, control = self._as_in_use(past, control, epoch.temperature)
        # positive phase: free units sampled from the data
        free = self._sampled(visible, past, epoch.temperature)
        # negative phase: the reconstruction after k Gibbs steps, the past held fixed
        end, end_free = self._reconstructed(past, control, free, epoch.temperature)
        end_control = control if self.clamped else crbm.control(end, epoch.temperature)
        # step along the difference of their statistics
        past_epoch = replace(epoch, rate=epoch.rate * self.recall.rate)
        self.ascents["past_weight"].outer(past, visible - end, past_epoch)
        if crbm.free_past_weight is not None:
            self.ascents["free_past_weight"].outer(past, free - end_free, epoch)
        hidden = torch.cat([control, free], 1)
        end_hidden = torch.cat([end_control, end_free], 1)
        self._climb(visible, hidden, end, end_hidden, epoch)
        return visible - end

    def _climb(self, visible: Tensor, hidden: Tensor, end: Tensor, end_hidden: Tensor, epoch: Epoch) -> None:
        """Step the weights between the visible units and the second hidden layer, and the biases of both."""
        self.ascents["hidden_weight"].contrast((hidden, visible), (end_hidden, end), epoch)
        self.ascents["hidden_bias"].mean(hidden - end_hidden, epoch)
        self.ascents["visible_bias"].mean(visible - end, epoch)

    def _as_in_use(self, past: Tensor, control: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
        """A past as it is when the net runs, noisy or made by the net, and the control of the frame after it."""
        noise = self.recall.noise
        if noise:
            past = past + noise * torch.randn(past.shape, generator=self.generator, device=past.device)
        return self._unroll(past, control, temperature) if self.recall.unrolled else (past, control)

    def _reconstructed(self, past: Tensor, control: Tensor, free: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
        """Means of the visible units (B, H) and of the free units (B, F) after k Gibbs steps from free units."""
        crbm = self.crbm
        drive = crbm.drive(past, control)
        # without free units the first step is the last
        for _ in range(self.learning.steps - 1 if crbm.free_units else 0):
            free = self._sampled(crbm.visible(drive, free, temperature), past, temperature)
        end = crbm.visible(drive, free, temperature)
        return end, crbm.free(end, past, temperature)

    def _unroll(self, past: Tensor, control: Tensor, temperature: float) -> tuple[Tensor, Tensor]:
        """A past (B, K H) that ends with frames made by the net, and the control (B, C) of the frame after it."""
        unrolled = self.recall.unrolled
        controls = control.view(len(control), unrolled + 1, -1).unbind(1)
        frames = past.view(len(past), -1, len(self.crbm.visible_bias))
        # a random number of recorded frames come first
        start = int(torch.randint(unrolled + 1, (1,), generator=self.generator, device=self.generator.device))
        history = frames[:, start : start + frames.shape[1] - unrolled]
        for units in controls[start:-1]:
            codes = self._next_codes(history, units, temperature)
            history = torch.cat([history[:, 1:], codes[:, None]], dim=1)
        return history.flatten(1), controls[-1]

    def _next_codes(self, history: Tensor, units: Tensor, temperature: float) -> Tensor:
        """The means (B, H) that follow a history (B, K, H) under control units (B, C)."""
        past = history.flatten(1)
        free = self.crbm.free(history[:, -1], past, temperature)
        return self.crbm.visible(self.crbm.drive(past, units), free, temperature)

    def _sampled(self, visible: Tensor, past: Tensor, temperature: float) -> Tensor:
        """Samples of the free units (B, F)."""
        free = self.crbm.free(visible, past, temperature)
        if not self.crbm.free_units:
            return free
        # torch.bernoulli would fail on NaN: divergence is reported at the end of the epoch
        return (torch.rand(free.shape, generator=self.generator, device=free.device) < free).to(free.dtype)
