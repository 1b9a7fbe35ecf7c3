"""Recurrent layers of nets between motion and language, and dropout that keeps its mask for a whole sequence.

Letters in shapes: G directions, T steps, B rows, I inputs, N units, C units of the context, E units of a token (the
previous word or frame), S units of all layers.
"""

from collections.abc import Callable, Sequence
from typing import cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet_train.models.net import before

GATES: dict[str, Callable[[Tensor], Tensor]] = {
    "sigmoid": torch.sigmoid,
    "hard": lambda x: (0.2 * x + 0.5).clamp(0.0, 1.0),
}
"""Squashing of the gates: the paper names the GRU of Cho et al., its authors' library had the piecewise linear one."""

ONNX = {"sigmoid": "Sigmoid", "hard": "HardSigmoid"}
"""What ONNX calls them."""


def mask(module: nn.Module, rate: float, like: Tensor, *shape: int) -> Tensor | None:
    """Factors that are 0 with probability ``rate`` and else 1 / (1 - rate); None where nothing is dropped."""
    return functional.dropout(like.new_ones(shape), rate) if module.training and rate > 0 else None


class WordEmbedding(nn.Module):
    """Vectors of words; training drops word types (Gal, Ghahramani 2016), wherever the sentence has them."""

    def __init__(self, words: int, units: int, dropout: float) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(words, units).uniform_(-0.05, 0.05))
        self.dropout = dropout

    def forward(self, words: Tensor) -> Tensor:
        """Ids (B, W) to vectors (B, W, E)."""
        vectors = functional.embedding(words, self.weight)
        keep = mask(self, self.dropout, vectors, words.shape[0], len(self.weight))
        return vectors if keep is None else vectors * keep.gather(1, words)[..., None]


