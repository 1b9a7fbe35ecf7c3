"""A small predictor of channels: each one's own extrapolation, plus what a residual MLP over all of them adds to it.

Predicted is the difference to the last seed frame, as coefficients of K orthonormal polynomials of time that vanish
at it. A linear map for each channel on its past steps, split into an ordinary and an outlying part (a sensor's leap is
no velocity), sets the first frames; an MLP on the pose and on the past of all channels, compressed to a few learned
functions of time, sets the later ones. The answer is the mean of that for the seed and of that for its mirror image.

Letters in shapes: B rows, L seed frames, C channels of the contract, D of them that vary, M of these that are
predicted, K output polynomials, P functions of the past, N predicted frames, H hidden units.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.net import Graphs, Net, constants, float_rows, gelu, normalised, zero_linear

GAIN = 3.0
"""Differences of normalised frames are multiplied by it, so that they vary about as much as poses do."""


@dataclass(frozen=True)
class PredictorConfig:
    """What varies in the data, and sizes of the net, those that suit the protocol's text files.

    channels: C. kept: the channels that vary, the root's first. held: how many of these are seen, relative to the last
    frame, but not predicted. mirrored, signs: channel c of a mirrored frame is channel ``mirrored[c]`` times
    ``signs[c]``; empty where left and right are not known.
    """

    channels: int
    kept: tuple[int, ...]
    held: int = 0
    mirrored: tuple[int, ...] = ()
    signs: tuple[float, ...] = ()
    seed_frames: int = 10
    frames: int = 25
    polynomials: int = 8
    past: int = 5
    hidden: int = 184
    blocks: int = 2
    dropout: float = 0.3


class Block(nn.Module):
    """A residual step of an MLP."""

    def __init__(self, hidden: int, dropout: float) -> None:
        super().__init__()
        layers = (nn.Linear(hidden, hidden), nn.GELU(), nn.Dropout(dropout), nn.Linear(hidden, hidden))
        self.layers = nn.Sequential(nn.LayerNorm(hidden), *layers)

    def forward(self, x: Tensor) -> Tensor:
        """(B, H) to (B, H)."""
        out: Tensor = x + self.layers(x)
        return out


class Trajectory(nn.Module):
    """Normalised seed frames (B, L, D) to steps from the last one (B, N, M), both in units of the channels' scales."""

    past: Tensor
    future: Tensor

    def __init__(self, config: PredictorConfig) -> None:
        super().__init__()
        self.config = config
        steps = config.seed_frames - 1
        seen = len(config.kept)
        moved = seen - config.held
        k = config.polynomials

        # functions of the past and of the future
        self.past = nn.Parameter(2 * polynomials(torch.arange(steps, 0, -1.0) / steps, config.past))
        self.register_buffer("future", GAIN * polynomials(torch.arange(1.0, config.frames + 1) / config.frames, k))

        # the MLP over all channels
        self.dropout = nn.Dropout(config.dropout)
        self.inward = nn.Linear(seen * (config.past + 1), config.hidden)
        self.blocks = nn.Sequential(*(Block(config.hidden, config.dropout) for _ in range(config.blocks)))
        self.outward = zero_linear(config.hidden, moved * k)

        # the linear map of each channel alone
        self.limit = nn.Parameter(torch.ones(moved))
        self.ordinary = nn.Parameter(torch.zeros(moved, steps, k))
        self.outlying = nn.Parameter(torch.zeros(moved, steps, k))

    def forward(self, seed: Tensor) -> Tensor:
        """Seed (B, L, D) to steps (B, N, M)."""
        # coefficients (B, K, M) by the MLP on all channels
        past = torch.einsum("blc,lk->bkc", GAIN * (seed - seed[:, -1:])[:, :-1], self.past)
        hidden = self.blocks(self.inward(self.dropout(torch.cat([past.flatten(1), seed[:, -1]], 1))))
        together = self.outward(gelu(hidden)).view(-1, self.config.polynomials, len(self.limit))

        # and by each channel alone, from ordinary and outlying steps
        moved = seed[..., self.config.held :]
        step = GAIN * (moved[:, 1:] - moved[:, :-1])
        usual = self.limit * torch.tanh(step / self.limit)
        ordinary = torch.einsum("blc,clk->bkc", usual, self.ordinary)
        alone = ordinary + torch.einsum("blc,clk->bkc", step - usual, self.outlying)
        return torch.einsum("tk,bkc->btc", self.future, together + alone)


