"""A small predictor: each channel's own extrapolation, plus what a residual MLP over all channels adds to it.

Predicted is the difference to the last seed frame, as coefficients of K orthonormal polynomials of time that vanish
at it. A linear map for each channel on its past steps, split into an ordinary and an outlying part (a sensor's leap is
no velocity), sets the first frames; an MLP on the pose and on the past of all channels, compressed to a few learned
functions of time, sets the later ones. The answer is the mean of that for the seed and of that for its mirror image.

Letters in shapes: B rows, L seed frames, C channels of the contract, D of them that vary, M of these that are
predicted, K output polynomials, P functions of the past, N predicted frames, H hidden units.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import gelu

from motet.bundle.graph import GraphSpec, TensorSpec
from motet_train.models.net import Net, Part, tuples
from motet_train.models.normalised import normalised
from motet_train.models.predict.error_head import ErrorHead, signs, size

GAIN = 3.0
"""Differences of normalised frames are multiplied by it, so that they vary about as much as poses do."""


@dataclass(frozen=True)
class PredictorConfig:
    """What varies in the data, and sizes of the net; the default sizes are those that suit the protocol's text files.

    channels: C. kept: the channels that vary, the root's first. held: how many of these are seen, relative to the last
    frame, but not predicted. mirrored, signs: channel c of a mirrored frame is channel ``mirrored[c]`` times
    ``signs[c]``; empty where left and right are not known. doubts: whether it knows its errors
    (:class:`motet_train.models.predict.error_head.ErrorHead`).
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
    doubts: bool = False


def from_config(data: Mapping[str, Any]) -> "Predictor":
    """The net of a configuration as it stands in a manifest."""
    return Predictor(PredictorConfig(**tuples(data)))


def _polynomials(points: Tensor, count: int) -> Tensor:
    """Orthonormal polynomials (T, count) at ``points`` (T), all 0 at 0."""
    basis: Tensor = torch.linalg.qr(points[:, None] ** torch.arange(1, count + 1))[0]
    return basis


class Block(nn.Module):
    """A residual step of the MLP."""

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
        self.config, steps, seen = config, config.seed_frames - 1, len(config.kept)
        moved, k = seen - config.held, config.polynomials
        self.past = nn.Parameter(2 * _polynomials(torch.arange(steps, 0, -1.0) / steps, config.past))
        future = GAIN * _polynomials(torch.arange(1.0, config.frames + 1) / config.frames, k)
        self.register_buffer("future", future)
        self.dropout = nn.Dropout(config.dropout)
        self.inward = nn.Linear(seen * (config.past + 1), config.hidden)
        self.blocks = nn.Sequential(*(Block(config.hidden, config.dropout) for _ in range(config.blocks)))
        self.outward = nn.Linear(config.hidden, moved * k)
        nn.init.zeros_(self.outward.weight)
        nn.init.zeros_(self.outward.bias)
        self.limit = nn.Parameter(torch.ones(moved))
        self.ordinary = nn.Parameter(torch.zeros(moved, steps, k))
        self.outlying = nn.Parameter(torch.zeros(moved, steps, k))

    def forward(self, seed: Tensor) -> Tensor:
        """Seed (B, L, D) to steps (B, N, M)."""
        coefficients = self._together(seed) + self._alone(seed[..., self.config.held :])
        return torch.einsum("tk,bkc->btc", self.future, coefficients)

    def _together(self, seed: Tensor) -> Tensor:
        """Coefficients (B, K, M) from all channels (B, L, D)."""
        past = torch.einsum("blc,lk->bkc", GAIN * (seed - seed[:, -1:])[:, :-1], self.past)
        hidden = self.blocks(self.inward(self.dropout(torch.cat([past.flatten(1), seed[:, -1]], 1))))
        out: Tensor = self.outward(gelu(hidden))
        return out.view(-1, self.config.polynomials, len(self.limit))

    def _alone(self, seed: Tensor) -> Tensor:
        """Coefficients (B, K, M) from each channel's own steps in (B, L, M)."""
        step = GAIN * (seed[:, 1:] - seed[:, :-1])
        usual = self.limit * torch.tanh(step / self.limit)
        ordinary = torch.einsum("blc,clk->bkc", usual, self.ordinary)
        return ordinary + torch.einsum("blc,clk->bkc", step - usual, self.outlying)