class GRU(nn.Module):
    """One layer of gated recurrent units with one bias per gate (Cho et al. 2014; Plappert et al. 2017, table 1).

    The reset gate acts before the recurrent product: candidate tanh(W x + b + U (r * h)). The directions run side by
    side, as one batched product, each with 3 N (I + N + 1) parameters of its own. dropout: of the inputs and of the
    recurrent state in training, with one mask for a whole sequence.
    """

    def __init__(self, inputs: int, units: int, directions: int, gates: str, dropout: float) -> None:
        super().__init__()
        self.units = units
        self.gates = gates
        self.dropout = dropout
        self.weight = nn.Parameter(torch.empty(directions, inputs, 3 * units))
        self.bias = nn.Parameter(torch.zeros(directions, 1, 3 * units))
        self.gate_recurrence = nn.Parameter(torch.empty(directions, units, 2 * units))
        self.candidate_recurrence = nn.Parameter(torch.empty(directions, units, units))
        # each gate is initialised as a matrix of its own
        for weight in (self.weight, self.gate_recurrence, self.candidate_recurrence):
            for direction in weight.detach():
                for gate in direction.split(units, dim=-1):
                    if weight is self.weight:
                        nn.init.xavier_uniform_(gate)
                    else:
                        nn.init.orthogonal_(gate, gain=1.1)

    def forward(self, x: Tensor, active: Tensor | None = None) -> Tensor:
        """A sequence (G, T, B, I) to the state after each step (G, T, B, N), from a state of zeros.

        active: (G, T, B, 1); the state stays the same where this is False.
        """
        directions, steps, rows, inputs = x.shape
        # one mask for all steps of the inputs
        keep = mask(self, self.dropout, x, directions, 1, rows, inputs)
        x = x if keep is None else x * keep
        projected = [y.reshape(directions, steps, rows, -1) for y in self.project(x.flatten(1, 2))]
        # and one of the state
        keep = mask(self, self.dropout, x, directions, rows, self.units)

        def advance(state: Tensor, inputs: list[Tensor]) -> Tensor:
            new = self.cell(state, inputs[0], inputs[1], keep)
            return new if active is None else torch.where(inputs[2], new, state)

        start = x.new_zeros(directions, rows, self.units)
        return recur(advance, start, projected if active is None else [*projected, active])

    def exported(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """Both directions over sequences (T, B, I) of the given lengths (B,), as ONNX's own GRU: one kernel.

        The states (T, B, 2 N) after each step, zeros where a row has ended, and the last ones (B, 2 N).
        """
        # ONNX has its gates in one matrix, and two biases
        weight = torch.cat([self.gate_recurrence, self.candidate_recurrence], dim=-1).mT
        bias = functional.pad(self.bias[:, 0], (0, 3 * self.units))
        states, last = torch.onnx.ops.symbolic_multi_out(
            "GRU",
            (x, self.weight.mT, weight, bias, lengths.int()),
            {"hidden_size": self.units, "direction": "bidirectional", "activations": 2 * [ONNX[self.gates], "Tanh"]},
            dtypes=(x.dtype, x.dtype),
            shapes=((x.shape[0], 2, x.shape[1], self.units), (2, x.shape[1], self.units)),
            version=18,
        )
        return states.transpose(1, 2).flatten(2), last.transpose(0, 1).flatten(1)

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

    A loop; in an exported graph, where the number of steps is not known, a scan over the same function.
    """
    if torch.compiler.is_exporting():
        from torch._higher_order_ops.scan import scan  # private, so only the export needs it

        def body(state: Tensor, inputs: list[Tensor]) -> tuple[Tensor, Tensor]:
            new = advance(state, inputs)
            return new, new.clone()

        scanned: Tensor = scan(body, start, [sequence.transpose(0, 1) for sequence in sequences])[1]
        return scanned.transpose(0, 1)
    states = []
    for inputs in zip(*(sequence.unbind(1) for sequence in sequences), strict=True):
        start = advance(start, list(inputs))
        states.append(start)
    return torch.stack(states, dim=1)


class Encoder(nn.Module):
    """Bidirectional layers; the context is the last output of the last one, forward | backward (section 4.2.1).

    Rows are padded on the right; padded steps leave the state as it is, which equals the paper's padding on the left.
    """

    def __init__(self, layer: type[GRU], inputs: int, units: Sequence[int], gates: str, dropout: float) -> None:
        super().__init__()
        sizes = [inputs, *(2 * n for n in units)]
        self.layers = nn.ModuleList(layer(size, n, 2, gates, dropout) for size, n in zip(sizes, units, strict=False))

    def forward(self, x: Tensor, lengths: Tensor) -> Tensor:
        """Sequences (B, T, I) of the given lengths (B,) to contexts (B, C)."""
        return self.states(x, lengths)[1]

    def states(self, x: Tensor, lengths: Tensor) -> tuple[Tensor, Tensor]:
        """The states (B, T, C) of the last layer, any finite numbers after a row's end; and the contexts (B, C)."""
        # forwards and backwards, side by side
        active = before(lengths, x.shape[1]).T[..., None]
        active = torch.stack([active, active.flip(0)])
        x = x.transpose(0, 1)
        for layer in self.layers:
            if torch.compiler.is_exporting() and type(layer) is GRU:
                x, context = layer.exported(x, lengths)
                continue
            states = layer(torch.stack([x, x.flip(0)]), active)
            x = torch.cat([states[0], states[1].flip(0)], dim=-1)
            context = states[:, -1].transpose(0, 1).flatten(1)
        return x.transpose(0, 1), context


class Attention(nn.Module):
    """Global attention over the states of an encoder, with the "general" score (Luong, Pham and Manning 2015, 3.1).

    The score of a state h under a query q is q W h, here divided by the root of the size of h as in Vaswani et al.
    (2017); the softmax over a row's own states weighs their sum. A product costs less than the sum and tanh of Bahdanau
    et al. (2015). And the query is the decoder's newest output, not the one before it, so that in training all steps of
    a sentence attend at once.
    """

    def __init__(self, queries: int, states: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(queries, states))
        nn.init.xavier_uniform_(self.weight)

    def forward(self, queries: Tensor, states: Tensor, lengths: Tensor) -> Tensor:
        """What queries (B, W, S) see of the first ``lengths`` (B,) states (B, T, C): (B, W, C)."""
        return self.weights(queries, states, lengths) @ states

    def weights(self, queries: Tensor, states: Tensor, lengths: Tensor) -> Tensor:
        """How much of each state a query sees (B, W, T): their sum is 1, and 0 is seen after a row's end."""
        scores = queries @ self.weight @ states.mT / states.shape[-1] ** 0.5
        real = before(lengths, states.shape[1])[:, None]
        return torch.where(real, scores, -torch.inf).softmax(dim=-1)


class Decoder(nn.Module):
    """Layers that each see [output of the layer below | context | token]; all their outputs are the decoder's.

    twice: whether the first layer sees the token in place of the output below, too, as in the authors' decoder of
    frames; only so does the paper's parameter count come out.
    """

    def __init__(
        self, layer: type[GRU], token: int, context: int, units: Sequence[int], twice: bool, gates: str, dropout: float
    ) -> None:
        super().__init__()
        self.units = tuple(units)
        self.twice = twice
        below = [token if twice else 0, *units]
        self.layers = nn.ModuleList()
        for size, n in zip(below, units, strict=False):
            self.layers.append(layer(size + context + token, n, 1, gates, dropout))

    def forward(self, tokens: Tensor, context: Tensor) -> Tensor:
        """Tokens (B, T, E), all known, under contexts (B, C) to the outputs of every step (B, T, S)."""
        tokens = tokens.transpose(0, 1)
        context = context.expand(tokens.shape[0], -1, -1)  # len() would be a constant in an exported graph
        outputs: list[Tensor] = []
        for layer in self.layers:
            outputs.append(layer(self._inputs(outputs, context, tokens)[None])[0])
        return torch.cat(outputs, dim=-1).transpose(0, 1)

    def step(self, token: Tensor, context: Tensor, state: Tensor) -> Tensor:
        """One step: token (B, E), context (B, C), state (B, S) of all layers to the next state, which is the output."""
        outputs: list[Tensor] = []
        states = torch.split_with_sizes(state, self.units, dim=-1)
        for layer, old in zip(self.layers, states, strict=True):
            outputs.append(cast(GRU, layer).step(self._inputs(outputs, context, token), old))
        return torch.cat(outputs, dim=-1)

    def _inputs(self, below: list[Tensor], context: Tensor, token: Tensor) -> Tensor:
        first = [token] if self.twice else []
        return torch.cat([*(below[-1:] or first), context, token], dim=-1)
