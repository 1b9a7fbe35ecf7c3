"""Control nets: the temporal deep belief net (thesis, chapter 4), and its baseline straight on the joint angles.

Where the thesis' text and its author's code differ, the default follows what works (docs/results/tdbn.md shows both):
control units stay clamped in the reconstruction, binary layers are annealed, and the root's rotation is among the
channels; :meth:`TDBNConfig.thesis` is the text.

Letters in shapes: B rows, T frames, D channels, H codes, K taps, L labels, C control units, F free hidden units, N
numbers of noise for the codes of a frame.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, Self, get_type_hints

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec, TensorSpec
from motet.representation.contract import Z_LIMIT
from motet_train.models.net import Net, Part, configured, normalised
from motet_train.papers.tdbn.rbm import (
    CRBM,
    RBM,
    CRBMLayer,
    Learning,
    Past,
    RBMLayer,
    Stage,
    balanced,
    block_mask,
    transitions,
)


@dataclass(frozen=True, eq=False)
class Lessons:
    """For each group, such as the clips of a label, sequences (T, D), control values (T, L) of their frames, and
    onsets: see :func:`motet_train.papers.tdbn.rbm.transitions`. Arrays; tensors for the net's stages."""

    sequences: Sequence[Sequence[Any]]
    controls: Sequence[Sequence[Any]]
    onsets: Sequence[float]


class ControlNet(Net):
    """A CRBM over codes of frames; subclasses say how frames become codes, and codes frames.

    config: sizes and training, see the subclasses. given: what they are made with beside it, ``labels`` too.
    noise_units: N.
    """

    expansion: Tensor

    def __init__(self, config: Any, crbm: CRBM, width: int, **given: Any) -> None:
        super().__init__(width)
        self.config, self.crbm, self.given = config, crbm, given
        self.noise_units, labels = len(crbm.visible_bias), given["labels"]
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

    def vary(self, mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
        """Codes (B, H) between their means (variety 0) and samples, here binary (variety 1), by noise (B, N)."""
        return mean + variety * ((noise < mean).to(mean.dtype) - mean)

    def to_config(self) -> dict[str, Any]:
        """Everything that :meth:`from_config` needs, but for tuples ready for JSON."""
        return {**asdict(self.config), **self.given}

    @classmethod
    def from_config(cls, config: Mapping[str, Any]) -> Self:
        """An untrained net of the sizes that :meth:`to_config` wrote."""
        own = {key: config[key] for key in config if key in get_type_hints(cls.CONFIG)}
        return cls(configured(cls.CONFIG, own), **{key: config[key] for key in config if key not in own})

    @abstractmethod
    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], Mapping[str, nn.Module]]:
        """How the net, with its mean and scale, learns layer after layer (thesis 3.3), and what else has a state."""

    def begin_crbm(self, generator: torch.Generator) -> None:
        """Set the first weights of the CRBM."""
        for parameter in self.crbm.parameters():
            parameter.zero_()
        for weight in (self.crbm.past_weight, self.crbm.hidden_weight, self.crbm.free_past_weight):
            if weight is not None:
                weight.normal_(0.0, self.config.initial, generator=generator)

    def crbm_layer(self, lessons: Lessons, generator: torch.Generator, past: Past, clamped: bool = True) -> CRBMLayer:
        """The CRBM as what learns, from sequences encoded as they are now."""
        codes = [[self.encode(frames) for frames in found] for found in lessons.sequences]
        units = [[values @ self.expansion for values in found] for found in lessons.controls]
        data = transitions(codes, units, self.config.taps, lessons.onsets, past.own)
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
        free = drive[:, :0]
        if codes is not None:
            free = ControlNet.vary(self, crbm.free(codes, past, temperature), noise[:, units:], variety)
        new = self.vary(crbm.visible(drive, free, temperature), noise[:, :units], variety)
        return new, self.decode(new), torch.cat([history[:, 1:], new[:, None]], dim=1)

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder and the step, each with its contract."""
        codes, channels, free = (len(self.crbm.visible_bias),), (len(self.mean),), self.crbm.free_units
        history, control, noise = (self.config.taps, *codes), (len(self.expansion),), (self.noise_units + free,)
        inputs = {"history": history, "control": control, "noise": noise, "variety": (1,), "temperature": (1,)}
        outputs = {"next_codes": codes, "frame": channels, "next_history": history}

        def specs(sizes: Mapping[str, tuple[int, ...]]) -> tuple[TensorSpec, ...]:
            return tuple(TensorSpec(name, ("batch", *size)) for name, size in sizes.items())

        given = specs({**inputs, "codes": codes} if free else inputs)
        step = GraphSpec(given, specs(outputs), {"history": "next_history"})
        encoder = GraphSpec(specs({"frames": channels}), specs({"codes": codes}))
        return {"encoder": (Part(self, self.encode), encoder), "step": (Part(self, self.step), step)}


@dataclass(frozen=True)
class TDBNConfig:
    """Sizes of the net and how it is trained; the defaults are the recipe of the shipped bundle.

    root_rotation: whether it is among the channels: 59 of CMU's skeleton, else the thesis' 56. control_units: for each
    label. clamped: whether they keep their values in the reconstruction. sigma: standard deviation of a visible unit,
    in units of its channel's own: smaller codes say more. past_noise, own: see :class:`Past`. onset: how many times as
    often the first window of a motion that ends is drawn as its last. temperature: of the codes and of generation;
    learning anneals from 1 to it. initial: standard deviation of the first weights. restarts: RBMs that learn side by
    side: which features they find decides how the net moves. tries: CRBMs learned on each of them at the most, while
    none satisfies.
    """

    fps: float = 40.0
    root_rotation: bool = True
    hidden_per_part: int = 30
    taps: int = 3
    control_units: int = 24
    free_units: int = 0
    clamped: bool = True
    sigma: float = 0.38
    past_noise: float = 0.3
    own: int = 0
    onset: float = 100.0
    temperature: float = 0.38
    initial: float = 0.01
    restarts: int = 2
    tries: int = 3
    rbm: Learning = field(default_factory=lambda: Learning(2000, rate=1e-2, final_rate=0.03, temperature=(1.0, 0.38)))
    crbm: Learning = field(default_factory=lambda: Learning(80, rate=6e-3, final_rate=0.3, temperature=(1.0, 0.38)))

    @staticmethod
    def thesis() -> "TDBNConfig":
        """The thesis' text: 56 angles, control units unclamped in the reconstruction, no annealing (5.2 to 5.4)."""
        rbm, crbm = (Learning(epochs, temperature=(1.0, 1.0)) for epochs in (1000, 100))
        net = TDBNConfig(root_rotation=False, control_units=7, rbm=rbm, crbm=crbm)
        return replace(net.unclamped(), sigma=1.0, past_noise=0.0, onset=1.0, temperature=1.0)

    def unclamped(self) -> "TDBNConfig":
        """The same recipe with control units inferred in the reconstruction, as the thesis' text has it (5.3)."""
        return replace(self, clamped=False, restarts=1, tries=1)


