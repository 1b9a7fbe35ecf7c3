"""Control nets: the temporal deep belief net (thesis, chapter 4), and its baseline straight on the joint angles.

Where the thesis' text and its author's code differ, the default follows what works (docs/results/tdbn.md shows both):
control units stay clamped in the reconstruction, binary layers are annealed, and the root's rotation is among the
channels; the preset ``thesis`` is the text.

Letters in shapes: B rows, T frames, D channels, H codes, K taps, L labels, C control units, F free hidden units, N
numbers of noise for the codes of a frame.
"""

import math
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import Any, Self, get_type_hints

import torch
from torch import Tensor, nn

from motet.bundle.fields import Json
from motet.bundle.graph import GraphSpec
from motet.representation.contract import Z_LIMIT
from motet_train.evaluate.tables import Figures
from motet_train.models.net import Graphs, Net, configured, encoder_and_step, float_rows, normalised
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
    """Training data of a control net, for each group, such as the clips of a label.

    sequences: (T, D). controls: control values (T, L) of their frames. onsets: see
    :func:`motet_train.papers.tdbn.rbm.transitions`. Arrays, or tensors for the stages of a net.
    """

    sequences: Sequence[Sequence[Any]]
    controls: Sequence[Sequence[Any]]
    onsets: Sequence[float]

    def tensors(self, device: str) -> "Lessons":
        """The same as float32 tensors on a device."""
        sequences = [_tensors(group, device) for group in self.sequences]
        controls = [_tensors(group, device) for group in self.controls]
        return Lessons(sequences, controls, self.onsets)


def _tensors(group: Sequence[Any], device: str) -> list[Tensor]:
    return [torch.tensor(rows, dtype=torch.float32, device=device) for rows in group]


