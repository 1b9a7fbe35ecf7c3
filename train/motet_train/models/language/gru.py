"""Gated recurrent units with one bias per gate (Cho et al. 2014; Plappert et al. 2017, table 1).

Letters in shapes: G directions, T steps, B rows, I inputs, N units. The directions of a layer run side by side, as one
batched product; each has its own weights.
"""

from collections.abc import Callable

import torch
from torch import Tensor, nn

from motet_train.models.language.dropout import mask

GATES: dict[str, Callable[[Tensor], Tensor]] = {
    "sigmoid": torch.sigmoid,
    "hard": lambda x: (0.2 * x + 0.5).clamp(0.0, 1.0),
}
"""Squashing of the gates: the paper names the GRU of Cho et al., its authors' library had the piecewise linear one."""


class GRU(nn.Module):
    """One layer; the reset gate acts before the recurrent product: candidate tanh(W x + b + U (r * h)).

    3 N (I + N + 1) parameters for each direction. dropout: of the inputs and of the recurrent state in training, with
    one mask for a whole sequence.
    """

    def __init__(self, inputs: int, units: int, directions: int, gates: str, dropout: float) -> None:
        super().__init__()
        self.units, self.gates, self.dropout = units, gates, dropout
        self.weight = nn.Parameter(torch.empty(directions, inputs, 3 * units))
        self.bias = nn.Parameter(torch.zeros(directions, 1, 3 * units))
        self.gate_recurrence = nn.Parameter(torch.empty(directions, units, 2 * units))
        self.candidate_recurrence = nn.Parameter(torch.empty(directions, units, units))
        for weight in (self.weight, self.gate_recurrence, self.candidate_recurrence):
            _initialise(weight.detach(), units, recurrent=weight is not self.weight)

    def forward(self, x: Tensor, active: Tensor | None = None) -> Tensor:
        """A sequence (G, T, B, I) to the state after each step (G, T, B, N), from a state of zeros.

        active: (G, T, B, 1); the state stays as it is where this is False.
        """
        directions, steps, rows, inputs = x.shape
        keep = mask(self, self.dropout, x, directions, 1, rows, inputs)
        x = x if keep is None else x * keep
        gates, candidates = (y.reshape(directions, steps, rows, -1) for y in self.project(x.flatten(1, 2)))
        keep = mask(self, self.dropout, x, directions, rows, self.units)

        def advance(state: Tensor, given: list[Tensor]) -> Tensor:
            new = self.cell(state, given[0], given[1], keep)
            return new if active is None else torch.where(given[2], new, state)

        start = x.new_zeros(directions, rows, self.units)
        return recur(advance, start, [gates, candidates] if active is None else [gates, candidates, active])

    def step(self, x: Tensor, state: Tensor) -> Tensor:
        """One step of a layer of one direction: inputs (B, I) and state (B, N) to the next state (B, N)."""
        gates, candidate = self.project(x[None])
        return self.cell(state[None], gates, candidate, None)[0]

    def project(self, x: Tensor) -> tuple[Tensor, Tensor]:
        """What inputs (G, ?, I) add to both gates (G, ?, 2 N) and to the candidate (G, ?, N), in one product."""
        sizes = [2 * self.units, self.units]
        gates, candidate = torch.split_with_sizes(x @ self.weight + self.bias, sizes, dim=-1)
        return gates, candidate

    def cell(self, state: Tensor, gates: Tensor, candidate: Tensor, keep: Tensor | None) -> Tensor:
        """The next state (G, B, N) from this one and what :meth:`project` gave; keep: mask of the recurrent state."""
        seen = state if keep is None else state * keep
        update, reset = GATES[self.gates](gates + seen @ self.gate_recurrence).chunk(2, dim=-1)
        new = torch.tanh(candidate + (reset * seen) @ self.candidate_recurrence)
        return new + update * (state - new)


def recur(advance: Callable[[Tensor, list[Tensor]], Tensor], start: Tensor, sequences: list[Tensor]) -> Tensor:
    """States after each step (G, T, B, N) of ``advance``, which is given the sequences (G, T, ...) at one step.

    A loop, and in an exported graph, where the number of steps is not known, one scan over the same function.
    """
    if torch.compiler.is_exporting():
        from torch._higher_order_ops.scan import scan  # private, and so needed by nothing but the export

        moved = [sequence.transpose(0, 1) for sequence in sequences]

        def body(state: Tensor, given: list[Tensor]) -> tuple[Tensor, Tensor]:
            new = advance(state, given)
            return new, new.clone()

        found: Tensor = scan(body, start, moved)[1]
        return found.transpose(0, 1)
    states = []
    for given in zip(*(sequence.unbind(1) for sequence in sequences), strict=True):
        start = advance(start, list(given))
        states.append(start)
    return torch.stack(states, dim=1)


def _initialise(weight: Tensor, units: int, recurrent: bool) -> None:
    """Each gate of each direction on its own: inputs Glorot uniform, recurrent matrices 1.1 times orthogonal."""
    for gate in (gate for direction in weight for gate in direction.split(units, dim=-1)):
        if recurrent:
            nn.init.orthogonal_(gate, gain=1.1)
        else:
            nn.init.xavier_uniform_(gate)
