"""The codec of motions: frames to a few codes, and codes to smooth frames.

``hop`` frames are one step of codes: one entry of the book of root moves and ``groups`` codes of the body. A move is
(forward, left) in metres and a turn in radians, seen from where the figure was. A body code is finite scalar
quantisation (Mentzer et al. 2023): a few numbers, each rounded to one of ``levels``. The decoder gives the root
relative to where the moves have led, so that the way never drifts from them, and looks only a few codes ahead, so that
frames can be given as codes come.

Letters in shapes: B rows, T frames, N steps of codes (T = hop N), D channels, G groups, L numbers of a group.
"""

import math
from dataclasses import dataclass, field
from typing import Self

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.generate.codec import PATH_CHANNELS
from motet.representation.root_sixd import ROOT_SIXD
from motet_train.data.errors import DataError
from motet_train.models.kinematics import SixdPlaces, Tree
from motet_train.models.net import Graphs, Net, constants, gelu, normalised


@dataclass(frozen=True)
class CodecConfig:
    """Sizes. channels: D. tree: the figure. ahead: how many codes each layer of the decoder looks ahead, 0 or 1.

    levels: of each number of a group, odd, so that 0 is one. width, fine: of layers at the rate of codes and of frames.
    blocks: of the encoder.
    """

    channels: int
    tree: Tree = field(default_factory=Tree)
    hop: int = 4
    moves: int = 256
    groups: int = 3
    levels: tuple[int, ...] = (5, 5, 5, 5)
    width: int = 320
    blocks: int = 3
    ahead: tuple[int, ...] = (1, 1, 0, 0)
    fine: int = 160

    @property
    def codes(self) -> int:
        """How many codes a group has."""
        return math.prod(self.levels)


class Residual(nn.Module):
    """Two linear layers beside the identity, the first over three steps in time, ``ahead`` of them (0 or 1) to come."""

    def __init__(self, width: int, ahead: int) -> None:
        super().__init__()
        self.ahead = ahead
        self.norm = nn.LayerNorm(width)
        self.first = nn.Linear(3 * width, width)
        self.second = nn.Linear(width, width)

    def forward(self, x: Tensor) -> Tensor:
        """(B, N, C) to the same shape."""
        mlp: Tensor = self.second(gelu(self.first(around(self.norm(x), self.ahead))))
        return x + mlp


def around(x: Tensor, ahead: int) -> Tensor:
    """Three steps side by side (B, N, 3 C) of (B, N, C), ``ahead`` of them to come; zeros beyond both ends."""
    padded = functional.pad(x, (0, 0, 2 - ahead, ahead))
    count = x.shape[1]
    return torch.cat([padded[:, place : place + count] for place in range(3)], dim=-1)


class CodecEncoder(nn.Module):
    """Normalised frames (B, T, D) to what is quantised (B, N, G L)."""

    def __init__(self, config: CodecConfig) -> None:
        super().__init__()
        numbers = config.groups * len(config.levels)
        self.inward = nn.Linear(3 * config.channels, config.fine)
        self.fine = Residual(config.fine, 1)
        self.down = nn.Linear(config.hop * config.fine, config.width)
        self.blocks = nn.Sequential(*(Residual(config.width, 1) for _ in range(config.blocks)))
        self.outward = nn.Linear(config.width, numbers)
        self.spread = nn.BatchNorm1d(numbers)  # keeps what is rounded spread over all levels

    def forward(self, frames: Tensor) -> Tensor:
        """See the class."""
        hidden = self.fine(self.inward(around(frames, 1)))
        hidden = self.blocks(self.down(hidden.reshape(frames.shape[0], -1, self.down.in_features)))
        values: Tensor = self.spread(self.outward(hidden).transpose(1, 2))
        return values.transpose(1, 2)


class CodecDecoder(nn.Module):
    """Root moves (B, N, 3) and rounded numbers (B, N, G L) to normalised decoder channels (B, T, D)."""

    def __init__(self, config: CodecConfig) -> None:
        super().__init__()
        numbers = 3 + config.groups * len(config.levels)
        self.inward = nn.Linear(numbers, config.width)
        self.blocks = nn.Sequential(*(Residual(config.width, ahead) for ahead in config.ahead))
        self.up = nn.Linear(config.width, config.hop * config.fine)
        self.fine = nn.Sequential(Residual(config.fine, 0), Residual(config.fine, 0))
        self.outward = nn.Linear(config.fine, config.channels)

    def forward(self, moves: Tensor, values: Tensor) -> Tensor:
        """See the class."""
        hidden = self.up(self.blocks(self.inward(torch.cat([moves, values], dim=-1))))
        frames: Tensor = self.outward(self.fine(hidden.reshape(moves.shape[0], -1, self.outward.in_features)))
        return frames