class ControlNet(Net):
    """A CRBM over codes of frames; subclasses encode and decode frames.

    config: sizes and training, see the subclasses. sizes: the other arguments of their constructors, among them
    ``labels``. noise_units: N.
    """

    expansion: Tensor

    def __init__(self, config: Any, crbm: CRBM, width: int, **sizes: Any) -> None:
        super().__init__(width)
        self.config = config
        self.crbm = crbm
        self.sizes = sizes
        self.noise_units = len(crbm.visible_bias)
        labels = sizes["labels"]
        # each label has its own control units, which are all 1 or all 0 (thesis 5.4)
        self.register_buffer("expansion", torch.eye(labels).repeat_interleave(crbm.control_units // labels, dim=1))

    @property
    def defaults(self) -> Figures:
        """The default options of a session."""
        return {"temperature": self.config.temperature}

    def normalised(self, frames: Tensor) -> Tensor:
        """Frames (B, D) in units of sigma standard deviations, for Gaussian units of variance 1."""
        return normalised(frames, self.mean, self.scale, Z_LIMIT / self.config.sigma)

    @abstractmethod
    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to codes (B, H)."""

    @abstractmethod
    def decode(self, codes: Tensor) -> Tensor:
        """Codes (B, H) to frames (B, D)."""

    def vary(self, mean: Tensor, noise: Tensor, variety: Tensor) -> Tensor:
        """Codes (B, H) between their means (variety 0) and binary samples (variety 1), by noise (B, N)."""
        return mean + variety * ((noise < mean).to(mean.dtype) - mean)

    def to_config(self) -> Json:
        """The arguments of :meth:`from_config`; apart from tuples, ready for JSON."""
        return {**asdict(self.config), **self.sizes}

    @classmethod
    def from_config(cls, config: Json) -> Self:
        """An untrained net of the sizes that :meth:`to_config` wrote."""
        names = get_type_hints(cls.CONFIG).keys()
        settings = {key: value for key, value in config.items() if key in names}
        sizes = {key: value for key, value in config.items() if key not in names}
        return cls(configured(cls.CONFIG, settings), **sizes)

    @abstractmethod
    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], Mapping[str, nn.Module]]:
        """The training of the net, layer after layer (thesis 3.3), and further parts that have a state."""

    def begin_crbm(self, generator: torch.Generator) -> None:
        """Initialise the weights of the CRBM; biases are 0."""
        for parameter in self.crbm.parameters():
            if parameter.ndim > 1:
                parameter.normal_(0.0, self.config.initial, generator=generator)
            else:
                parameter.zero_()

    def crbm_layer(
        self,
        lessons: Lessons,
        generator: torch.Generator,
        past: Past,
        clamped: bool = True,
    ) -> CRBMLayer:
        """The training of the CRBM on sequences in the present codes."""
        codes = [list(map(self.encode, group)) for group in lessons.sequences]
        units = [list(map(self._units, group)) for group in lessons.controls]
        data = transitions(codes, units, self.config.taps, lessons.onsets, past.unrolled)
        return CRBMLayer(self.crbm, data, self.config.crbm, generator, clamped, past)

    def _units(self, control: Tensor) -> Tensor:
        """Control values (..., L) as control units (..., C)."""
        return control @ self.expansion

    def step(
        self,
        history: Tensor,
        control: Tensor,
        noise: Tensor,
        variety: Tensor,
        temperature: Tensor,
        codes: Tensor | None = None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One Gibbs iteration of the CRBM, with its codes decoded (thesis 4.1, 5.2).

        history (B, K, H) oldest first, control (B, L), noise (B, N+F) uniform in [0, 1), variety (B, 1), temperature
        (B, 1), and, if there are free units, codes (B, H) to infer them from -> codes (B, H), frame (B, D), and the
        history with the codes at its end (B, K, H).
        """
        crbm = self.crbm
        units = self.noise_units
        # drive from the past and the control units
        past = history.flatten(1)
        drive = crbm.drive(past, self._units(control))
        # free units, inferred from the codes of the last iteration
        free = drive[:, :0]
        if codes is not None:
            free = ControlNet.vary(self, crbm.free(codes, past, temperature), noise[:, units:], variety)
        # codes, and the frame that they decode to
        next_codes = self.vary(crbm.visible(drive, free, temperature), noise[:, :units], variety)
        frame = self.decode(next_codes)
        return next_codes, frame, torch.cat([history[:, 1:], next_codes[:, None]], dim=1)

    def graphs(self) -> Graphs:
        """The encoder and the step, each with its contract."""
        codes = len(self.crbm.visible_bias)
        channels = len(self.mean)
        free = self.crbm.free_units
        inputs = [
            float_rows("history", self.config.taps, codes),
            float_rows("control", len(self.expansion)),
            float_rows("noise", self.noise_units + free),
            float_rows("variety", 1),
            float_rows("temperature", 1),
        ]
        if free:
            inputs.append(float_rows("codes", codes))
        outputs = (
            float_rows("next_codes", codes),
            float_rows("frame", channels),
            float_rows("next_history", self.config.taps, codes),
        )
        step = GraphSpec(tuple(inputs), outputs, {"history": "next_history"})
        encoder = GraphSpec((float_rows("frames", channels),), (float_rows("codes", codes),))
        return encoder_and_step(self, encoder, step)


@dataclass(frozen=True)
class TDBNConfig:
    """Sizes and training of the net; the bundle that ships was trained by the preset ``pure``.

    root_rotation: whether it is among the channels: 59 of CMU's skeleton, otherwise the thesis' 56. control_units:
    for each label. gait_units: above 0, two labels share one block of that size, all 0 for the first and all 1 for
    the second (thesis 5.3). clamped: whether they keep their values in the reconstruction. sigma: standard
    deviation of a visible unit relative to its channel's: with a smaller one, codes are more precise. past_noise,
    unrolled, borrowed_past, borrowed_control: noise, unrolled, borrowed and rival of :class:`Past`. onset: how many
    times as often the first window of a motion that ends is drawn as its last. temperature: of the codes and of
    generation; learning anneals from 1 to it. initial: standard deviation of the first weights. restarts: RBMs that
    learn side by side. tries: most CRBMs trained on each of them until a net reaches its goals. rounds: how often
    all of this begins anew until then.
    """

    fps: float = 40.0
    root_rotation: bool = True
    hidden_per_part: int = 30
    taps: int = 3
    control_units: int = 24
    gait_units: int = 0
    free_units: int = 0
    clamped: bool = True
    sigma: float = 0.38
    past_noise: float = 0.3
    unrolled: int = 0
    borrowed_past: float = 0.035
    borrowed_control: float = 0.17
    onset: float = 300.0
    temperature: float = 0.38
    initial: float = 0.01
    restarts: int = 1
    tries: int = 2
    rounds: int = 3
    rbm: Learning = field(
        default_factory=lambda: Learning(2000, rate=1e-2, final_rate=0.03, steps=2, temperature=(1.0, 0.38))
    )
    crbm: Learning = field(default_factory=lambda: Learning(80, rate=6e-3, final_rate=0.3, temperature=(1.0, 0.38)))


class TDBN(ControlNet):
    """The temporal deep belief net with its normalisation: degrees in, codes as state, degrees out (thesis 4).

    parts: the body part of each channel (D). labels: their number (L).
    """

    CONFIG = TDBNConfig

    def __init__(self, config: TDBNConfig, parts: Sequence[int], labels: int) -> None:
        mask = block_mask(parts, config.hidden_per_part)
        gaits = labels == 2 and config.gait_units > 0
        control = config.gait_units if gaits else labels * config.control_units
        crbm = CRBM(mask.shape[1], config.taps, control, config.free_units)
        super().__init__(config, crbm, len(parts), parts=parts, labels=labels)
        if gaits:
            self.expansion = torch.tensor([[0.0], [1.0]]).expand(2, control).clone()
        self.rbm = RBM(mask)

    def encode(self, frames: Tensor) -> Tensor:
        """Frames (B, D) to codes (B, H)."""
        return self.rbm.encode(self.normalised(frames), self.config.temperature)

    def decode(self, codes: Tensor) -> Tensor:
        """Codes (B, H) to frames (B, D)."""
        return self.rbm.decode(codes) * self.scale + self.mean

    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], dict[str, RBM]]:
        """The RBM, then the CRBM several times with other random numbers; all of it ``rounds`` times.

        There are ``tries`` of these on each of the ``restarts`` of the RBM, which are the parts that have a state.
        """
        config = self.config
        rbms = RBM(self.rbm.mask, config.restarts).to(self.mean.device)

        def begin() -> None:
            rbms.weight.normal_(0.0, config.initial, generator=generator).mul_(rbms.mask)
            rbms.visible_bias.zero_()
            rbms.hidden_bias.zero_()

        # the RBMs, side by side
        layer = partial(RBMLayer, rbms, *self._frames(lessons), config.rbm, generator)
        stages = []
        for _ in range(config.rounds):
            stages.append(Stage(config.rbm.epochs, begin, layer, whole=False))
            for number in [*range(config.restarts)] * config.tries:
                stages.append(self._crbm_stage(rbms, number, lessons, generator))
        return stages, {"rbms": rbms}

    def _crbm_stage(self, rbms: RBM, number: int, lessons: Lessons, generator: torch.Generator) -> Stage:
        """A CRBM on one of the RBMs."""
        config = self.config

        def begin() -> None:
            self.rbm.take(rbms, number)
            self.begin_crbm(generator)

        past = Past(
            config.past_noise,
            unrolled=config.unrolled,
            borrowed=config.borrowed_past,
            block=config.hidden_per_part,
            rival=config.borrowed_control,
        )
        layer = partial(self.crbm_layer, lessons, generator, past, config.clamped)
        return Stage(config.crbm.epochs, begin, layer, whole=True)

    def _frames(self, lessons: Lessons) -> tuple[Tensor, Tensor]:
        """All frames (N, D), normalised, and their probabilities (N,), the same for each group."""
        groups = [torch.cat(list(group)) for group in lessons.sequences]
        frames = self.normalised(torch.cat(groups))
        return frames, balanced([torch.ones(len(group)) for group in groups]).to(self.mean.device)


