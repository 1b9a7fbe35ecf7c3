"""The net that fills gaps: what a plain way from one pose to the next lacks.

Past frames, a plain way through the gap (:func:`motet.representation.placed.bridge`) and the frames after it are one
sequence of tokens. Each is seen with its neighbours and with where its joints are, and told what both ends of the gap
are like and how far it is from them (as Qin et al., "Motion In-betweening via Two-stage Transformers", 2022). A
transformer, half of whose heads look nearby (ALiBi: Press et al. 2022), says what is to be added in the gap; near its
ends that fades, so that joins do not leap.

Letters in shapes: B rows, P frames before, N in the gap, A after it, T = P + N + A, E channels of placed frames, C
width, H heads.
"""

from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet.representation.placed import ROOT_PLACE, mirror
from motet_train.models.kinematics import SixdPlaces, Tree
from motet_train.models.net import Graphs, Net, constants, float_rows, gelu, normalised, zero_linear


@dataclass(frozen=True)
class FillerConfig:
    """Sizes. channels: E. tree: the figure. waves: of each distance. inner: of the feed-forward layers.

    soft: frames from an end of the gap at which half of what the net adds counts.
    """

    channels: int
    tree: Tree = field(default_factory=Tree)
    width: int = 128
    layers: int = 4
    heads: int = 4
    inner: int = 384
    waves: int = 8
    soft: float = 1.0


