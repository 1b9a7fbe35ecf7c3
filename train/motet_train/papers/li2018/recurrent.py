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

    The GRU, of Cho et al. 2014, is encoder and decoder. The published net may also see which action it is; this one
    does not, as in Li et al. 2018, where it is trained on all actions at once. The initial values are those of the
    authors' code and of the library it used.
    """

    def __init__(self, config: RRNNConfig) -> None:
        super().__init__()
        self.units = config.units
        self.carried = {"hidden": (config.units,), "last": (config.dimensions,)}
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
        """The last frame plus what the GRU's state says; nothing else changes."""
        return state["last"] + self.outward(state["hidden"]).float(), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The GRU reads one more frame."""
        return {"hidden": self._cell(state["hidden"], frame), "last": frame}

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """A free run: the net is trained on its own samples, as it will be used."""
        with one_gradient(self):
            return super().imagine(windows, seed_frames)

    def _cell(self, hidden: Tensor, frame: Tensor) -> Tensor:
        """The next state (B, U) from this one and a frame (B, D); the reset gate acts before the product."""
        given = self.inward(frame) + self.bias
        update, reset = torch.sigmoid(given[:, : 2 * self.units] + self.gates(hidden)).chunk(2, dim=-1)
        new = torch.tanh(given[:, 2 * self.units :] + self.candidate(reset * hidden))
        return new + update * (hidden - new)


@dataclass(frozen=True)
class LSTM3LRConfig:
    """Sizes of LSTM-3LR.

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
class ERDConfig(LSTM3LRConfig):
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
            return self._step(state, [given[:, 0]])[:, None]
        return recur(self._step, state, [given])

    def _step(self, state: Tensor, given: list[Tensor]) -> Tensor:
        output, cell = state.chunk(2, dim=-1)
        enter, forget, leave, new = (given[0] + self.recurrence(output)).chunk(4, dim=-1)
        cell = torch.sigmoid(forget) * cell + torch.sigmoid(enter) * torch.tanh(new)
        return torch.cat([torch.sigmoid(leave) * torch.tanh(cell), cell], dim=-1)


class EncoderRecurrentDecoder(Taught):
    """Fragkiadaki et al. 2015: the next frame from LSTMs between an encoder and a decoder of frames.

    ERD, the encoder-recurrent-decoder: rectified fully connected layers, two LSTMs, rectified layers again. LSTM-3LR:
    three LSTMs between linear maps.
    """

    def __init__(self, config: LSTM3LRConfig) -> None:
        super().__init__()
        self.carried = {"states": (config.layers, 2 * config.units)}
        self.encoder = _connected((config.dimensions, *config.encoder), config.rectified)
        inputs = [(config.dimensions, *config.encoder)[-1], *[config.units] * (config.layers - 1)]
        self.recurrent = nn.ModuleList(LSTM(size, config.units) for size in inputs)
        hidden = _connected((config.units, *config.decoder), config.rectified)
        self.decoder = nn.Sequential(hidden, nn.Linear((config.units, *config.decoder)[-1], config.dimensions))

    def begin(self, seed: Tensor) -> State:
        """The LSTMs have read all seed frames."""
        return self._read(seed)[1]

    def predict(self, state: State) -> tuple[Tensor, State]:
        """What the decoder makes of the last LSTM's output; nothing else changes."""
        return self.decoder(state["states"][:, -1].chunk(2, dim=-1)[0]).float(), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The LSTMs read one more frame."""
        return self._read(frame[:, None], state["states"])[1]

    def follow(self, frames: Tensor) -> tuple[Tensor, State]:
        """As of all that are taught."""
        with one_gradient(self):
            outputs, state = self._read(frames)
        return self.decoder(outputs).float(), state

    def _read(self, frames: Tensor, states: Tensor | None = None) -> tuple[Tensor, State]:
        """Frames (B, T, D), after states (B, S, 2 U) or the first ones, to the last LSTM's outputs (B, T, U)."""
        if states is None:
            states = frames.new_zeros(frames.shape[0], *self.carried["states"])
        x, after = self.encoder(frames), []
        for n, layer in enumerate(self.recurrent):
            found = layer(x, states[:, n].contiguous())  # an exported scan begins with nothing else
            after.append(found[:, -1])
            x = found.chunk(2, dim=-1)[0]
        return x, {"states": torch.stack(after, dim=1)}


def _connected(sizes: tuple[int, ...], rectified: bool) -> nn.Sequential:
    layers = ((nn.Linear(*pair), nn.ReLU()) if rectified else (nn.Linear(*pair),) for pair in pairwise(sizes))
    return nn.Sequential(*(part for layer in layers for part in layer))