@dataclass(frozen=True)
class AngleCRBMConfig:
    """Sizes and training of the net, as in :class:`TDBNConfig`.

    Several control units act as one whose weights learn that many times as fast. past_rate: first learning rate of the
    weights from the past to the visible units. Taylor's rates, 1e-3, and 1e-5 for these weights, are for gradients
    summed over a mini-batch of 20; ours are means, so that the same rates are 2e-2 and 2e-4. iterations: Gibbs
    iterations per frame.
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
    """A conditional RBM on the joint angles (Taylor 2007), on which the thesis builds, with its normalisation.

    The visible units, and codes, are the z-scored angles, Gaussian with unit variance; there is no RBM below. channels:
    their number (D). labels: their number (L).
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
        """Between means (variety 0) and normal samples (variety 1), by Box-Muller from noise (B, 2 D)."""
        first, second = noise.chunk(2, dim=1)
        return mean + variety * torch.sqrt(-2 * torch.log(1 - first)) * torch.cos(2 * math.pi * second)

    @property
    def defaults(self) -> Figures:
        """The default options of a session, with the Gibbs iterations."""
        return {**super().defaults, "iterations": self.config.iterations}

    def stages(self, lessons: Lessons, generator: torch.Generator) -> tuple[list[Stage], dict[str, nn.Module]]:
        """The training of the CRBM; no further part has a state."""
        config = self.config
        past = Past(config.past_noise, config.past_rate / config.crbm.rate)
        layer = partial(self.crbm_layer, lessons, generator, past)
        return [Stage(config.crbm.epochs, partial(self.begin_crbm, generator), layer, whole=True)], {}
