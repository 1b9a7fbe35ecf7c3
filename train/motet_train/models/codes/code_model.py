"""The model that writes the codes of motions: a causal transformer told which action is shown.

A step of codes is one entry of the book of root moves, or the end, and ``groups`` codes of the body; they are written
one after the other, each knowing those before it in its step. The action modulates every layer (adaptive layer norm:
Perez et al. 2018, Peebles and Xie 2023), since a net told it once can ignore it: past codes say more about the next
ones. Attention falls with the distance in time (ALiBi: Press et al. 2022), so that it goes on beyond what it has seen.

Letters in shapes: B rows, N steps, P parts of a step (the move first), V codes of the largest part, C width, H heads.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional


@dataclass(frozen=True)
class CodeModelConfig:
    """Sizes, and what training adds.

    actions: how many there are; a further one says nothing. hidden: the share of past steps that are hidden in
    training; unsaid: of sequences whose action is not told. ages: the steps since the action began that are told apart.
    """

    actions: int
    width: int = 192
    layers: int = 3
    heads: int = 6
    action: int = 96
    ages: int = 256
    hidden: float = 0.3
    unsaid: float = 0.1


class Block(nn.Module):
    """Attention to the past and a gated feed-forward layer, both modulated by the action."""

    slopes: Tensor

    def __init__(self, width: int, heads: int, told: int) -> None:
        super().__init__()
        self.heads = heads
        self.told = nn.Linear(told, 6 * width)
        nn.init.zeros_(self.told.weight)
        nn.init.zeros_(self.told.bias)
        self.asked = nn.Linear(width, 3 * width, bias=False)
        self.mixed = nn.Linear(width, width, bias=False)
        self.inward, self.outward = nn.Linear(width, 4 * width), nn.Linear(4 * width, width)
        slopes = 2.0 ** -torch.linspace(1, 8, heads)
        self.register_buffer("slopes", slopes[:, None, None], persistent=False)

    def forward(self, x: Tensor, told: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, C) to the same; past: keys and values (B, H, M, 2 C / H) of the steps before, given back with new."""
        shift, scale, gate, shift_2, scale_2, gate_2 = self.told(told).chunk(6, dim=-1)
        found, past = self._attend(_norm(x) * (1 + scale) + shift, past)
        x = x + (1 + gate) * self.mixed(found)
        inner = functional.gelu(self.inward(_norm(x) * (1 + scale_2) + shift_2))
        return x + (1 + gate_2) * self.outward(inner), past

    def _attend(self, x: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        asked, keys, values = self.asked(x).unflatten(-1, (3, self.heads, -1)).permute(2, 0, 3, 1, 4)
        past = torch.cat([past, torch.cat([keys, values], dim=-1)], dim=2)
        keys, values = past.chunk(2, dim=-1)
        now = torch.arange(x.shape[1], device=x.device) + past.shape[2] - x.shape[1]
        ago = now[:, None] - torch.arange(past.shape[2], device=x.device)
        bias = torch.where(ago >= 0, -self.slopes * ago, -torch.inf)
        scores = asked @ keys.transpose(-1, -2) * keys.shape[-1] ** -0.5 + bias
        return (scores.softmax(dim=-1) @ values).transpose(1, 2).flatten(2), past


def _norm(x: Tensor) -> Tensor:
    return functional.layer_norm(x, x.shape[-1:])


class CodeModel(nn.Module):
    """The transformer and, for each part of a step, a small net that says how probable its codes are."""

    def __init__(self, config: CodeModelConfig, sizes: tuple[int, ...], numbers: int) -> None:
        """sizes: how many codes each part has, the end being the last move. numbers: that a step's codes stand for."""
        super().__init__()
        self.config, self.sizes, width = config, sizes, config.width
        self.actions = nn.Embedding(config.actions + 1, config.action)
        self.ages = nn.Embedding(config.ages, config.action)
        self.seen = nn.Linear(numbers, width)
        self.moves = nn.Embedding(sizes[0] + 1, width)  # one more: nothing yet
        self.masked = nn.Parameter(torch.zeros(width))
        self.blocks = nn.ModuleList(Block(width, config.heads, config.action) for _ in range(config.layers))
        self.before = nn.ModuleList(nn.Embedding(size, width) for size in sizes[:-1])
        self.heads = nn.ModuleList(
            nn.Sequential(nn.LayerNorm(width), nn.Linear(width, width), nn.GELU(), nn.Linear(width, size))
            for size in sizes
        )

    def start(self, rows: int) -> Tensor:
        """What attention knows before the first step: (B, K, H, 0, 2 C / H) of K layers."""
        config = self.config
        return self.masked.new_zeros(rows, config.layers, config.heads, 0, 2 * config.width // config.heads)

    def forward(
        self, moves: Tensor, numbers: Tensor, action: Tensor, age: Tensor, past: Tensor
    ) -> tuple[Tensor, Tensor]:
        """What is known of the steps to come (B, N, C), and the past with these steps.

        moves: (B, N) int64 entries of the steps before, ``sizes[0]`` where there was none. numbers: (B, N, L) for
        which their codes stand. action: (B, N) int64. age: (B, N) int64 steps since the action began. past: of
        :meth:`start`.
        """
        told = self.actions(action) + self.ages(age.clamp_max(self.config.ages - 1))
        x = self.moves(moves) + self.seen(numbers)
        if self.training:
            hidden = torch.rand(moves.shape, device=x.device) < self.config.hidden
            x = torch.where(hidden[..., None], self.masked, x)
        pasts = []
        for block, old in zip(self.blocks, past.unbind(1), strict=True):
            x, new = block(x, told, old)
            pasts.append(new)
        return x, torch.stack(pasts, dim=1)

    def logits(self, known: Tensor, codes: Tensor) -> list[Tensor]:
        """For each part the logits (..., size) of its codes, from what is known (..., C) and the codes (..., P) of the
        step, of which each part sees those before it."""
        found = []
        for part, head in enumerate(self.heads):
            found.append(head(known))
            if part < len(self.before):
                known = known + self.before[part](codes[..., part])
        return found
