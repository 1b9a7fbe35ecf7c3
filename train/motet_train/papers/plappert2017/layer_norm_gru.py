"""The gated recurrent unit with layer normalisation (Ba et al. 2016; Plappert et al. 2017, section 5.2)."""

import torch
from torch import Tensor, nn
from torch.nn.functional import layer_norm

from motet_train.models.recurrent import GATES, GRU


class LayerNormGRU(GRU):
    """One layer; the reset gate acts after the recurrent product: candidate tanh(LN(W x + b) + r * LN(U h)).

    Four normalisations, each with gain and bias, 12 N parameters for each direction: of the inputs of both gates
    jointly, of the input of the candidate, and of the recurrent products of the same two.
    """

    def __init__(self, inputs: int, units: int, directions: int, gates: str, dropout: float) -> None:
        super().__init__(inputs, units, directions, gates, dropout)
        self.input_gate_norm, self.gate_norm = (Norm(directions, 2 * units) for _ in range(2))
        self.input_candidate_norm, self.candidate_norm = (Norm(directions, units) for _ in range(2))

    def project(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """As of the plain unit, normalised."""
        gates, candidate = super().project(x)
        return self.input_gate_norm(gates), self.input_candidate_norm(candidate)

    def cell(self, state: Tensor, gates: Tensor, candidate: Tensor, keep: Tensor | None) -> Tensor:
        """The next state (G, B, N); see :meth:`GRU.cell`."""
        seen = state if keep is None else state * keep
        squashed = GATES[self.gates](gates + self.gate_norm(seen @ self.gate_recurrence))
        update, reset = squashed.chunk(2, dim=-1)
        new = torch.tanh(candidate + reset * self.candidate_norm(seen @ self.candidate_recurrence))
        return new + update * (state - new)


class Norm(nn.Module):
    """Layer normalisation with a gain and a bias for each direction."""

    def __init__(self, directions: int, units: int) -> None:
        super().__init__()
        self.gain = nn.Parameter(torch.ones(directions, 1, units))
        self.bias = nn.Parameter(torch.zeros(directions, 1, units))

    def forward(self, x: Tensor) -> Tensor:
        """(G, ?, N) to the same shape: zero mean and unit variance over N, times the gain, plus the bias."""
        normal: Tensor = layer_norm(x, x.shape[-1:])
        return normal * self.gain + self.bias
