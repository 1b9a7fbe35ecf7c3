"""A conditional RBM straight on the joint angles (Taylor 2007): the control net's baseline, which the thesis builds on.

The visible units are the z-scored angles, Gaussian with unit variance; there is no RBM below. Taylor's rates, 1e-3 and
1e-5 for past to visible, are for gradients summed over a mini-batch; ours are means, so that they are 20 times as large
here: 2e-2 and 2e-4.

Letters in shapes: B rows, T frames, D channels, K taps, L labels, C control units, F free hidden units.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any

import torch
from torch import Tensor, nn

from motet_train.models.net import tuples
from motet_train.papers.tdbn.contrastive import Learning, Stage
from motet_train.papers.tdbn.control_net import ControlNet, Sequences
from motet_train.papers.tdbn.crbm import CRBM, Past


@dataclass(frozen=True)
class AngleCRBMConfig:
    """Sizes of the net and how it is trained."""

    fps: float = 40.0
    root_rotation: bool = True
    taps: int = 3
    control_units: int = 1
    """For each label. More of them act as one whose weights learn that many times as fast."""
    free_units: int = 60
    sigma: float = 1.0
    """Standard deviation of a Gaussian visible unit, in units of its channel's own."""
    past_noise: float = 1.0
    past_rate: float = 2e-4
    """First learning rate of the weights from the past to the visible units."""
    onset: float = 100.0
    """See :class:`motet_train.papers.tdbn.tdbn.TDBNConfig`."""
    temperature: float = 1.0
    iterations: int = 30
    """Gibbs iterations for each generated frame."""
    initial: float = 0.01
    """Standard deviation of the initial weights."""
    crbm: Learning = field(
        default_factory=lambda: Learning(400, 3e-2, final_rate=0.01, decay=2e-4, steps=5, temperature=(1.0, 1.0))
    )


class AngleCRBM(ControlNet):
    """The net with its normalisation: degrees in, z-scored angles as state, degrees out.

    channels: how many (D). labels: how many (L).
    """

    def __init__(self, config: AngleCRBMConfig, channels: int, labels: int) -> None:
        crbm = CRBM(channels, config.taps, labels * config.control_units, config.free_units, taylor=True)
        super().__init__(crbm, labels, channels, config.taps)
        self.config = config
        self.noise_units = 2 * channels

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to z-scored angles (B, D)."""
        return self.normalised(frames)

    def decode(self, codes: Tensor) -> Tensor:
        """Z-scored angles (B, D) to frames (B, D)."""
        return codes * self.scale + self.mean

    def vary(self, mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
        """Means (variety 0) and normal samples about them (variety 1), by Box and Muller from noise (B, 2 D)."""
        first, second = noise.chunk(2, dim=1)
        return mean + variety * torch.sqrt(-2 * torch.log(1 - first)) * torch.cos(2 * math.pi * second)

    @property
    def defaults(self) -> dict[str, float]:
        """Also the Gibbs iterations."""
        return {**super().defaults, "iterations": self.config.iterations}

    def stages(
        self, sequences: Sequences, controls: Sequences, onsets: Sequence[float], generator: torch.Generator
    ) -> tuple[list[Stage], dict[str, nn.Module]]:
        """The CRBM learns; nothing else has a state."""
        config = self.config
        past = Past(config.past_noise, config.past_rate / config.crbm.rate)
        layer = partial(self.crbm_layer, sequences, controls, onsets, generator, past)
        return [Stage(config.crbm.epochs, partial(self.begin_crbm, generator), layer, whole=True)], {}

    def to_config(self) -> dict[str, Any]:
        """As :meth:`motet_train.papers.tdbn.control_net.ControlNet.to_config`."""
        return {**asdict(self.config), "channels": len(self.mean), "labels": len(self.expansion)}


def from_config(config: Mapping[str, Any]) -> AngleCRBM:
    """An untrained net of the sizes that :meth:`AngleCRBM.to_config` wrote."""
    values = tuples(config)
    channels, labels = values.pop("channels"), values.pop("labels")
    return AngleCRBM(AngleCRBMConfig(**{**values, "crbm": Learning(**values["crbm"])}), channels, labels)