class Predictor(Net):
    """Seed frames (B, L, C) to the next frames (B, N, C), both in the contract's units.

    mean, scale: (D,) of the kept channels; a held channel is seen as its difference to the last
    frame over its scale. Channels that are held or do not vary stay as they are in the last frame.
    """

    kept: Tensor
    relative: Tensor
    placing: Tensor
    mirrored: Tensor
    signs: Tensor
    doubt: ErrorHead | None
    """The error head, by the name that it has in the weights of runs."""

    def __init__(self, config: PredictorConfig) -> None:
        super().__init__(len(config.kept))
        self.config = config
        self.trajectory = Trajectory(config)
        self.doubt = ErrorHead(config.frames) if config.doubts else None
        kept, channels = list(config.kept), config.channels
        self.register_buffer("kept", torch.tensor(kept), persistent=False)
        self.register_buffer("relative", (torch.arange(len(kept)) < config.held).float(), persistent=False)
        self.register_buffer("placing", torch.eye(channels)[kept[config.held :]], persistent=False)
        self.register_buffer("mirrored", torch.tensor(config.mirrored or range(channels)), persistent=False)
        self.register_buffer("signs", torch.tensor(config.signs or [1.0] * channels), persistent=False)

    def plain(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C), without the mirror image: what is trained."""
        steps = self.trajectory(self._seen(frames)) * self.scale[self.config.held :]
        predicted: Tensor = frames[:, -1:] + steps @ self.placing
        return predicted

    def _seen(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) as normalised seed frames (B, L, D)."""
        seen = frames[:, -self.config.seed_frames :, self.kept]
        return normalised(seen - self.relative * seen[:, -1:], self.mean, self.scale)

    def mirror(self, frames: Tensor) -> Tensor:
        """Frames (B, T, C) with left and right exchanged."""
        return frames[..., self.mirrored] * self.signs

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C): the mean of the two ways of looking at them."""
        if not self.config.mirrored:
            return self.plain(frames)
        one, other = self._both(frames)
        return (one + other) / 2

    def _both(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """What follows (B, N, C) by the frames, and by their mirror image, mirrored back."""
        # rows and their mirror images in one batch, side by side
        found = self.plain(torch.stack([frames, self.mirror(frames)], dim=1).flatten(0, 1))
        both = found.reshape(-1, 2, self.config.frames, self.config.channels)
        return both[:, 0], self.mirror(both[:, 1])

    def with_disagreement(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, L, C) to the next (B, N, C), and how far (B, N) their mirror image disagrees about them."""
        one, other = self._both(frames)
        return (one + other) / 2, size(self._moved(one - other) / 2)

    def error_signs(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """The signs (B, N, S) of an error, from frames (B, L, C) and what :meth:`with_disagreement` gives for them."""
        seed = self._seen(frames)[..., self.config.held :]
        return signs(seed, self._moved(trajectory - frames[:, -1:]), disagreement)

    def expected_error(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """What :meth:`error_signs` takes to the expected error (B, N) in metres."""
        assert self.doubt is not None
        expected: Tensor = self.doubt(self.error_signs(frames, trajectory, disagreement))
        return expected

    def _moved(self, differences: Tensor) -> Tensor:
        """(B, N, C) to the channels that move (B, N, M), in units of their scales."""
        return differences[..., self.kept[self.config.held :]] / self.scale[self.config.held :]

    def graphs(self) -> dict[str, tuple[nn.Module, GraphSpec]]:
        """The encoder, the step and, where the net knows its errors, those: each with its contract."""
        frames = TensorSpec("frames", ("batch", self.config.seed_frames, self.config.channels))
        coming, left = (
            TensorSpec(name, ("batch", self.config.frames, self.config.channels))
            for name in ("trajectory", "next_trajectory")
        )
        frame = TensorSpec("frame", ("batch", self.config.channels))
        step = (Step(), GraphSpec((coming,), (frame, left), {coming.name: left.name}))
        if self.doubt is None:
            return {"encoder": (self, GraphSpec((frames,), (coming,))), "step": step}
        apart, error = (TensorSpec(name, ("batch", self.config.frames)) for name in ("disagreement", "error"))
        return {
            "encoder": (Part(self, self.with_disagreement), GraphSpec((frames,), (coming, apart))),
            "step": step,
            "error": (Part(self, self.expected_error), GraphSpec((frames, coming, apart), (error,))),
        }


class Step(nn.Module):
    """The step graph of a net that predicts all its frames at once: takes the first of those that are to come."""

    def forward(self, trajectory: Tensor) -> tuple[Tensor, Tensor]:
        """Frames to come (B, N, C) to the next frame (B, C) and those after it (B, N, C), the last one twice."""
        return trajectory[:, 0], torch.cat([trajectory[:, 1:], trajectory[:, -1:]], dim=1)
