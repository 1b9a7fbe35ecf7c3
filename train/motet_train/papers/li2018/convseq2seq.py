"""The convolutional sequence-to-sequence predictor of Li et al. 2018, and its discriminator.

Letters in shapes: B rows, T frames, D channels, C frames of the short-term encoder's window, U units.
"""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn.functional import conv2d, leaky_relu, pad

from motet_train.data.errors import DataError
from motet_train.papers.li2018.stepwise import State, System, free_run

LEAKY_SLOPE = 0.2
"""Slope of the leaky rectifiers."""


@dataclass(frozen=True)
class Config:
    """Sizes of the net; the defaults are the paper's for CMU, and the switches those of its ablations.

    window: C of the short-term encoder, eq. 2. kernel: frames x channels. padding: "valid" (none) or "same",
    which a window of 5 frames and other kernels need. The paper does not say; its authors' code has "valid" for CMU and
    "same" for Human3.6M, and "paper", in recipes alone, becomes that of the data. long_term: the encoder of the seed:
    convolutional, an LSTM, or none. It sees all frames but the last, 49 of 50, as in the authors' code; eq. 1 has all.
    dropout: of each convolution's outputs. decoder_dropout: of the decoder's hidden units. predicted_share: of the
    frames fed back in training, eta in eq. 10; the rest are recorded. loss: "square", the mean squared distance of
    predicted frames, eq. 7, or "distance", their mean distance, which is the final measure and gives early frames,
    whose errors are small, more weight.
    """

    dimensions: int
    seed_frames: int = 50
    window: int = 20
    kernel: tuple[int, int] = (2, 7)
    padding: Literal["valid", "same", "paper"] = "valid"
    long_term: Literal["convolutional", "recurrent", "none"] = "convolutional"
    filters: tuple[int, ...] = (64, 128, 128)
    units: int = 512
    dropout: tuple[float, ...] = (0.0, 0.0, 0.5)
    decoder_dropout: float = 0.5
    predicted_share: float = 1.0
    loss: Literal["square", "distance"] = "square"


class Convolution(nn.Module):
    """A convolution of stride 2 over frames and channels, without bias, and a leaky rectifier (section 3.1)."""

    def __init__(self, inputs: int, outputs: int, kernel: tuple[int, int], padding: str) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(outputs, inputs, *kernel))
        nn.init.xavier_uniform_(self.weight)
        self.kernel = kernel
        self.padding = padding

    def forward(self, x: Tensor) -> Tensor:
        """(B, inputs, T, D) to (B, outputs, T', D')."""
        if self.padding == "same":
            # so many zeros that every second frame and channel has an output; of an odd number, one more goes after
            rows, columns = (max(0, size - 2 + n % 2) for size, n in zip(self.kernel, x.shape[2:], strict=True))
            # torch pads the last axis first
            x = pad(x, [columns // 2, -(-columns // 2), rows // 2, -(-rows // 2)])
        return leaky_relu(conv2d(x, self.weight, stride=2), LEAKY_SLOPE)


class EncodingModule(nn.Module):
    """Three convolutions and a fully connected layer: frames (B, T, D) to (B, U) (section 3.1, the CEM).

    DataError for fewer frames or channels than the convolutions need.
    """

    def __init__(self, frames: int, config: Config, filters: tuple[int, ...]) -> None:
        super().__init__()
        image = torch.zeros(1, 1, frames, config.dimensions)
        layers: list[nn.Module] = []
        try:
            # each convolution shrinks the image
            for outputs, rate in zip(filters, config.dropout, strict=True):
                layer = Convolution(image.shape[1], outputs, config.kernel, config.padding)
                layers += [layer, nn.Dropout(rate)]
                image = layer(image)
        except RuntimeError as error:
            few = f"{frames} frames of {config.dimensions} channels are too few for these convolutions"
            raise DataError(f"{few} without padding: use padding 'same'") from error
        self.layers = nn.Sequential(*layers, nn.Flatten())
        self.linear = nn.Linear(image[0].numel(), config.units)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D) to (B, U)."""
        image = frames[:, None].contiguous(memory_format=torch.channels_last)  # a fifth faster on a CPU
        return leaky_relu(self.linear(self.layers(image)), LEAKY_SLOPE)


class RecurrentEncoder(nn.Module):
    """The paper's alternative to the long-term encoder: the last output of an LSTM."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.lstm = nn.LSTM(config.dimensions, config.units, batch_first=True)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, T, D) to (B, U)."""
        return self.lstm(frames)[0][:, -1]  # type: ignore[no-any-return]


class ConvSeq2Seq(System):
    """Long-term encoder of the seed, short-term encoder of a sliding window, decoder of both, residual (eqs 1-6)."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.config = config
        self.carried = {"window": (config.window, config.dimensions)}
        # the encoder of the seed, if there is one
        self.long_term: nn.Module | None = None
        if config.long_term == "recurrent":
            self.long_term = RecurrentEncoder(config)
        elif config.long_term == "convolutional":
            self.long_term = EncodingModule(config.seed_frames - 1, config, config.filters)
        self.constant = {} if self.long_term is None else {"long_term": (config.units,)}
        # the encoder of the window, and the decoder of both
        self.short_term = EncodingModule(config.window, config, config.filters)
        hidden = nn.Linear(config.units * (1 + len(self.constant)), config.units)
        outward = nn.Linear(config.units, config.dimensions)
        self.decoder = nn.Sequential(hidden, nn.LeakyReLU(LEAKY_SLOPE), nn.Dropout(config.decoder_dropout), outward)

    def begin(self, seed: Tensor) -> State:
        """The last C frames, and the long-term encoding of all frames but the last (eqs 1, 2)."""
        state = {"window": seed[:, -self.config.window :]}
        return state if self.long_term is None else {**state, "long_term": self.long_term(seed[:, :-1])}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The last frame plus the output of the decoder (eq. 6); the state stays the same."""
        both = [state[name] for name in self.constant] + [self.short_term(state["window"])]
        return state["window"][:, -1] + self.decoder(torch.cat(both, dim=1)), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The window moves by one frame (eq. 5)."""
        return {"window": torch.cat([state["window"][:, 1:], frame[:, None]], dim=1)}

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """A free run that may feed back predicted frames mixed with true ones (eq. 10)."""
        seed = windows[:, :seed_frames]
        truth = windows[:, seed_frames:]
        return free_run(self, seed, truth.shape[1], truth, self.config.predicted_share)

    def error(self, predicted: Tensor, truth: Tensor) -> Tensor:
        """The mean squared error (eq. 7), per channel; or the mean distance over the root of the number of channels."""
        if self.config.loss == "square":
            return super().error(predicted, truth)
        mean: Tensor = torch.linalg.vector_norm(predicted - truth, dim=-1).mean() / math.sqrt(truth.shape[-1])
        return mean


class Discriminator(nn.Module):
    """Distinguishes true windows from those that end in predictions (eq. 8); for training only."""

    def __init__(self, config: Config, frames: int) -> None:
        super().__init__()
        self.encode = EncodingModule(frames, config, tuple(2 * n for n in config.filters))
        half = config.units // 2
        self.judge = nn.Sequential(nn.Linear(config.units, half), nn.LeakyReLU(LEAKY_SLOPE), nn.Linear(half, 1))

    def forward(self, windows: Tensor) -> Tensor:
        """Windows (B, T, D) to log odds (B,) that they are true."""
        odds: Tensor = self.judge(self.encode(windows))[:, 0]
        return odds
