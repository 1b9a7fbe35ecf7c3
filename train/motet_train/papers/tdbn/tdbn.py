"""Temporal deep belief net (thesis, chapter 4): a body-part RBM under a conditional RBM over its codes.

Where the thesis' text and its author's code differ, the default follows what works (docs/control.md shows both):
control units stay clamped in the reconstruction, binary layers are annealed, and the root's rotation is among the
channels; :meth:`TDBNConfig.thesis` is the text.

Letters in shapes: B rows, T frames, D channels, H codes, K taps, L labels, C control units, F free hidden units.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any

import torch
from torch import Tensor

from motet_train.models.net import tuples
from motet_train.papers.tdbn.contrastive import Learning, Stage, balanced
from motet_train.papers.tdbn.control_net import ControlNet, Sequences, binary
from motet_train.papers.tdbn.crbm import CRBM, Past
from motet_train.papers.tdbn.rbm import RBM, RBMLayer, block_mask


@dataclass(frozen=True)
class TDBNConfig:
    """Sizes of the net and how it is trained; the defaults are the recipe of the shipped bundle."""

    fps: float = 40.0
    root_rotation: bool = True
    """Whether the root's rotation is among the channels: 59 of CMU's skeleton, else the thesis' 56."""
    hidden_per_part: int = 30
    taps: int = 3
    control_units: int = 24
    """For each label."""
    free_units: int = 0
    clamped: bool = True
    """Whether control units keep their values in the reconstruction."""
    sigma: float = 0.38
    """Standard deviation of a Gaussian visible unit, in units of its channel's own: smaller codes say more."""
    past_noise: float = 0.3
    own: int = 0
    """See :class:`motet_train.papers.tdbn.crbm.Past`."""
    onset: float = 100.0
    """How many times as often the first window of a motion that ends is drawn as its last."""
    temperature: float = 0.38
    """Of the codes and of generation; learning anneals from 1 to it."""
    initial: float = 0.01
    """Standard deviation of the initial weights."""
    restarts: int = 2
    """RBMs that learn side by side: which features they find decides how the net moves."""
    tries: int = 3
    """CRBMs learned on each of them at the most, while none satisfies."""
    rbm: Learning = field(default_factory=lambda: Learning(2000, rate=1e-2, final_rate=0.03, temperature=(1.0, 0.38)))
    crbm: Learning = field(default_factory=lambda: Learning(80, rate=6e-3, final_rate=0.3, temperature=(1.0, 0.38)))

    @staticmethod
    def thesis() -> "TDBNConfig":
        """The thesis' text: 56 angles, control units unclamped in the reconstruction, no annealing (5.2 to 5.4)."""
        flat = (1.0, 1.0)
        return TDBNConfig(
            root_rotation=False,
            control_units=7,
            clamped=False,
            sigma=1.0,
            past_noise=0.0,
            onset=1.0,
            temperature=1.0,
            restarts=1,
            tries=1,
            rbm=Learning(epochs=1000, temperature=flat),
            crbm=Learning(epochs=100, temperature=flat),
        )

    def unclamped(self) -> "TDBNConfig":
        """The same recipe with control units inferred in the reconstruction, as the thesis' text has it (5.3)."""
        return replace(self, clamped=False, restarts=1, tries=1)


class TDBN(ControlNet):
    """The net with its normalisation: degrees in, codes as state, degrees out.

    parts: the body part of each channel (D). labels: how many (L).
    """

    def __init__(self, config: TDBNConfig, parts: Sequence[int], labels: int) -> None:
        mask = block_mask(parts, config.hidden_per_part)
        control = labels * config.control_units
        super().__init__(CRBM(mask.shape[1], config.taps, control, config.free_units), labels, len(parts), config.taps)
        self.config = config
        self.rbm = RBM(mask)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to codes (B, H)."""
        return self.rbm.encode(self.normalised(frames), self.config.temperature)

    def decode(self, codes: Tensor) -> Tensor:
        """Codes (B, H) to frames (B, D)."""
        return self.rbm.decode(codes) * self.scale + self.mean

    def vary(self, mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
        """Between the probabilities (variety 0) and binary samples of them (variety 1)."""
        return binary(mean, noise, variety)

    def stages(
        self, sequences: Sequences, controls: Sequences, onsets: Sequence[float], generator: torch.Generator
    ) -> tuple[list[Stage], dict[str, RBM]]:
        """The RBM, then the CRBM again and again with other random numbers: ``tries`` times on each of the
        ``restarts`` of the RBM, which are what else has a state."""
        config = self.config
        rbms = RBM(self.rbm.mask, config.restarts).to(self.mean.device)
        frames = self.normalised(torch.cat([frames for found in sequences for frames in found]))
        uniform = balanced([torch.ones(sum(map(len, found))) for found in sequences]).to(self.mean.device)
        past = Past(config.past_noise, own=config.own)

        def lower() -> None:
            rbms.weight.normal_(0.0, config.initial, generator=generator).mul_(rbms.mask)

        def upper(number: int) -> None:
            self.rbm.take(rbms, number)
            self.begin_crbm(generator)

        first = Stage(
            config.rbm.epochs, lower, lambda: RBMLayer(rbms, frames, uniform, config.rbm, generator), whole=False
        )
        crbm = partial(self.crbm_layer, sequences, controls, onsets, generator, past, config.clamped)
        numbers = list(range(config.restarts)) * config.tries
        tries = [Stage(config.crbm.epochs, partial(upper, number), crbm, whole=True) for number in numbers]
        return [first, *tries], {"rbms": rbms}

    def to_config(self) -> dict[str, Any]:
        """As :meth:`motet_train.papers.tdbn.control_net.ControlNet.to_config`."""
        parts = self.rbm.mask[:, :: self.config.hidden_per_part].argmax(dim=1).tolist()
        return {**asdict(self.config), "parts": parts, "labels": len(self.expansion)}


def from_config(config: Mapping[str, Any]) -> TDBN:
    """An untrained net of the sizes that :meth:`TDBN.to_config` wrote."""
    values = tuples(config)
    parts, labels = values.pop("parts"), values.pop("labels")
    return TDBN(TDBNConfig(**{**values, **{key: Learning(**values[key]) for key in ("rbm", "crbm")}}), parts, labels)