class MotionCodec(Net):
    """Both halves. mean, scale: of the contract. book, book_scale: root moves (K, 3) and the deviation of each number.

    path_scale: of the root relative to the way. steps: levels of each number on either side of 0.
    """

    CONFIG = CodecConfig
    book: Tensor
    book_scale: Tensor
    path_scale: Tensor
    steps: Tensor

    def __init__(self, config: CodecConfig) -> None:
        super().__init__(config.channels)
        if not all(level % 2 for level in config.levels):
            raise DataError(f"levels of codes have to be odd numbers, not {', '.join(map(str, config.levels))}")
        self.config = config
        # both nets, and the figure that they move
        self.encoder = CodecEncoder(config)
        self.decoder = CodecDecoder(config)
        self.places = SixdPlaces(config.tree)
        # the book of root moves, and the levels of numbers
        self.register_buffer("book", torch.zeros(config.moves, 3))
        self.register_buffer("book_scale", torch.ones(3))
        steps = torch.tensor(config.levels * config.groups) // 2
        constants(self, path_scale=torch.tensor([0.05, 0.05, 0.1]), steps=steps.float())

    def train(self, mode: bool = True) -> Self:
        """As in torch, except that an encoder that is not trained stays in evaluation mode."""
        super().train(mode)
        if not next(self.encoder.parameters()).requires_grad:
            self.encoder.eval()
        return self

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D) in the contract's units to rounded numbers (B, N, G L) within -1 and 1, with a gradient."""
        bounded = torch.tanh(self.encoder(normalised(frames, self.mean, self.scale))) * self.steps
        return (bounded + (bounded.round() - bounded).detach()) / self.steps

    def decode(self, moves: Tensor, values: Tensor) -> Tensor:
        """Moves (B, N) int64 and numbers (B, N, G L) to frames (B, T, D): the first three channels are the root's
        forward and left (m) and turn (rad) relative to the way of the moves at the step; the others the contract's."""
        z = self.decoder(self.book[moves] / self.book_scale, values)
        scale = torch.where(self.scale > 0, self.scale, 0.0)
        rest = z[..., PATH_CHANNELS:] * scale[PATH_CHANNELS:] + self.mean[PATH_CHANNELS:]
        return torch.cat([z[..., :PATH_CHANNELS] * self.path_scale, rest], dim=-1)

    def to_codes(self, values: Tensor) -> Tensor:
        """Rounded numbers (B, N, G L) to codes (B, N, G) int64."""
        digits = (values * self.steps + self.steps).round().long()
        groups = digits.reshape(*digits.shape[:-1], self.config.groups, len(self.config.levels))
        codes: Tensor = (groups * self._places()).sum(dim=-1)
        return codes

    def from_codes(self, codes: Tensor) -> Tensor:
        """The inverse: codes (B, N, G) to numbers (B, N, G L)."""
        levels = torch.tensor(self.config.levels, device=codes.device)
        digits = torch.div(codes[..., None], self._places(), rounding_mode="floor") % levels
        return (digits.flatten(-2).float() - self.steps) / self.steps

    def _places(self) -> Tensor:
        """What a digit of each number counts (L,)."""
        levels = self.config.levels
        return torch.tensor([math.prod(levels[:place]) for place in range(len(levels))], device=self.steps.device)

    def graphs(self) -> Graphs:
        """None: a codec is a part of the model that writes its codes."""
        return {}


def places_in_world(codec: MotionCodec, frames: Tensor, way: Tensor) -> Tensor:
    """Joints (B, T, J, 3) of decoder frames (B, T, D), whose root is relative to poses (B, T, 3) of x, z, facing."""
    # the root, beside the way of the moves
    forward, left, turn = frames[..., :PATH_CHANNELS].unbind(-1)
    sin = way[..., 2].sin()
    cos = way[..., 2].cos()
    x = way[..., 0] + forward * sin + left * cos
    z = way[..., 1] + forward * cos - left * sin
    root = torch.stack([x, frames[..., PATH_CHANNELS], z], dim=-1)

    # the joints around it
    places = _turned(codec.places(frames[..., len(ROOT_SIXD) :]), way[..., 2] + turn)
    return places + root[..., None, :]


def _turned(places: Tensor, facing: Tensor) -> Tensor:
    """Places (..., J, 3) turned about y by angles (...) in radians."""
    sin = facing.sin()[..., None]
    cos = facing.cos()[..., None]
    across, up, along = places.unbind(-1)
    return torch.stack([across * cos + along * sin, up, along * cos - across * sin], dim=-1)
