"""The net that fills gaps: what a plain way from one pose to the next lacks.

Past frames, a plain way through the gap (:func:`motet.representation.placed.bridge`) and the frames after it are one
sequence of tokens. Each is seen with its neighbours and with where its joints are, and told what both ends of the gap
are like and how far it is from them (as Qin et al., "Motion In-betweening via Two-stage Transformers", 2022). A
transformer, half of whose heads look nearby (ALiBi: Press et al. 2022), says what is to be added in the gap; near its
ends that fades, so that joins do not leap.

Letters in shapes: B rows, P frames before, N in the gap, A after it, T = P + N + A, E channels of placed frames, C
width, H heads.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec, TensorSpec
from motet.representation.placed import ROOT_PLACE, mirror
from motet_train.models.codes.sixd_places import SixdPlaces, Tree
from motet_train.models.net import Net, tuples
from motet_train.models.normalised import normalised

REACH = 100.0
"""Frames: the longest wave by which the distance from the ends of the gap is told; the shortest is 4."""

SIZE = 0.3
"""Metres by which joints' places are divided."""


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

    slopes: Tensor

    def __init__(self, width: int, heads: int, inner: int) -> None:
        super().__init__()
        self.heads = heads
        self.norm, self.norm_2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.asked, self.mixed = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.inward, self.outward = nn.Linear(width, inner), nn.Linear(inner, width)
        # half of the heads attend to all frames alike
        slopes = torch.cat([0.5 ** torch.linspace(1, 4, heads // 2), torch.zeros(heads - heads // 2)])
        self.register_buffer("slopes", slopes[:, None, None], persistent=False)

    def forward(self, x: Tensor, apart: Tensor) -> Tensor:
        """(B, T, C) to the same; apart: frames between any two (T, T)."""
        asked, keys, values = self.asked(self.norm(x)).unflatten(-1, (3, self.heads, -1)).permute(2, 0, 3, 1, 4)
        scores = asked @ keys.transpose(-1, -2) * keys.shape[-1] ** -0.5 - self.slopes * apart
        x = x + self.mixed((scores.softmax(dim=-1) @ values).transpose(1, 2).flatten(2))
        found: Tensor = x + self.outward(functional.gelu(self.inward(self.norm_2(x))))
        return found


class Filler(Net):
    """Placed frames before, plainly through and after a gap to those that fill it. mean, scale: (E,) of such frames."""

    frequencies: Tensor
    mirrored: Tensor
    signs: Tensor

    def __init__(self, config: FillerConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        width = config.width
        self.inward = nn.Linear(3 * (config.channels + 3 * len(config.tree.parents)), width)
        self.ends = nn.Sequential(nn.Linear(2 * width, width), nn.GELU(), nn.Linear(width, width))
        self.told = nn.Linear(4 * config.waves + 1, config.width)
        self.blocks = nn.ModuleList(Block(config.width, config.heads, config.inner) for _ in range(config.layers))
        self.norm, self.outward = nn.LayerNorm(config.width), nn.Linear(config.width, config.channels)
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)
        self.places = SixdPlaces(config.tree)
        sides = mirror()
        self.register_buffer("mirrored", torch.from_numpy(sides.columns), persistent=False)
        self.register_buffer("signs", torch.from_numpy(sides.signs), persistent=False)
        waves = torch.logspace(0, 1, config.waves, base=REACH / 4) * 4
        self.register_buffer("frequencies", 2 * torch.pi / waves, persistent=False)

    def forward(self, past: Tensor, plain: Tensor, after: Tensor) -> Tensor:
        """Frames (B, P, E), (B, N, E) and (B, A, E), in metres, to what fills the gap (B, N, E): the mean of what is
        seen in them and in their mirror image."""
        # rows and their mirror images in one batch, side by side
        both = (torch.stack([part, self.mirror(part)], dim=1).flatten(0, 1) for part in (past, plain, after))
        found = self.once(*both).reshape(-1, 2, *plain.shape[1:])
        mean: Tensor = (found[:, 0] + self.mirror(found[:, 1])) / 2
        return mean

    def mirror(self, frames: Tensor) -> Tensor:
        """Placed frames (..., E) with left and right exchanged."""
        return frames[..., self.mirrored] * self.signs

    def once(self, past: Tensor, plain: Tensor, after: Tensor) -> Tensor:
        """As forward, without the mirror image: what is trained."""
        given = torch.cat([past, plain, after], dim=1)
        before, count = past.shape[1], plain.shape[1]
        place = torch.arange(given.shape[1], device=given.device) - before + 1
        left = count + 1 - place
        seen = [normalised(given, self.mean, self.scale), self.places(given[..., ROOT_PLACE:]).flatten(2) / SIZE]
        x = self.inward(_around(torch.cat(seen, dim=-1)))
        ends = self.ends(torch.cat([x[:, before - 1], x[:, before + count]], dim=-1))
        x = x + ends[:, None] + self.told(self._told(place, left))
        apart = (place[:, None] - place).abs().float()
        for block in self.blocks:
            x = block(x, apart)
        added = self.outward(self.norm(x[:, before : before + count])) * self.scale
        near = torch.stack([place, left])[:, before : before + count, None].float()
        found: Tensor = plain + (near / (near + self.config.soft)).prod(dim=0) * added
        return found

    def _told(self, place: Tensor, left: Tensor) -> Tensor:
        """Where tokens are (T, 4 W + 1), by the frames since the last one before the gap and until the first after."""
        angles = torch.stack([place, left], dim=-1)[..., None] * self.frequencies
        inside = ((place > 0) & (left > 0)).float()[:, None]
        return torch.cat([angles.sin().flatten(1), angles.cos().flatten(1), inside], dim=-1)

    def joints(self, frames: Tensor) -> Tensor:
        """Joints (..., J, 3) in metres of placed frames (..., E)."""
        found: Tensor = self.places(frames[..., ROOT_PLACE:]) + frames[..., None, :ROOT_PLACE]
        return found

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The one graph."""
        past, plain, after = (
            TensorSpec(name, ("batch", axis, self.config.channels))
            for name, axis in (("past", "before"), ("plain", "gap"), ("after", "behind"))
        )
        filled = TensorSpec("filled", plain.shape)
        return {"filler": (self, GraphSpec((past, plain, after), (filled,)))}


def _around(x: Tensor) -> Tensor:
    """Each frame, how it differs from the one before and how the next one from it: (B, T, 3 E) of (B, T, E)."""
    steps = functional.pad(4 * (x[:, 1:] - x[:, :-1]), (0, 0, 1, 1))
    return torch.cat([x, steps[:, :-1], steps[:, 1:]], dim=-1)


def from_config(config: Mapping[str, Any]) -> Filler:
    """An untrained net of a configuration as it stands in a manifest."""
    found = dict(tuples(config))
    return Filler(FillerConfig(**{**found, "tree": Tree(**found["tree"])}))
