"""Gaussian-Bernoulli restricted Boltzmann machine, block-sparse by body part (thesis 3.1, 3.2, 4.1).

Letters in shapes: B rows, D visible units, H hidden units, R restarts.
"""

from collections.abc import Sequence

import torch
from torch import Tensor, nn

from motet_train.papers.tdbn.contrastive import Ascent, Epoch, Layer, Learning, parameter


class RBM(nn.Module):
    """Unit-variance Gaussian visible and binary hidden units.

    mask: (D, H), 1 where a visible and a hidden unit are connected (thesis figure 4.2).
    restarts: R machines that learn side by side, in little more time than one; every shape then has R in front.
    """

    mask: Tensor

    def __init__(self, mask: Tensor, restarts: int | None = None) -> None:
        super().__init__()
        stack = () if restarts is None else (restarts,)
        row = () if restarts is None else (restarts, 1)
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
        self.rbm, self.frames = rbm, frames
        ascents = {name: Ascent(value.data, learning.decay) for name, value in rbm.named_parameters()}
        super().__init__(learning, probabilities, ascents, generator)

    @torch.inference_mode()
    def learn(self, epoch: Epoch) -> float:
        """Visit the epoch's batches."""
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
