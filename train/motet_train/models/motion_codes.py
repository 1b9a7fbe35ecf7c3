"""Motion as words: which action a sentence asks for, codes written for the action, and the codec that makes them move.

The writer is a causal transformer told which action is shown. A step of codes is one entry of the book of root moves,
or the end, and ``groups`` codes of the body; they are written one after the other, each knowing those before it in its
step. The action modulates every layer (adaptive layer norm: Perez et al. 2018, Peebles and Xie 2023), since a net told
it once can ignore it: past codes say more about the next ones. Attention falls with the distance in time (ALiBi: Press
et al. 2022), so that it works beyond the lengths seen in training.

Letters in shapes: B rows, A actions, N steps of codes, P parts of a step (the move first), V codes of the largest part,
C width, H heads, L numbers that a step's codes stand for, T frames, D channels.
"""

from dataclasses import dataclass
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.action_net import ActionNet, ActionsConfig
from motet_train.models.codec import CodecConfig, MotionCodec
from motet_train.models.net import Graphs, Net, Part, Tables, constants, float_rows, gelu, id_rows, zero_linear


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

    OLD_NAMES: ClassVar = {
        "told": "modulation",
        "asked": "qkv",
        "mixed": "proj",
        "inward": "mlp_in",
        "outward": "mlp_out",
    }
    slopes: Tensor

    def __init__(self, width: int, heads: int, condition: int) -> None:
        super().__init__()
        self.heads = heads
        self.modulation = zero_linear(condition, 6 * width)
        self.qkv = nn.Linear(width, 3 * width, bias=False)
        self.proj = nn.Linear(width, width, bias=False)
        self.mlp_in = nn.Linear(width, 4 * width)
        self.mlp_out = nn.Linear(4 * width, width)
        slopes = 2.0 ** -torch.linspace(1, 8, heads)
        constants(self, slopes=slopes[:, None, None])

    def forward(self, x: Tensor, condition: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        """(B, N, C) to the same; past: keys and values (B, H, M, 2 C / H) of the steps before, returned with the new
        ones."""
        shift, scale, gate, shift_2, scale_2, gate_2 = self.modulation(condition).chunk(6, dim=-1)
        attended, past = self._attend(_modulated(x, scale, shift), past)
        x = x + (1 + gate) * self.proj(attended)
        mlp = gelu(self.mlp_in(_modulated(x, scale_2, shift_2)))
        return x + (1 + gate_2) * self.mlp_out(mlp), past

    def _attend(self, x: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        # queries of the new steps, keys and values of all
        qkv = self.qkv(x).unflatten(-1, (3, self.heads, -1))
        queries, keys, values = qkv.permute(2, 0, 3, 1, 4)
        past = torch.cat([past, torch.cat([keys, values], dim=-1)], dim=2)
        keys, values = past.chunk(2, dim=-1)

        # scores, with a bias for how long ago each step was
        bias = self._bias(x.shape[1], past.shape[2], x.device)
        scores = queries @ keys.transpose(-1, -2) * keys.shape[-1] ** -0.5 + bias
        return (scores.softmax(dim=-1) @ values).transpose(1, 2).flatten(2), past

    def _bias(self, new: int, every: int, device: torch.device) -> Tensor:
        """Of the last ``new`` steps to all (H, new, every): the past counts less the longer ago it is, the future not
        at all."""
        now = torch.arange(new, device=device) + every - new
        ago = now[:, None] - torch.arange(every, device=device)
        return torch.where(ago >= 0, -self.slopes * ago, -torch.inf)


def _modulated(x: Tensor, scale: Tensor, shift: Tensor) -> Tensor:
    """A layer norm whose scale and shift are given."""
    return functional.layer_norm(x, x.shape[-1:]) * (1 + scale) + shift


class CodeModel(nn.Module):
    """The transformer and, for each part of a step, a small net that says how probable its codes are."""

    def __init__(self, config: CodeModelConfig, sizes: tuple[int, ...], numbers: int) -> None:
        """sizes: how many codes each part has, the end being the last move. numbers: that a step's codes stand for."""
        super().__init__()
        self.config = config
        self.sizes = sizes
        width = config.width
        self.actions = nn.Embedding(config.actions + 1, config.action)
        self.ages = nn.Embedding(config.ages, config.action)
        self.seen = nn.Linear(numbers, width)
        self.moves = nn.Embedding(sizes[0] + 1, width)  # one more: nothing yet
        self.masked = nn.Parameter(torch.zeros(width))
        self.blocks = nn.ModuleList(Block(width, config.heads, config.action) for _ in range(config.layers))
        self.before = nn.ModuleList(nn.Embedding(size, width) for size in sizes[:-1])
        self.heads = nn.ModuleList(_head(width, size) for size in sizes)

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
        # the action and its age modulate every layer
        condition = self.actions(action) + self.ages(age.clamp_max(self.config.ages - 1))
        x = self.moves(moves) + self.seen(numbers)
        if self.training:
            hidden = torch.rand(moves.shape, device=x.device) < self.config.hidden
            x = torch.where(hidden[..., None], self.masked, x)
        pasts = []
        for block, old in zip(self.blocks, past.unbind(1), strict=True):
            x, new = block(x, condition, old)
            pasts.append(new)
        return x, torch.stack(pasts, dim=1)

    def logits(self, known: Tensor, codes: Tensor) -> list[Tensor]:
        """For each part the logits (..., size) of its codes, from what is known (..., C) and the codes (..., P) of the
        step, of which each part sees those before it."""
        logits = []
        for part, head in enumerate(self.heads):
            logits.append(head(known))
            if part < len(self.before):
                known = known + self.before[part](codes[..., part])
        return logits


def _head(width: int, size: int) -> nn.Sequential:
    """From what is known of a step to the logits of a part's codes."""
    return nn.Sequential(nn.LayerNorm(width), nn.Linear(width, width), nn.GELU(), nn.Linear(width, size))


@dataclass(frozen=True)
class MotionCodesConfig:
    """The configurations of its three parts. remembered: M steps of training motions that it keeps."""

    codec: CodecConfig
    text: ActionsConfig
    writer: CodeModelConfig
    remembered: int = 1


class MotionCodes(Net):
    """The three nets, and a memory. The writer alone is trained here.

    memory: (M, P + 2) int16 steps of training motions one after the other, each with its action and its age.
    """

    CONFIG = MotionCodesConfig
    memory: Tensor

    def __init__(self, config: MotionCodesConfig) -> None:
        super().__init__(config.codec.channels)
        self.config = config
        self.codec = MotionCodec(config.codec).requires_grad_(False)
        self.text = ActionNet(config.text).requires_grad_(False)
        codec = config.codec
        self.sizes = (codec.moves + 1, *[codec.codes] * codec.groups)
        self.writer = CodeModel(config.writer, self.sizes, 3 + codec.groups * len(codec.levels))
        self.register_buffer("memory", torch.zeros(config.remembered, len(self.sizes) + 2, dtype=torch.int16))

    def matrices(self) -> list[Tensor]:
        """Those of the writer's blocks; layers with many classes learn better otherwise."""
        return [module.weight for module in self.writer.blocks.modules() if isinstance(module, nn.Linear)]

    @property
    def end(self) -> int:
        """The move that ends a motion; one more stands for what comes before the first step."""
        return self.config.codec.moves

    def take(self, codec: MotionCodec, text: ActionNet) -> None:
        """Take up a trained codec, with its normalisation, and a trained net of actions."""
        self.codec.load_state_dict(codec.state_dict())
        self.text.load_state_dict(text.state_dict())
        self.mean.copy_(codec.mean)
        self.scale.copy_(codec.scale)

    def losses(self, codes: Tensor, before: Tensor, action: Tensor, age: Tensor) -> Tensor:
        """The cross-entropy (B, N, P) of each part of each step, 0 for parts after an end.

        codes, before: (B, N, P) int64 of the steps and of the steps before them. action, age: see the writer.
        """
        known, _ = self.writer(*self._seen(before), action, age, self.writer.start(len(codes)))
        # each part knows those before it
        part_losses = []
        for part, logits in enumerate(self.writer.logits(known, codes)):
            target = codes[..., part].flatten()
            part_losses.append(functional.cross_entropy(logits.float().flatten(0, 1), target, reduction="none"))
        losses = torch.stack(part_losses, dim=-1).reshape(codes.shape)
        # after an end there is no body
        real = torch.ones_like(losses)
        real[..., 1:] = (codes[..., :1] != self.end).float()
        return losses * real

    def _seen(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Moves (B, N) and numbers (B, N, L) of codes (B, N, P), numbers 0 where nothing was."""
        moves = codes[..., 0]
        codec = self.codec
        real = (moves < self.end)[..., None].float()
        way = codec.book[moves.clamp_max(self.end - 1)] / codec.book_scale
        return moves, torch.cat([way, codec.from_codes(codes[..., 1:])], dim=-1) * real

    def step(self, codes: Tensor, action: Tensor, age: Tensor, past: Tensor) -> tuple[Tensor, Tensor]:
        """What is known of the next step (B, C), and the past with the steps before it.

        codes: (B, N, P) of the steps before it that are not in the past. action, age: (B, N), see the writer.
        """
        known, past = self.writer(*self._seen(codes), action, age, past)
        return known[:, -1], past

    def part(self, known: Tensor, codes: Tensor) -> Tensor:
        """Log-probabilities (B, P, V) of the codes of each part, given those (B, P) of the parts before it."""
        parts = []
        for logits in self.writer.logits(known, codes):
            missing = max(self.sizes) - logits.shape[-1]  # codes that this part lacks
            parts.append(functional.pad(functional.log_softmax(logits, dim=-1), (0, missing), value=-1e4))
        return torch.stack(parts, dim=1)

    def decode(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Codes (B, N, P) to the frames of each step (B, N, T / N, D), as :meth:`MotionCodec.decode`, and moves
        (B, N, 3)."""
        moves = codes[..., 0]
        frames = self.codec.decode(moves, self.codec.from_codes(codes[..., 1:]))
        config = self.config.codec
        return frames.reshape(codes.shape[0], -1, config.hop, config.channels), self.codec.book[moves]

    def tables(self) -> Tables:
        """The memory, and the numbers that a move (M, 3) and a code of the body (V, L) stand for."""
        codec = self.config.codec
        every = torch.arange(codec.codes)[:, None].expand(-1, codec.groups)
        moves = self.codec.book / self.codec.book_scale
        body = self.codec.from_codes(every)[:, : len(codec.levels)]
        return {"memory": self.memory.numpy(), "moves": moves.numpy(), "body": body.numpy()}

    def to_codes(self, frames: Tensor) -> Tensor:
        """Frames of steps (B, N, T / N, D) in the contract's units to the codes (B, N, P - 1) of the body."""
        return self.codec.to_codes(self.codec.encode(frames.flatten(1, 2)))

    def graphs(self) -> Graphs:
        """The encoder of sentences, the step and its parts, and the codec's two ways."""
        return {"encoder": self.text.encoder(), **self._writer_graphs(), **self._codec_graphs()}

    def _writer_graphs(self) -> Graphs:
        """The step, and the codes of its parts."""
        # what goes in, with the past of attention
        writer = self.config.writer
        codes = id_rows("codes", "steps", len(self.sizes))
        action = id_rows("action", "steps")
        age = id_rows("age", "steps")
        part_codes = id_rows("codes", len(self.sizes))
        size = 2 * writer.width // writer.heads
        shape = ("batch", writer.layers, writer.heads, "past", size)
        past = TensorSpec("past", shape)

        # what comes out
        known = float_rows("known", writer.width)
        next_past = TensorSpec("next_past", shape)
        scores = TensorSpec("log_probabilities", ("batch", len(self.sizes), max(self.sizes)))
        start = {"past": (writer.layers, writer.heads, 0, size)}
        step = GraphSpec((codes, action, age, past), (known, next_past), {"past": "next_past"}, start)
        return {
            "step": (Part(self, self.step), step),
            "part": (Part(self, self.part), GraphSpec((known, part_codes), (scores,))),
        }

    def _codec_graphs(self) -> Graphs:
        """Codes to frames, and frames to codes."""
        codec = self.config.codec
        codes = id_rows("codes", "steps", len(self.sizes))
        body = id_rows("codes", "steps", codec.groups)
        frames = float_rows("frames", "steps", codec.hop, codec.channels)
        moves = float_rows("moves", "steps", 3)
        return {
            "decoder": (Part(self, self.decode), GraphSpec((codes,), (frames, moves))),
            "tokens": (Part(self, self.to_codes), GraphSpec((frames,), (body,))),
        }