class Block(nn.Module):
    """Attention to all frames, and a feed-forward layer."""

    OLD_NAMES: ClassVar = {"asked": "qkv", "mixed": "proj", "inward": "mlp_in", "outward": "mlp_out"}
    slopes: Tensor

    def __init__(self, width: int, heads: int, inner: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm = nn.LayerNorm(width)
        self.norm_2 = nn.LayerNorm(width)
        self.qkv = nn.Linear(width, 3 * width)
        self.proj = nn.Linear(width, width)
        self.mlp_in = nn.Linear(width, inner)
        self.mlp_out = nn.Linear(inner, width)
        # half of the heads attend to all frames alike
        slopes = torch.cat([0.5 ** torch.linspace(1, 4, heads // 2), torch.zeros(heads - heads // 2)])
        constants(self, slopes=slopes[:, None, None])

    def forward(self, x: Tensor, apart: Tensor) -> Tensor:
        """(B, T, C) to the same; apart: frames between any two (T, T)."""
        # attention, less to frames that are far apart
        qkv = self.qkv(self.norm(x)).unflatten(-1, (3, self.heads, -1))
        queries, keys, values = qkv.permute(2, 0, 3, 1, 4)
        scores = queries @ keys.transpose(-1, -2) * keys.shape[-1] ** -0.5 - self.slopes * apart
        attended = (scores.softmax(dim=-1) @ values).transpose(1, 2).flatten(2)
        x = x + self.proj(attended)

        # the feed-forward layer
        mlp: Tensor = self.mlp_out(gelu(self.mlp_in(self.norm_2(x))))
        return x + mlp


def _frequencies(count: int) -> Tensor:
    """Those of waves of 4 to 100 frames, radians a frame."""
    waves = torch.logspace(0, 1, count, base=100.0 / 4) * 4
    return 2 * torch.pi / waves


class Filler(Net):
    """Placed frames before, plainly through and after a gap to those that fill it. mean, scale: (E,) of such frames."""

    CONFIG = FillerConfig
    OLD_NAMES: ClassVar = {"told": "distances"}
    frequencies: Tensor
    mirrored: Tensor
    signs: Tensor

    def __init__(self, config: FillerConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        width = config.width
        self.inward = nn.Linear(3 * (config.channels + 3 * len(config.tree.parents)), width)
        self.ends = nn.Sequential(nn.Linear(2 * width, width), nn.GELU(), nn.Linear(width, width))
        self.distances = nn.Linear(4 * config.waves + 1, width)
        self.blocks = nn.ModuleList(Block(width, config.heads, config.inner) for _ in range(config.layers))
        self.norm = nn.LayerNorm(width)
        self.outward = zero_linear(width, config.channels)
        self.places = SixdPlaces(config.tree)

        # what mirrors frames, and the waves of distances
        sides = mirror()
        constants(
            self,
            mirrored=torch.from_numpy(sides.columns),
            signs=torch.from_numpy(sides.signs),
            frequencies=_frequencies(config.waves),
        )

    def forward(self, past: Tensor, plain: Tensor, after: Tensor) -> Tensor:
        """Frames (B, P, E), (B, N, E) and (B, A, E), in metres, to the frames that fill the gap (B, N, E): the mean of
        those for them and for their mirror image."""
        # rows and their mirror images in one batch, side by side
        both = (torch.stack([part, self.mirror(part)], dim=1).flatten(0, 1) for part in (past, plain, after))
        filled = self.once(*both).reshape(-1, 2, *plain.shape[1:])
        mean: Tensor = (filled[:, 0] + self.mirror(filled[:, 1])) / 2
        return mean

    def mirror(self, frames: Tensor) -> Tensor:
        """Placed frames (..., E) with left and right exchanged."""
        return frames[..., self.mirrored] * self.signs

    def once(self, past: Tensor, plain: Tensor, after: Tensor) -> Tensor:
        """Like forward, without the mirror image: this is trained."""
        frames = torch.cat([past, plain, after], dim=1)
        before = past.shape[1]
        stop = before + plain.shape[1]
        # frames since the last one before the gap, and until the first one after it
        place = torch.arange(frames.shape[1], device=frames.device) - before + 1
        left = plain.shape[1] + 1 - place

        # a token for each frame, plus both ends of the gap, and the distances from them
        x = self._tokens(frames)
        ends = self.ends(torch.cat([x[:, before - 1], x[:, stop]], dim=-1))
        x = x + ends[:, None] + self.distances(self._waves(place, left))

        # the transformer
        apart = (place[:, None] - place).abs().float()
        for block in self.blocks:
            x = block(x, apart)

        # what it adds to the plain way, fading towards the ends
        added = self.outward(self.norm(x[:, before:stop])) * self.scale
        near = torch.stack([place, left])[:, before:stop, None].float()
        filled: Tensor = plain + (near / (near + self.config.soft)).prod(dim=0) * added
        return filled

    def _tokens(self, frames: Tensor) -> Tensor:
        """Tokens (B, T, C) of frames (B, T, E), their joints, and the steps from and to their neighbours."""
        joints = self.places(frames[..., ROOT_PLACE:]).flatten(2) / 0.3
        features = torch.cat([normalised(frames, self.mean, self.scale), joints], dim=-1)
        steps = functional.pad(4 * (features[:, 1:] - features[:, :-1]), (0, 0, 1, 1))
        tokens: Tensor = self.inward(torch.cat([features, steps[:, :-1], steps[:, 1:]], dim=-1))
        return tokens

    def _waves(self, place: Tensor, left: Tensor) -> Tensor:
        """(T, 4 waves + 1): sines and cosines of distances (T,) from both ends of the gap, and whether it is inside."""
        angles = torch.stack([place, left], dim=-1)[..., None] * self.frequencies
        inside = ((place > 0) & (left > 0)).float()[:, None]
        return torch.cat([angles.sin().flatten(1), angles.cos().flatten(1), inside], dim=-1)

    def joints(self, frames: Tensor) -> Tensor:
        """Joints (..., J, 3) in metres of placed frames (..., E)."""
        joints: Tensor = self.places(frames[..., ROOT_PLACE:]) + frames[..., None, :ROOT_PLACE]
        return joints

    def graphs(self) -> Graphs:
        """The one graph."""
        axes = {"past": "before", "plain": "gap", "after": "behind", "filled": "gap"}
        *inputs, filled = (float_rows(name, axis, self.config.channels) for name, axis in axes.items())
        return {"filler": (self, GraphSpec(tuple(inputs), (filled,)))}
