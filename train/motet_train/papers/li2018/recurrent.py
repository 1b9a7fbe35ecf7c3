"""The recurrent systems with one state for the whole body: RRNN, ERD, LSTM-3LR and LSTM-AE.

Letters in shapes: B rows, L seed frames, T frames, D channels, S LSTMs, U units, I inputs, O outputs.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import torch
from torch import Tensor, nn

from motet_train.models.recurrent import recur
from motet_train.papers.li2018.stepwise import State, System, Taught


@dataclass(frozen=True)
class RRNNConfig:
    """Sizes of RRNN; the defaults are the paper's."""

    dimensions: int
    units: int = 1024


class RRNN(System):
    """Martinez et al. 2017: the next frame is the last one plus a linear map of a GRU's state.

    One GRU (Cho et al. 2014) is encoder and decoder. The published net may also see the action; this one does not, as
    in Li et al. 2018, where it is trained on all actions at once. Initial values are those of the authors' code and the
    library that it used.
    """

    def __init__(self, config: RRNNConfig) -> None:
        super().__init__()
        self.units = config.units
        self.carried = {"hidden": (config.units,), "last": (config.dimensions,)}
        # the GRU, and the map to a step
        self.inward = Reused(config.dimensions, 3 * config.units)
        self.bias = nn.Parameter(torch.cat([torch.ones(2 * config.units), torch.zeros(config.units)]))
        self.gates = Reused(config.units, 2 * config.units)
        self.candidate = Reused(config.units, config.units)
        self.outward = nn.Linear(config.units, config.dimensions)
        for parameter in self.outward.parameters():
            nn.init.uniform_(parameter, -0.04, 0.04)

    def begin(self, seed: Tensor) -> State:
        """The GRU has read all seed frames."""
        start = seed.new_zeros(seed.shape[0], self.units)
        states = recur(lambda hidden, frame: self._cell(hidden, frame[0]), start, [seed])
        return {"hidden": states[:, -1], "last": seed[:, -1]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The last frame plus a linear map of the GRU's state; the state stays the same."""
        return state["last"] + self.outward(state["hidden"]).float(), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The GRU reads one more frame."""
        return {"hidden": self._cell(state["hidden"], frame), "last": frame}

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """A free run: the net is trained on its own predictions, as it is used."""
        with one_gradient(self):
            return super().imagine(windows, seed_frames)

    def _cell(self, hidden: Tensor, frame: Tensor) -> Tensor:
        """The next state (B, U) from this one and a frame (B, D); the reset gate acts before the product."""
        # Cho et al. 2014, eqs 5 to 8
        from_frame = self.inward(frame) + self.bias
        gates = torch.sigmoid(from_frame[:, : 2 * self.units] + self.gates(hidden))
        update, reset = gates.chunk(2, dim=-1)
        candidate = torch.tanh(from_frame[:, 2 * self.units :] + self.candidate(reset * hidden))
        return candidate + update * (hidden - candidate)


@dataclass(frozen=True)
class LSTM3LRConfig:
    """Sizes of LSTM-3LR, and, with others, of ERD.

    encoder, decoder: units of the fully connected layers before and after the LSTMs; a linear layer to the D channels
    comes last. rectified: whether these layers have rectifiers. layers: number of LSTMs. units: of each LSTM.
    """

    dimensions: int
    encoder: tuple[int, ...] = (500,)
    layers: int = 3
    units: int = 1000
    decoder: tuple[int, ...] = ()
    rectified: bool = False


class LSTM(nn.Module):
    """One LSTM layer with a single bias for each gate: 4 U (I + U + 1) parameters."""

    def __init__(self, inputs: int, units: int) -> None:
        super().__init__()
        self.inward = nn.Linear(inputs, 4 * units)
        self.recurrence = Reused(units, 4 * units)

    def forward(self, x: Tensor, state: Tensor) -> Tensor:
        """Inputs (B, T, I) after a state (B, 2 U), outputs and cells, to the states after each frame (B, T, 2 U)."""
        from_frames = self.inward(x).float()
        if x.shape[1] == 1:
            return self._step(state, [from_frames[:, 0]])[:, None]
        return recur(self._step, state, [from_frames])

    def _step(self, state: Tensor, from_frame: list[Tensor]) -> Tensor:
        output, cell = state.chunk(2, dim=-1)
        gates = from_frame[0] + self.recurrence(output)
        input_gate, forget_gate, output_gate, candidate = gates.chunk(4, dim=-1)
        cell = torch.sigmoid(forget_gate) * cell + torch.sigmoid(input_gate) * torch.tanh(candidate)
        return torch.cat([torch.sigmoid(output_gate) * torch.tanh(cell), cell], dim=-1)


class EncoderRecurrentDecoder(Taught):
    """Fragkiadaki et al. 2015: the next frame from LSTMs between an encoder and a decoder of frames.

    ERD, the encoder-recurrent-decoder: rectified fully connected layers, two LSTMs, rectified layers again. LSTM-3LR:
    three LSTMs between linear maps.
    """

    def __init__(self, config: LSTM3LRConfig) -> None:
        super().__init__()
        self.carried = {"states": (config.layers, 2 * config.units)}
        # layers, LSTMs, layers
        self.encoder = _connected((config.dimensions, *config.encoder), config.rectified)
        inputs = [(config.dimensions, *config.encoder)[-1], *[config.units] * (config.layers - 1)]
        self.recurrent = nn.ModuleList(LSTM(size, config.units) for size in inputs)
        hidden = _connected((config.units, *config.decoder), config.rectified)
        self.decoder = nn.Sequential(hidden, nn.Linear((config.units, *config.decoder)[-1], config.dimensions))

    def begin(self, seed: Tensor) -> State:
        """The LSTMs have read all seed frames."""
        return self._read(seed)[1]

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The decoder's output for the last LSTM's output; the state stays the same."""
        return self.decoder(state["states"][:, -1].chunk(2, dim=-1)[0]).float(), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The LSTMs read one more frame."""
        return self._read(frame[:, None], state["states"])[1]

    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """As in any :class:`Taught` system."""
        with one_gradient(self):
            outputs, state = self._read(frames)
        return self.decoder(outputs).float(), state

    def _read(self, frames: Tensor, states: Tensor | None = None) -> tuple[Tensor, State]:
        """Frames (B, T, D) after states (B, S, 2 U), by default 0, to the last LSTM's outputs (B, T, U) and states."""
        if states is None:
            states = frames.new_zeros(frames.shape[0], *self.carried["states"])
        x = self.encoder(frames)
        last_states = []
        for n, layer in enumerate(self.recurrent):
            layer_states = layer(x, states[:, n].contiguous())  # an exported scan needs a contiguous first state
            last_states.append(layer_states[:, -1])
            x = layer_states.chunk(2, dim=-1)[0]
        return x, {"states": torch.stack(last_states, dim=1)}


def _connected(sizes: tuple[int, ...], rectified: bool) -> nn.Sequential:
    """Fully connected layers, each followed by a rectifier if ``rectified``."""
    layers: list[nn.Module] = []
    for inputs, outputs in pairwise(sizes):
        layers.append(nn.Linear(inputs, outputs))
        if rectified:
            layers.append(nn.ReLU())
    return nn.Sequential(*layers)


@dataclass(frozen=True)
class LSTMAEConfig(LSTM3LRConfig):
    """Sizes of LSTM-AE, those of LSTM-3LR first.

    autoencoder: units of its rectified layers; a linear layer to the D channels comes last. dropout: of its inputs.
    """

    autoencoder: tuple[int, ...] = (1000, 500, 1000)
    dropout: float = 0.3


class LSTMAE(EncoderRecurrentDecoder):
    """Ghosh et al. 2017: LSTM-3LR, and an autoencoder of single frames that filters each predicted frame.

    As in the paper, the autoencoder learns to restore frames after dropout, and so learns possible poses; predicted
    frames pass through it before they are returned and fed back, so that errors do not accumulate. Unlike in the paper,
    dropout acts on single channels rather than on joints, which this net does not know; the sizes and the rate are
    ours; and both parts are trained side by side, without a final joint training.
    """

    def __init__(self, config: LSTMAEConfig) -> None:
        super().__init__(config)
        hidden = _connected((config.dimensions, *config.autoencoder), rectified=True)
        outward = nn.Linear(config.autoencoder[-1], config.dimensions)
        self.filter = nn.Sequential(nn.Dropout(config.dropout), hidden, outward)

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The frame of the LSTMs, filtered by the autoencoder; the state stays the same."""
        return self.restored(super().predict(state)[0]), {}

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The LSTMs' error on unfiltered next frames plus the autoencoder's on true frames; they share no weights."""
        return super().loss(windows, seed_frames) + self.error(self.restored(windows), windows)

    def restored(self, frames: Tensor) -> Tensor:
        """Frames (..., D) restored by the autoencoder, in training after dropout."""
        restored: Tensor = self.filter(frames).float()
        return restored


class Reused(nn.Module):
    """A matrix (I, O) by which a recurrent net multiplies at every frame, initially Glorot uniform."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(nn.init.xavier_uniform_(torch.empty(inputs, outputs)))
        self.gathered: tuple[Tensor, _Gathered] | None = None

    def forward(self, x: Tensor) -> Tensor:
        """(B, I) to (B, O), float32."""
        if self.gathered is None:
            return (x @ self.weight).float()
        product: Tensor = _Product.apply(x, *self.gathered)  # type: ignore[no-untyped-call]
        return product


@contextmanager
def one_gradient(net: nn.Module) -> Iterator[None]:
    """Compute the gradient of each :class:`Reused` of ``net`` by one product in the backward pass of this context.

    Otherwise each product adds a matrix of the weights' size to the gradient. Without it, a training step on 16 windows
    in float32 on one thread takes RRNN 1.35 times as long, and LSTM-3LR 1.23 times; in bfloat16 1.04 and 1.24 times.
    """
    parts = [part for part in net.modules() if isinstance(part, Reused)] if torch.is_grad_enabled() else []
    for part in parts:
        gathered = _Gathered(part.weight)
        part.gathered = _Gradient.apply(part.weight, gathered), gathered  # type: ignore[no-untyped-call]
    try:
        yield
    finally:
        for part in parts:
            part.gathered = None


class _Gathered:
    """Shared by the products of one training step with a matrix. pairs: their factors x and their gradients."""

    def __init__(self, weight: Tensor) -> None:
        kind = weight.device.type
        half = torch.is_autocast_enabled(kind)
        self.weight = weight.detach().to(torch.get_autocast_dtype(kind) if half else weight.dtype)
        self.turned = self.weight.T.contiguous()  # a CPU is faster if the matrix comes first and is contiguous
        self.pairs: list[tuple[Tensor, Tensor]] = []


class _Gradient(torch.autograd.Function):
    """A matrix in autograd's graph: its backward pass runs once, after those of all its products."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, gathered: _Gathered) -> Tensor:
        ctx.gathered = gathered
        ctx.dtype = weight.dtype
        return weight.new_zeros(())

    @staticmethod
    def backward(ctx: Any, _: Tensor) -> tuple[Tensor, None]:
        x, gradient = (torch.cat(rows) for rows in zip(*ctx.gathered.pairs, strict=True))
        ctx.gathered.pairs.clear()
        return (x.T @ gradient).to(ctx.dtype), None


class _Product(torch.autograd.Function):
    """One product; its backward pass leaves the gradient of the matrix to :class:`_Gradient`."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, token: Tensor, gathered: _Gathered) -> Tensor:
        ctx.gathered = gathered
        ctx.dtype = x.dtype
        ctx.save_for_backward(x.to(gathered.weight.dtype))
        product: Tensor = (gathered.turned @ ctx.to_save[0].T).T.float()
        return product

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, None]:
        gathered = ctx.gathered
        gradient = gradient.to(gathered.weight.dtype)
        gathered.pairs.append((ctx.saved_tensors[0].detach(), gradient))
        return (gathered.weight @ gradient.T).T.to(ctx.dtype), torch.zeros((), device=gradient.device), None
