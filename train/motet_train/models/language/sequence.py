"""Stacks of recurrent layers: the bidirectional encoder of a sequence and the decoder under a context (section 4.1).

Letters in shapes: B rows, T steps, I inputs, C units of the context, E units of a token (the previous word or frame).
"""

from collections.abc import Sequence
from typing import cast

import torch
from torch import Tensor, nn

from motet_train.data.batch import before
from motet_train.models.language.gru import GRU


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
        active = before(lengths, x.shape[1]).T[..., None]
        active = torch.stack([active, active.flip(0)])
        x = x.transpose(0, 1)
        for layer in self.layers:
            states = layer(torch.stack([x, x.flip(0)]), active)
            x = torch.cat([states[0], states[1].flip(0)], dim=-1)
        context: Tensor = states[:, -1].transpose(0, 1).flatten(1)
        return context


class Decoder(nn.Module):
    """Layers that each see [output of the layer below | context | token]; all their outputs are the decoder's.

    twice: whether the first layer sees the token in the place of the output below, too, as the authors built the
    decoder of frames; it is what makes the parameter count of the paper come out.
    """

    def __init__(
        self, layer: type[GRU], token: int, context: int, units: Sequence[int], twice: bool, gates: str, dropout: float
    ) -> None:
        super().__init__()
        self.units, self.twice = tuple(units), twice
        below = [token if twice else 0, *units]
        self.layers = nn.ModuleList(
            layer(size + context + token, n, 1, gates, dropout) for size, n in zip(below, units, strict=False)
        )

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
