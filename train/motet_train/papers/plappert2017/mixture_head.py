"""A frame as a mixture of Gaussians, and the active flag as a Bernoulli variable (Plappert et al. 2017, section 4.3).

Letters in shapes: K components, D channels; "..." is any number of leading axes.
"""

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet_train.models.recurrent import mask

DENSITY_FLOOR = 1e-8
"""Added to each channel's density inside the logarithm of the surrogate, as in the authors' code."""


@dataclass(frozen=True, eq=False)
class Mixture:
    """The distribution of one frame: log_weights (..., K), means and variances (..., K, D), active (...) a logit.

    A channel whose variance is 0 is dead: it is always at its mean, and no part of the density.
    """

    log_weights: Tensor
    means: Tensor
    variances: Tensor
    active: Tensor

    def log_density(self, frames: Tensor) -> Tensor:
        """Logarithm of the mixture's density of frames (..., D), by log-sum-exp: eq. 8 without the flag."""
        return torch.logsumexp(self.log_weights + self._log_densities(frames).sum(dim=-1), dim=-1)

    def surrogate(self, frames: Tensor) -> Tensor:
        """The weighted mean of the components' log-densities of frames (..., D): eq. 12 without the flag.

        No product of densities is formed, and none lies below the floor, so that it neither over- nor underflows.
        """
        floored = torch.log(self._log_densities(frames).exp() + DENSITY_FLOOR).sum(dim=-1)
        return (self.log_weights.exp() * floored).sum(dim=-1)

    def log_flag(self, flags: Tensor) -> Tensor:
        """Logarithm of the probability of the flags (...), 1 or 0 (eq. 10)."""
        # not logsigmoid, which would be exported as the logarithm of a sigmoid that underflows
        return -functional.softplus(torch.where(flags > 0, -self.active, self.active))

    def log_likelihood(self, frames: Tensor, flags: Tensor) -> Tensor:
        """Of frames (..., D) with flags (...): eq. 8, and the flag's part alone where the flag is 0."""
        return torch.where(flags > 0, self.log_density(frames), 0.0) + self.log_flag(flags)

    def surrogate_loss(self, frames: Tensor, flags: Tensor) -> Tensor:
        """The terms of eq. 12, to be averaged, for frames (..., D) with flags (...)."""
        return -torch.where(flags > 0, self.surrogate(frames), 0.0) - self.log_flag(flags)

    def _log_densities(self, frames: Tensor) -> Tensor:
        """Of each channel under each component (..., K, D)."""
        living = self.variances > 0
        variances = torch.where(living, self.variances, 1.0)
        square = (frames[..., None, :] - self.means) ** 2 / variances
        return torch.where(living, -0.5 * (square + variances.log() + math.log(2 * math.pi)), 0.0)


class MixtureHead(nn.Module):
    """The output layer: from the decoder's outputs to the mixture (section 4.3.1), with dropout before it.

    2 K D + K + 1 outputs. floor: least variance; the paper has none, but without one the likelihood of a channel
    that never moves has no bound.
    """

    def __init__(self, inputs: int, channels: int, components: int, floor: float, dropout: float) -> None:
        super().__init__()
        self.sizes = [components * channels, components * channels, components, 1]
        self.components, self.floor, self.dropout = components, floor, dropout
        self.linear = nn.Linear(inputs, sum(self.sizes))
        nn.init.zeros_(self.linear.bias)
        for part in torch.split_with_sizes(self.linear.weight.detach(), self.sizes):
            nn.init.xavier_uniform_(part)

    def forward(self, x: Tensor) -> Mixture:
        """Outputs (..., S) of the decoder to mixtures."""
        keep = mask(self, self.dropout, x, *x.shape)
        parameters = self.linear(x if keep is None else x * keep).float()
        means, variances, weights, active = torch.split_with_sizes(parameters, self.sizes, dim=-1)
        shape = (*x.shape[:-1], self.components, -1)
        return Mixture(
            weights.log_softmax(dim=-1),
            means.reshape(shape),
            functional.softplus(variances).reshape(shape) + self.floor,
            active.squeeze(-1),
        )
