"""Motion as words: which action a sentence asks for, codes written for the action, and the codec that makes them move.

Letters in shapes: B rows, W words, A actions, N steps of codes, P parts of a step (the move first), V codes of the
largest part, T frames, D channels.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.codes.actions import ActionNet, ActionsConfig
from motet_train.models.codes.code_model import CodeModel, CodeModelConfig
from motet_train.models.codes.codec import CodecConfig, MotionCodec, codec_config
from motet_train.models.net import Net, Part, tuples

NEVER = -1e4
"""The log-probability of codes that a part does not have."""


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
        """How surprising each part of each step is (B, N, P); of parts after an end, 0.

        codes, before: (B, N, P) int64 of the steps and of the steps before them. action, age: as the writer takes them.
        """
        known, _ = self.writer(*self._seen(before), action, age, self.writer.start(len(codes)))
        found = []
        for part, logits in enumerate(self.writer.logits(known, codes)):
            target = codes[..., part].flatten()
            found.append(functional.cross_entropy(logits.float().flatten(0, 1), target, reduction="none"))
        losses = torch.stack(found, dim=-1).reshape(codes.shape)
        real = torch.ones_like(losses)
        real[..., 1:] = (codes[..., :1] != self.end).float()
        return losses * real

    def _seen(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Moves (B, N) and numbers (B, N, L) of codes (B, N, P), numbers 0 where nothing was."""
        moves = codes[..., 0]
        codec, there = self.codec, (moves < self.end)[..., None].float()
        way = codec.book[moves.clamp_max(self.end - 1)] / codec.book_scale
        return moves, torch.cat([way, codec.from_codes(codes[..., 1:])], dim=-1) * there

    def step(self, codes: Tensor, action: Tensor, age: Tensor, past: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """What is known of the next step (B, C), and the numbers (B, L) for which the step before stands.

        codes: (B, P) of the step before. action: (B,). age: (B,) steps since it began.
        """
        moves, numbers = self._seen(codes[:, None])
        known, new = self.writer(moves, numbers, action[:, None], age[:, None], past)
        return known[:, 0], numbers[:, 0], new

    def part(self, known: Tensor, codes: Tensor) -> Tensor:
        """Log-probabilities (B, P, V) of the codes of each part, given those (B, P) of the parts before it."""
        found = []
        for logits in self.writer.logits(known, codes):
            missing = max(self.sizes) - logits.shape[-1]
            found.append(functional.pad(functional.log_softmax(logits, dim=-1), (0, missing), value=NEVER))
        return torch.stack(found, dim=1)

    def decode(self, codes: Tensor) -> tuple[Tensor, Tensor]:
        """Codes (B, N, P) to the frames of each step (B, N, T / N, D), as :meth:`MotionCodec.decode`, and moves
        (B, N, 3)."""
        moves = codes[..., 0]
        frames = self.codec.decode(moves, self.codec.from_codes(codes[..., 1:]))
        hop, channels = self.config.codec.hop, self.config.codec.channels
        return frames.reshape(codes.shape[0], -1, hop, channels), self.codec.book[moves]

    def tables(self) -> dict[str, NDArray[Any]]:
        """The memory, and the numbers that a move (M, 3) and a code of the body (V, L) stand for."""
        codec = self.config.codec
        every = torch.arange(codec.codes)[:, None].expand(-1, codec.groups)
        moves, body = self.codec.book / self.codec.book_scale, self.codec.from_codes(every)[:, : len(codec.levels)]
        return {"memory": self.memory.numpy(), "moves": moves.numpy(), "body": body.numpy()}

    def to_codes(self, frames: Tensor) -> Tensor:
        """Frames of steps (B, N, T / N, D) in the contract's units to the codes (B, N, P - 1) of the body."""
        return self.codec.to_codes(self.codec.encode(frames.flatten(1, 2)))

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder of sentences, the step and its parts, and the codec's two ways."""
        return {"encoder": self.text.encoder(), **self._writing(), **self._moving()}

    def _writing(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The step and its parts."""
        writer, parts = self.config.writer, len(self.sizes)
        action, age = (TensorSpec(name, ("batch",), "int64") for name in ("action", "age"))
        codes, known = TensorSpec("codes", ("batch", parts), "int64"), TensorSpec("known", ("batch", writer.width))
        numbers = TensorSpec("numbers", ("batch", self.writer.seen.in_features))
        layers, heads, size = writer.layers, writer.heads, 2 * writer.width // writer.heads
        past, longer = (TensorSpec(name, ("batch", layers, heads, "past", size)) for name in ("past", "next_past"))
        start = {"past": (layers, heads, 0, size)}
        stepped = GraphSpec((codes, action, age, past), (known, numbers, longer), {"past": "next_past"}, start)
        chances = TensorSpec("log_probabilities", ("batch", parts, max(self.sizes)))
        return {
            "step": (Part(self, self.step), stepped),
            "part": (Part(self, self.part), GraphSpec((known, codes), (chances,))),
        }

    def _moving(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The codec's two ways."""
        codec, parts = self.config.codec, len(self.sizes)
        frames = TensorSpec("frames", ("batch", "steps", codec.hop, codec.channels))
        codes, body = (TensorSpec("codes", ("batch", "steps", count), "int64") for count in (parts, parts - 1))
        moves = TensorSpec("moves", ("batch", "steps", 3))
        return {
            "decoder": (Part(self, self.decode), GraphSpec((codes,), (frames, moves))),
            "tokens": (Part(self, self.to_codes), GraphSpec((frames,), (body,))),
        }


def from_config(config: Mapping[str, Any]) -> MotionCodes:
    """An untrained net of a configuration as it stands in a manifest."""
    text, writer = (tuples(config[name]) for name in ("text", "writer"))
    parts = codec_config(config["codec"]), ActionsConfig(**text), CodeModelConfig(**writer)
    return MotionCodes(MotionCodesConfig(*parts, config["remembered"]))
