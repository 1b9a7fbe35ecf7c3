"""A small predictor: each channel's own extrapolation, plus what a residual MLP over all channels adds to it.

Predicted is the difference to the last seed frame, as coefficients of K orthonormal polynomials of time that vanish
at it. A linear map for each channel on its past steps, split into an ordinary and an outlying part (a sensor's leap is
no velocity), sets the first frames; an MLP on the pose and on the past of all channels, compressed to a few learned
functions of time, sets the later ones. The answer is the mean of that for the seed and of that for its mirror image.

Letters in shapes: B rows, L seed frames, C channels of the contract, D of them that vary, M of these that are
predicted, K output polynomials, P functions of the past, N predicted frames, H hidden units, S signs of errors.
"""

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from motet.bundle.graph import GraphSpec
from motet_train.models.net import Graphs, Net, Part, constants, float_rows, gelu, normalised, zero_linear

GAIN = 3.0
"""Differences of normalised frames are multiplied by it, so that they vary about as much as poses do."""

LEAST = 1e-3
"""Added to a sign of an error before its logarithm, in units of the channels' scales."""


@dataclass(frozen=True)
class PredictorConfig:
    """What varies in the data, and sizes of the net; the default sizes are those that suit the protocol's text files.

    channels: C. kept: the channels that vary, the root's first. held: how many of these are seen, relative to the last
    frame, but not predicted. mirrored, signs: channel c of a mirrored frame is channel ``mirrored[c]`` times
    ``signs[c]``; empty where left and right are not known. doubts: whether it has an :class:`ErrorHead`.
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


def error_signs(seed: Tensor, steps: Tensor, disagreement: Tensor) -> Tensor:
    """Logarithms (B, N, S) of what an error is judged by: how fast and how unevenly the figure moves, how far the net
    takes it, and how much the net's answer differs from that to the mirrored question.

    All in units of the channels' scales. seed: (B, L, M) frames. steps: (B, N, M) predicted, from the last frame.
    disagreement: (B, N), how far the steps are from those predicted for the mirrored seed and mirrored back.
    """
    # how the figure moves before, and how it is predicted to
    velocity = seed.diff(dim=1)
    shared = [size(velocity[:, -1]), size(velocity).mean(1), size(velocity.diff(dim=1)[:, -2:]).mean(1)]
    by_frame = [size(steps), disagreement, size(steps.diff(dim=1, prepend=torch.zeros_like(steps[:, :1])))]
    at_all_frames = [sign[:, None].expand(disagreement.shape) for sign in shared]
    return torch.log(torch.stack([*at_all_frames, *by_frame], dim=-1) + LEAST)


def size(values: Tensor) -> Tensor:
    """The root mean square (...) over the channels of (..., M)."""
    return (values.square().mean(-1) + 1e-12).sqrt()


class ErrorHead(nn.Module):
    """Signs to the expected error in metres, the mean over the joints: for each predicted frame a log-linear law.

    A net's errors where it was trained say little of its errors elsewhere, so the law has few numbers, and is fitted to
    the errors that a trained net makes on motions that were held out.
    """

    weight: Tensor
    bias: Tensor

    def __init__(self, frames: int) -> None:
        super().__init__()
        self.register_buffer("weight", torch.zeros(frames, 6))
        self.register_buffer("bias", torch.zeros(frames))

    def forward(self, logarithms: Tensor) -> Tensor:
        """(B, N, S) to metres (B, N)."""
        return torch.exp((logarithms * self.weight).sum(-1) + self.bias)

    @torch.no_grad()
    def fit(self, logarithms: Tensor, errors: Tensor) -> None:
        """Set the law by measured errors (B, N) in metres, so that its mean is theirs.

        It is the likeliest one if errors are distributed exponentially, so their largest values do not lead it.
        """
        middle = logarithms.mean(0)
        spread = logarithms.std(0).clamp_min(1e-3)
        weight, bias = _likeliest_law(((logarithms - middle) / spread).double(), errors)
        self.weight.copy_(weight / spread)
        self.bias.copy_(bias - (weight * middle / spread).sum(-1))


@torch.enable_grad()
def _likeliest_law(signs: Tensor, errors: Tensor) -> tuple[Tensor, Tensor]:
    """The weights (N, S) and the bias (N,) by which normalised signs (B, N, S) explain errors (B, N) best."""
    law = torch.zeros(signs.shape[1], signs.shape[2] + 1, dtype=torch.float64, requires_grad=True)
    law.data[:, -1] = errors.double().mean(0).log()
    descent = torch.optim.LBFGS([law], max_iter=200, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        descent.zero_grad()
        log = (signs * law[:, :-1]).sum(-1) + law[:, -1]
        lost = (log + errors * torch.exp(-log)).mean() + 1e-2 * law[:, :-1].square().mean()
        lost.backward()  # type: ignore[no-untyped-call]
        return lost

    descent.step(loss)  # type: ignore[no-untyped-call]
    fitted = law.detach()
    return fitted[:, :-1], fitted[:, -1]


class Predictor(Net):
    """Seed frames (B, L, C) to the next frames (B, N, C), both in the contract's units.

    mean, scale: (D,) of the kept channels; a held channel is seen as its difference to the last frame over its scale.
    Channels that are held or do not vary stay as they are in the last frame. doubt: the error head.
    """

    CONFIG = PredictorConfig
    kept: Tensor
    relative: Tensor
    placing: Tensor
    mirrored: Tensor
    signs: Tensor
    doubt: ErrorHead | None

    def __init__(self, config: PredictorConfig) -> None:
        super().__init__(len(config.kept))
        self.config = config
        self.trajectory = Trajectory(config)
        self.doubt = ErrorHead(config.frames) if config.doubts else None
        kept = list(config.kept)
        channels = config.channels
        constants(
            self,
            kept=torch.tensor(kept),
            relative=(torch.arange(len(kept)) < config.held).float(),
            placing=torch.eye(channels)[kept[config.held :]],
            mirrored=torch.tensor(config.mirrored or range(channels)),
            signs=torch.tensor(config.signs or [1.0] * channels),
        )

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
        """Frames (B, L, C) to the next (B, N, C): the mean of those for them and for their mirror image."""
        if not self.config.mirrored:
            return self.plain(frames)
        plain, mirrored = self._both(frames)
        return (plain + mirrored) / 2

    def _both(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """What follows (B, N, C) by the frames, and by their mirror image, mirrored back."""
        # rows and their mirror images in one batch, side by side
        predicted = self.plain(torch.stack([frames, self.mirror(frames)], dim=1).flatten(0, 1))
        both = predicted.reshape(-1, 2, self.config.frames, self.config.channels)
        return both[:, 0], self.mirror(both[:, 1])

    def with_disagreement(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, L, C) to the next (B, N, C), and how far (B, N) their mirror image disagrees about them."""
        plain, mirrored = self._both(frames)
        return (plain + mirrored) / 2, size(self._moved(plain - mirrored) / 2)

    def error_signs(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """The signs (B, N, S) of an error, from frames (B, L, C) and what :meth:`with_disagreement` gives for them."""
        seed = self._seen(frames)[..., self.config.held :]
        return error_signs(seed, self._moved(trajectory - frames[:, -1:]), disagreement)

    def expected_error(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """What :meth:`error_signs` takes to the expected error (B, N) in metres."""
        assert self.doubt is not None
        expected: Tensor = self.doubt(self.error_signs(frames, trajectory, disagreement))
        return expected

    def _moved(self, differences: Tensor) -> Tensor:
        """(B, N, C) to the channels that move (B, N, M), in units of their scales."""
        return differences[..., self.kept[self.config.held :]] / self.scale[self.config.held :]

    def graphs(self) -> Graphs:
        """The encoder, the step and, where the net knows its errors, those: each with its contract."""
        channels = self.config.channels
        count = self.config.frames
        frames = float_rows("frames", self.config.seed_frames, channels)
        # frames in, frames to come
        coming, left = (float_rows(name, count, channels) for name in ("trajectory", "next_trajectory"))
        frame = float_rows("frame", channels)
        step = (Step(), GraphSpec((coming,), (frame, left), {coming.name: left.name}))
        if self.doubt is None:
            return {"encoder": (self, GraphSpec((frames,), (coming,))), "step": step}
        apart, error = (float_rows(name, count) for name in ("disagreement", "error"))
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