@dataclass(frozen=True)
class LSTMAEConfig(LSTM3LRConfig):
    """Sizes of LSTM-AE, those of LSTM-3LR first.

    autoencoder: units of its rectified layers; a linear one to the D channels comes last. dropout: of its inputs.
    """

    autoencoder: tuple[int, ...] = (1000, 500, 1000)
    dropout: float = 0.3


class LSTMAE(EncoderRecurrentDecoder):
    """Ghosh et al. 2017: LSTM-3LR, and an autoencoder of single frames that filters each frame it predicts.

    Theirs: the autoencoder learns to restore frames of which a part was dropped out, so that it knows what a body can
    do; predicted frames pass through it before they are shown and fed back, so that errors do not build up. Ours: its
    sizes and the rate; that single channels are dropped, where theirs drops whole joints, of which this net knows
    nothing; and that both parts learn side by side but apart, without the authors' tuning of the whole at the end.
    """

    def __init__(self, config: LSTMAEConfig) -> None:
        super().__init__(config)
        hidden = _connected((config.dimensions, *config.autoencoder), rectified=True)
        outward = nn.Linear(config.autoencoder[-1], config.dimensions)
        self.filter = nn.Sequential(nn.Dropout(config.dropout), hidden, outward)

    def predict(self, state: State) -> tuple[Tensor, State]:
        """What the autoencoder makes of the LSTMs' frame; nothing else changes."""
        return self.restored(super().predict(state)[0]), {}

    def loss(self, windows: Tensor, seed_frames: int) -> Tensor:
        """The LSTMs' error on the next frame, unfiltered, plus the autoencoder's on true frames: no weight has both."""
        return super().loss(windows, seed_frames) + self.error(self.restored(windows), windows)

    def restored(self, frames: Tensor) -> Tensor:
        """Frames (..., D) as the autoencoder gives them back; in training, of what dropout leaves of them."""
        found: Tensor = self.filter(frames).float()
        return found


class Reused(nn.Module):
    """A matrix (I, O) by which a recurrent net multiplies at every frame; Glorot uniform at first."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(nn.init.xavier_uniform_(torch.empty(inputs, outputs)))
        self.gathered: tuple[Tensor, _Gathered] | None = None

    def forward(self, x: Tensor) -> Tensor:
        """(B, I) to (B, O), float32."""
        if self.gathered is None:
            return (x @ self.weight).float()
        found: Tensor = _Product.apply(x, *self.gathered)  # type: ignore[no-untyped-call]
        return found


@contextmanager
def one_gradient(net: nn.Module) -> Iterator[None]:
    """Products made within, by each :class:`Reused` of ``net``, get their gradient by one product in the backward pass.

    Otherwise each adds a matrix of the weights' size to the gradient. Measured: a training step on 16 windows in
    float32 on one thread takes RRNN 1.35 times as long without it, and LSTM-3LR 1.23 times; in bfloat16 1.04 and 1.24.
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
    """What the products of one training step by one matrix share. pairs: their factors x and their gradients."""

    def __init__(self, weight: Tensor) -> None:
        kind = weight.device.type
        half = torch.is_autocast_enabled(kind)
        self.weight = weight.detach().to(torch.get_autocast_dtype(kind) if half else weight.dtype)
        self.turned = self.weight.T.contiguous()  # a CPU is faster where the matrix comes first and lies in order
        self.pairs: list[tuple[Tensor, Tensor]] = []


class _Gradient(torch.autograd.Function):
    """The place of a matrix in autograd's graph: its backward pass runs once, after those of all its products."""

    @staticmethod
    def forward(ctx: Any, weight: Tensor, gathered: _Gathered) -> Tensor:
        ctx.gathered, ctx.dtype = gathered, weight.dtype
        return weight.new_zeros(())

    @staticmethod
    def backward(ctx: Any, _: Tensor) -> tuple[Tensor, None]:
        x, gradient = (torch.cat(rows) for rows in zip(*ctx.gathered.pairs, strict=True))
        ctx.gathered.pairs.clear()
        return (x.T @ gradient).to(ctx.dtype), None


class _Product(torch.autograd.Function):
    """One product: its backward pass leaves to :class:`_Gradient` what the matrix is due."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, token: Tensor, gathered: _Gathered) -> Tensor:
        ctx.gathered, ctx.dtype = gathered, x.dtype
        ctx.save_for_backward(x.to(gathered.weight.dtype))
        found: Tensor = (gathered.turned @ ctx.to_save[0].T).T.float()
        return found

    @staticmethod
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, None]:
        gathered, gradient = ctx.gathered, gradient.to(ctx.gathered.weight.dtype)
        gathered.pairs.append((ctx.saved_tensors[0].detach(), gradient))
        return (gathered.weight @ gradient.T).T.to(ctx.dtype), torch.zeros((), device=gradient.device), None
