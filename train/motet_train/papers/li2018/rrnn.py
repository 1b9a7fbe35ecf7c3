"""The residual recurrent net of Martinez et al. 2017.

One GRU is encoder and decoder. The published net may also see which action it is; this one does not, as in Li et al.
2018, where it is trained on all actions at once. The cell is that of Cho et al. 2014, the initial values are those of
the authors' code and of the library it used.

Letters in shapes: B rows, L seed frames, N predicted frames, D channels, U units.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet_train.models.recurrent import recur
from motet_train.papers.li2018.reused_activations import Reused, one_gradient
from motet_train.papers.li2018.stepwise import State, System


@dataclass(frozen=True)
class Config:
    """Sizes of the net; the defaults are the paper's."""

    dimensions: int
    units: int = 1024


class RRNN(System):
    """The next frame is the last one plus a linear map of the GRU's state."""

    def __init__(self, config: Config) -> None:
        super().__init__()
        self.units = config.units
        self.carried = {"hidden": (config.units,), "last": (config.dimensions,)}
        self.constant = {}
        self.inward = Reused(config.dimensions, 3 * config.units)
        self.bias = nn.Parameter(torch.cat([torch.ones(2 * config.units), torch.zeros(config.units)]))
        self.gates = Reused(config.units, 2 * config.units)
        self.candidate = Reused(config.units, config.units)
        self.outward = nn.Linear(config.units, config.dimensions)
        for parameter in self.outward.parameters():
            nn.init.uniform_(parameter, -0.04, 0.04)

    def begin(self, seed: Tensor) -> State:
        """The GRU has read all seed frames: encoder and decoder are one, so the decoder's first frame is among them."""
        start = seed.new_zeros(seed.shape[0], self.units)
        states = recur(lambda hidden, frame: self.cell(hidden, frame[0]), start, [seed])
        return {"hidden": states[:, -1], "last": seed[:, -1]}

    def predict(self, state: State) -> tuple[Tensor, State]:
        """The last frame plus what the GRU's state says; nothing else changes."""
        return state["last"] + self.outward(state["hidden"]).float(), {}

    def push(self, state: State, frame: Tensor) -> State:
        """The GRU reads one more frame."""
        return {"hidden": self.cell(state["hidden"], frame), "last": frame}

    def imagine(self, windows: Tensor, seed_frames: int) -> Tensor:
        """A free run: the net is trained on its own samples, as it will be used."""
        with one_gradient(self):
            return super().imagine(windows, seed_frames)

    def cell(self, hidden: Tensor, frame: Tensor) -> Tensor:
        """The next state (B, U) from this one and a frame (B, D); the reset gate acts before the product."""
        given = self.inward(frame) + self.bias
        update, reset = torch.sigmoid(given[:, : 2 * self.units] + self.gates(hidden)).chunk(2, dim=-1)
        new = torch.tanh(given[:, 2 * self.units :] + self.candidate(reset * hidden))
        return new + update * (hidden - new)