def polynomials(points: Tensor, count: int) -> Tensor:
    """Orthonormal polynomials (T, count) at points (T,), all 0 at 0."""
    basis: Tensor = torch.linalg.qr(points[:, None] ** torch.arange(1, count + 1))[0]
    return basis


class Predictor(Net):
    """Seed frames (B, L, C) to the next frames (B, N, C), both in the contract's units.

    mean, scale: (D,) of the kept channels; a held channel is seen as its difference to the last frame over its scale.
    Channels that are held or do not vary stay as they are in the last frame.
    """

    CONFIG = PredictorConfig
    kept: Tensor
    relative: Tensor
    placing: Tensor
    mirrored: Tensor
    signs: Tensor

    def __init__(self, config: PredictorConfig) -> None:
        super().__init__(len(config.kept))
        self.config = config
        self.trajectory = Trajectory(config)
        kept = list(config.kept)
        constants(
            self,
            kept=torch.tensor(kept),
            relative=(torch.arange(len(kept)) < config.held).float(),
            placing=torch.eye(config.channels)[kept[config.held :]],
            mirrored=torch.tensor(config.mirrored or range(config.channels)),
            signs=torch.tensor(config.signs or [1.0] * config.channels),
        )

    def mirror(self, frames: Tensor) -> Tensor:
        """Frames (B, T, C) with left and right exchanged."""
        return frames[..., self.mirrored] * self.signs

    def plain(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C), without the mirror image: what is trained."""
        steps = self.trajectory(self._seen(frames)) * self.scale[self.config.held :]
        predicted: Tensor = frames[:, -1:] + steps @ self.placing
        return predicted

    def _seen(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) as normalised seed frames (B, L, D)."""
        seen = frames[:, -self.config.seed_frames :, self.kept]
        return normalised(seen - self.relative * seen[:, -1:], self.mean, self.scale)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C): the mean of those for them and for their mirror image."""
        if not self.config.mirrored:
            return self.plain(frames)
        # rows and their mirror images in one batch, side by side
        both = torch.stack([frames, self.mirror(frames)], dim=1).flatten(0, 1)
        predicted = torch.unflatten(self.plain(both), 0, (-1, 2))
        mean: Tensor = (predicted[:, 0] + self.mirror(predicted[:, 1])) / 2
        return mean

    def graphs(self) -> Graphs:
        """The encoder and the step, each with its contract."""
        channels = self.config.channels
        frames = float_rows("frames", self.config.seed_frames, channels)
        coming = float_rows("trajectory", self.config.frames, channels)
        return {"encoder": (self, GraphSpec((frames,), (coming,))), "step": step_graph(coming)}


def step_graph(coming: TensorSpec) -> tuple[nn.Module, GraphSpec]:
    """The step of a net that predicts all its frames (B, N, C) at once, and its contract."""
    frame = float_rows("frame", *coming.shape[2:])
    left = float_rows(f"next_{coming.name}", *coming.shape[1:])
    return Step(), GraphSpec((coming,), (frame, left), {coming.name: left.name})


class Step(nn.Module):
    """The step graph of a net that predicts all its frames at once: takes the first of those that are to come."""

    def forward(self, trajectory: Tensor) -> tuple[Tensor, Tensor]:
        """Frames to come (B, N, C) to the next frame (B, C) and those after it (B, N, C), the last one twice."""
        return trajectory[:, 0], torch.cat([trajectory[:, 1:], trajectory[:, -1:]], dim=1)
