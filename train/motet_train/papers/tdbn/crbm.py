"""Conditional restricted Boltzmann machine: the past as directed input, control and free units above (thesis 3.2, 4.1).

Letters in shapes: B rows, N all rows, H visible units, K taps, C control units, F free hidden units.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from motet_train.papers.tdbn.rbm import DivergedError, Epoch, Layer, Learning, balanced, parameter


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


@dataclass(frozen=True, eq=False)
class Transitions:
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
    """How a CRBM learns from its past (Taylor 2007)."""

    noise: float = 0.0
    """Standard deviation of Gaussian noise on the past, so that the net learns the way back to its data."""
    rate: float = 1.0
    """Learning rate of the weights from the past to the visible units over that of the others."""
    own: int = 0
    """Of so many frames before the one that is learned, the net makes the last ones itself, any number of them, so
    that it learns the way back from where it strays: as DAgger learns (Ross 2011)."""


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
