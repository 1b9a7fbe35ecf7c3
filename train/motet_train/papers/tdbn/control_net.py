"""What control models share: the past in codes, control units expanded from labels, and the two graphs.

Letters in shapes: B rows, D channels, H codes, K taps, L labels, C control units, F free hidden units, N noise.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec, TensorSpec
from motet.representation.contract import Z_LIMIT
from motet_train.models.net import Net, Part, normalised
from motet_train.papers.tdbn.contrastive import Stage
from motet_train.papers.tdbn.crbm import CRBM, CRBMLayer, Past, transitions

Sequences = Sequence[Sequence[Tensor]]
"""For each group, such as a label, its sequences of frames (T, D), or the labels' values (T, L) at these."""


class ControlNet(Net):
    """A CRBM over codes of frames; subclasses say how frames become codes, and codes frames.

    config: sizes and training, see the subclasses. noise_units: N, numbers of noise for the codes of a frame.
    """

    config: Any
    expansion: Tensor

    def __init__(self, crbm: CRBM, labels: int, channels: int, taps: int) -> None:
        super().__init__(channels)
        self.crbm, self.taps = crbm, taps
        self.noise_units = len(crbm.visible_bias)
        # each label has its own control units, which are all 1 or all 0 (thesis 5.4)
        self.register_buffer("expansion", torch.eye(labels).repeat_interleave(crbm.control_units // labels, dim=1))

    @property
    def defaults(self) -> dict[str, float]:
        """How a session runs that is told nothing else."""
        return {"temperature": self.config.temperature}

    def normalised(self, frames: Tensor) -> Tensor:
        """Frames (B, D) as Gaussian units of variance 1 see them: over sigma standard deviations."""
        return normalised(frames, self.mean, self.scale, Z_LIMIT / self.config.sigma)

    @abstractmethod
    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to codes (B, H)."""

    @abstractmethod
    def decode(self, codes: Tensor) -> Tensor:
        """Codes (B, H) to frames (B, D)."""

    @abstractmethod
    def vary(self, mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
        """Codes (B, H) between their means (variety 0) and samples (variety 1), from uniform noise (B, N)."""

    @abstractmethod
    def to_config(self) -> dict[str, Any]:
        """Everything that the model's ``from_config`` needs, but for tuples ready for JSON."""

    @abstractmethod
    def stages(
        self, sequences: Sequences, controls: Sequences, onsets: Sequence[float], generator: torch.Generator
    ) -> tuple[list[Stage], Mapping[str, nn.Module]]:
        """How the net learns, one layer after the other (thesis 3.3), and what else has a state.

        The mean and the scale must be set. onsets: see :func:`motet_train.papers.tdbn.crbm.transitions`.
        """

    def begin_crbm(self, generator: torch.Generator) -> None:
        """Set the first weights of the CRBM."""
        for parameter in self.crbm.parameters():
            parameter.zero_()
        for weight in (self.crbm.past_weight, self.crbm.hidden_weight, self.crbm.free_past_weight):
            if weight is not None:
                weight.normal_(0.0, self.config.initial, generator=generator)

    def crbm_layer(
        self,
        sequences: Sequences,
        controls: Sequences,
        onsets: Sequence[float],
        generator: torch.Generator,
        past: Past,
        clamped: bool = True,
    ) -> CRBMLayer:
        """The CRBM as what learns, from sequences encoded as they are now."""
        codes = [[self.encode(frames) for frames in found] for found in sequences]
        units = [[values @ self.expansion for values in found] for found in controls]
        data = transitions(codes, units, self.taps, onsets, past.own)
        return CRBMLayer(self.crbm, data, self.config.crbm, generator, clamped, past)

    def step(
        self,
        history: Tensor,
        control: Tensor,
        noise: Tensor,
        variety: Tensor,
        temperature: Tensor,
        codes: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One Gibbs iteration of the CRBM, and its codes decoded (thesis 4.1, 5.2).

        history (B, K, H) oldest first, control (B, L), noise (B, N+F) uniform in [0, 1), variety (B, 1), temperature
        (B, 1), and where there are free units codes (B, H) to infer them from -> codes (B, H), frame (B, D), the
        history with the codes at its end (B, K, H).
        """
        crbm, units, past = self.crbm, self.noise_units, history.flatten(1)
        drive = crbm.drive(past, control @ self.expansion)
        free = drive[:, :0] if codes is None else binary(crbm.free(codes, past, temperature), noise[:, units:], variety)
        new = self.vary(crbm.visible(drive, free, temperature), noise[:, :units], variety)
        return new, self.decode(new), torch.cat([history[:, 1:], new[:, None]], dim=1)

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder and the step, each with its contract."""
        return {
            "encoder": (Part(self, self.encode), self._encoder_spec()),
            "step": (Part(self, self.step), self._step_spec()),
        }

    def _encoder_spec(self) -> GraphSpec:
        frames, codes = ("batch", len(self.mean)), ("batch", len(self.crbm.visible_bias))
        return GraphSpec((TensorSpec("frames", frames),), (TensorSpec("codes", codes),))

    def _step_spec(self) -> GraphSpec:
        codes, free = len(self.crbm.visible_bias), self.crbm.free_units
        inputs: dict[str, tuple[int, ...]] = {
            "history": (self.taps, codes),
            "control": (len(self.expansion),),
            "noise": (self.noise_units + free,),
            "variety": (1,),
            "temperature": (1,),
        }
        if free:
            inputs["codes"] = (codes,)
        outputs = {"next_codes": (codes,), "frame": (len(self.mean),), "next_history": (self.taps, codes)}
        both = [tuple(TensorSpec(n, ("batch", *size)) for n, size in part.items()) for part in (inputs, outputs)]
        return GraphSpec(both[0], both[1], {"history": "next_history"})


def binary(mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
    """Between probabilities (variety 0) and binary samples of them (variety 1)."""
    return mean + variety * ((noise < mean).to(mean.dtype) - mean)
