"""ERD and LSTM-3LR of Fragkiadaki et al. 2015: the next frame from LSTMs between an encoder and a decoder of frames.

ERD, the encoder-recurrent-decoder: rectified fully connected layers, two LSTMs, rectified layers again. LSTM-3LR: three
LSTMs between linear maps. Both learn by predicting each frame of a motion from the true ones before it, with noise.

Letters in shapes: B rows, L seed frames, T frames, D channels, S LSTMs, U units of each, I inputs.
"""

from dataclasses import dataclass
from itertools import pairwise

import torch
from torch import Tensor, nn

from motet_train.models.recurrent import recur
from motet_train.papers.li2018.noise import noise_at, noisy
from motet_train.papers.li2018.reused_activations import Reused, one_gradient
from motet_train.papers.li2018.stepwise import State, System, squared_error


@dataclass(frozen=True)
class Config:
    """Sizes of the net; the defaults are those of LSTM-3LR.

    encoder, decoder: units of the fully connected layers before and after the LSTMs; a linear one to the D channels
    comes last. rectified: whether they have rectifiers. layers: how many LSTMs. units: of each.
    """

    dimensions: int
    encoder: tuple[int, ...] = (500,)
    layers: int = 3
    units: int = 1000
    decoder: tuple[int, ...] = ()
    rectified: bool = False


@dataclass(frozen=True)
class ERDConfig(Config):
    """Sizes of ERD."""

    encoder: tuple[int, ...] = (500, 500)
    layers: int = 2
    decoder: tuple[int, ...] = (500, 100)
    rectified: bool = True


class LSTM(nn.Module):
    """One layer with one bias for each gate: 4 U (I + U + 1) parameters."""

    def __init__(self, inputs: int, units: int) -> None:
        super().__init__()
        self.inward = nn.Linear(inputs, 4 * units)
        self.recurrence = Reused(units, 4 * units)

    def forward(self, x: Tensor, state: Tensor) -> Tensor:
        """(B, T, I) and the state before (B, 2 U), outputs and cells, to the states after each frame (B, T, 2 U)."""
        given = self.inward(x).float()
        if x.shape[1] == 1:
            return self.step(state, [given[:, 0]])[:, None]
        return recur(self.step, state, [given])

    def step(self, state: Tensor, given: list[Tensor]) -> Tensor:
        """The next state (B, 2 U) from this one and what the inputs add to the gates, [(B, 4 U)]."""
        output, cell = state.chunk(2, dim=-1)
        enter, forget, leave, new = (given[0] + self.recurrence(output)).chunk(4, dim=-1)
        cell = torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(new)
        return torch.cat([torch.sigmoid(leave) * torch.tanh(cell), cell], dim=-1)


class EncoderRecurrentDecoder(System):
    """Both nets. noise: std, in normalised units, of what is added to the true frames in training."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.carried = {"states": (config.layers, 2 * config.units)}
        self.constant = {}
        self.noise = 0.0
        self.encoder = connected((config.dimensions, *config.encoder), config.rectified)
        inputs = [(config.dimensions, *config.encoder)[-1], *[config.units] * (config.layers - 1)]
        self.recurrent = nn.ModuleList(LSTM(size, config.units) for size in inputs)
        hidden = connected((config.units, *config.decoder), config.rectified)
        self.decoder = nn.Sequential(hidden, nn.Linear((config.units, *config.decoder)[-1], config.dimensions))

    def begin(self, seed: Tensor) -> State:
        """The LSTMs have read all seed frames."""
        start = seed.new_zeros(seed.shape[0], *self.carried["states"])
        return {"states": self._read(seed, start)[1]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """What the decoder makes of the last LSTM's output; nothing else changes."""
        frame: Tensor = self.decoder(state["states"][:, -1].chunk(2, dim=-1)[0]).float()
        return frame, {}

    def push(self, state: State, frame: Tensor) -> State:
        """The LSTMs read one more frame."""
        return {"states": self._read(frame[:, None], state["states"])[1]}

    def progress(self, share: float) -> None:
        """The noise grows over the training."""
        self.noise = noise_at(share)

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The mean squared error of the frame after each of the true ones, those of the seed too."""
        return squared_error(self.follow(windows[:, :-1]), windows[:, 1:])

    def follow(self, frames: Tensor) -> Tensor:
        """The frame after each of the true ones, all (B, T, D); in training these have noise."""
        seen = noisy(frames, self.noise if self.training else 0.0)
        with one_gradient(self):
            outputs, _ = self._read(seen, seen.new_zeros(seen.shape[0], *self.carried["states"]))
        predicted: Tensor = self.decoder(outputs).float()
        return predicted

    def _read(self, frames: Tensor, states: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, T, D) and states (B, S, 2 U) to the last LSTM's outputs (B, T, U) and the new states."""
        x, after = self.encoder(frames), []
        for n, layer in enumerate(self.recurrent):
            found = layer(x, states[:, n].contiguous())  # an exported scan begins with nothing else
            after.append(found[:, -1])
            x = found.chunk(2, dim=-1)[0]
        return x, torch.stack(after, dim=1)


def connected(sizes: tuple[int, ...], rectified: bool) -> nn.Sequential:
    """Fully connected layers from each size to the next, each with a rectifier where ``rectified``."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers += [nn.Linear(inputs, outputs), nn.ReLU()] if rectified else [nn.Linear(inputs, outputs)]
    return nn.Sequential(*layers)