class TDBN(ControlNet):
    """The net with its normalisation: degrees in, codes as state, degrees out.

    parts: the body part of each channel (D). labels: how many (L).
    """

    CONFIG = TDBNConfig

    def __init__(self, config: TDBNConfig, parts: Sequence[int], labels: int) -> None:
        mask = block_mask(parts, config.hidden_per_part)
        control = labels * config.control_units
        crbm = CRBM(mask.shape[1], config.taps, control, config.free_units)
        super().__init__(config, crbm, len(parts), parts=parts, labels=labels)
        self.rbm = RBM(mask)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to codes (B, H)."""
        return self.rbm.encode(self.normalised(frames), self.config.temperature)

    def decode(self, codes: Tensor) -> Tensor:
        """Codes (B, H) to frames (B, D)."""
        return self.rbm.decode(codes) * self.scale + self.mean

    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], dict[str, RBM]]:
        """The RBM, then the CRBM again and again with other random numbers: ``tries`` times on each of the
        ``restarts`` of the RBM, which are what else has a state."""
        config = self.config
        rbms = RBM(self.rbm.mask, config.restarts).to(self.mean.device)
        frames = self.normalised(torch.cat([frames for found in lessons.sequences for frames in found]))
        uniform = balanced([torch.ones(sum(map(len, found))) for found in lessons.sequences]).to(self.mean.device)
        past = Past(config.past_noise, own=config.own)

        def lower() -> None:
            rbms.weight.normal_(0.0, config.initial, generator=generator).mul_(rbms.mask)

        def upper(number: int) -> None:
            self.rbm.take(rbms, number)
            self.begin_crbm(generator)

        rbm = partial(RBMLayer, rbms, frames, uniform, config.rbm, generator)
        crbm = partial(self.crbm_layer, lessons, generator, past, config.clamped)
        numbers = list(range(config.restarts)) * config.tries
        tries = [Stage(config.crbm.epochs, partial(upper, number), crbm, whole=True) for number in numbers]
        return [Stage(config.rbm.epochs, lower, rbm, whole=False), *tries], {"rbms": rbms}


@dataclass(frozen=True)
class AngleCRBMConfig:
    """Sizes of the net and how it is trained, as of :class:`TDBNConfig`.

    Several control units act as one whose weights learn that many times as fast. past_rate: the first one of the
    weights from the past to the visible units. Taylor's rates, 1e-3 and 1e-5 for these, are for gradients summed over a
    mini-batch; ours are means, so that they are 20 times as large here: 2e-2 and 2e-4. iterations: of Gibbs, a frame.
    """

    fps: float = 40.0
    root_rotation: bool = True
    taps: int = 3
    control_units: int = 1
    free_units: int = 60
    sigma: float = 1.0
    past_noise: float = 1.0
    past_rate: float = 2e-4
    onset: float = 100.0
    temperature: float = 1.0
    iterations: int = 30
    initial: float = 0.01
    crbm: Learning = field(
        default_factory=lambda: Learning(400, 3e-2, final_rate=0.01, decay=2e-4, steps=5, temperature=(1.0, 1.0))
    )


class AngleCRBM(ControlNet):
    """A conditional RBM straight on the joint angles (Taylor 2007), which the thesis builds on, with its normalisation.

    The visible units, and codes, are the z-scored angles, Gaussian with unit variance; there is no RBM below.
    channels: how many (D). labels: how many (L).
    """

    CONFIG = AngleCRBMConfig

    def __init__(self, config: AngleCRBMConfig, channels: int, labels: int) -> None:
        crbm = CRBM(channels, config.taps, labels * config.control_units, config.free_units, taylor=True)
        super().__init__(config, crbm, channels, channels=channels, labels=labels)
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

    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], dict[str, nn.Module]]:
        """The CRBM learns; nothing else has a state."""
        config = self.config
        past = Past(config.past_noise, config.past_rate / config.crbm.rate)
        layer = partial(self.crbm_layer, lessons, generator, past)
        return [Stage(config.crbm.epochs, partial(self.begin_crbm, generator), layer, whole=True)], {}
