"""A predictor of figures: where points of a figure were, to where they will be, and from there to its frames.

A few residual MLPs see the joints and a marker of each bone in all seed frames, from above the last frame's ground and
in its facing, and each gives their steps from the last frame as weights of a few cosines of time. The answer is their
mean for the seed and for its mirror image, with each bone at its length and aimed at the point of its child.
(Rotations along chains of bones, learnt in place of points, are predicted worse: docs/results/predict.md.)

Letters in shapes: B rows, L seed frames, C channels of the contract, P points, N predicted frames, H hidden units, W
cosines, S signs of errors.
"""

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet_train.models.kinematics import VectorFigure, VectorPoints, in_whole_registers
from motet_train.models.net import Graphs, Net, Part, constants, float_rows, zero_linear
from motet_train.models.predictor import Block, step_graph

ERROR_FLOOR = 1e-3
"""Metres added to a sign of an error before its logarithm."""

LARGEST_SIGN = 10.0
"""Metres that an error, and a sign of it, count as at most: no figure goes as far within a horizon."""

LARGEST_INPUT = 25.0
"""Numbers of frames further from 0, in metres, radians, and these a second, are no motion, and count as this."""

PLACE_SCALE = 3.0
"""Factor on metres, so that inputs and outputs are of the order of 1."""

STEP_SCALE = 20.0
"""Factor on metres a frame, likewise."""


@dataclass(frozen=True)
class FigurePredictorConfig:
    """The figure, and sizes of the net. figure: see :class:`motet_train.models.kinematics.VectorFigure`.

    channels: C. members: MLPs whose answers are averaged. waves: W. doubts: whether the net has an :class:`ErrorHead`,
    which needs the mirror image.
    """

    channels: int
    figure: VectorFigure = field(default_factory=VectorFigure)
    seed_frames: int = 10
    frames: int = 25
    members: int = 3
    waves: int = 8
    hidden: int = 320
    blocks: int = 3
    dropout: float = 0.1
    doubts: bool = False


def error_signs(past: Tensor, steps: Tensor, disagreement: Tensor) -> Tensor:
    """Logarithms (S, B, N) of what an error is judged by: how fast and how unevenly the figure moves, how far the net
    takes it and on what way, and how much its answers so far differ from those to the mirrored question.

    All in metres. past: (B, L - 1, P, 3), the steps of points between seed frames. steps: (B, N, P, 3) predicted, from
    the last frame. disagreement: (B, N), as :meth:`FigurePredictor.with_disagreement` gives it.
    """
    # how the figure moves before, and how it is predicted to
    shared = [size(past[:, -1]), _mean_of_frames(size(past)), _mean_of_frames(size(past.diff(dim=1)[:, -2:]))]
    way = size(steps.diff(dim=1, prepend=torch.zeros_like(steps[:, :1]))).cumsum(1)
    by_frame = [size(steps), disagreement.cumsum(1), way]
    at_all_frames = [sign[:, None].expand(disagreement.shape) for sign in shared]
    signs = torch.stack([*at_all_frames, *by_frame]).clamp_max(LARGEST_SIGN) + ERROR_FLOOR
    return in_whole_registers(torch.log, signs)


def size(points: Tensor) -> Tensor:
    """The root mean square (...) over the numbers of points (..., P, 3)."""
    norm: Tensor = torch.linalg.vector_norm(points, dim=(-2, -1))
    return norm / math.sqrt(math.prod(points.shape[-2:]))


def _mean_of_frames(sizes: Tensor) -> Tensor:
    """(B, T) to (B,), one frame after the other: other sums of rows depend on their places in memory."""
    return sizes.cumsum(1)[:, -1] / sizes.shape[1]


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
        """(S, B, N) to metres (B, N)."""
        law = (logarithms * self.weight.T[:, None]).sum(0) + self.bias
        return in_whole_registers(torch.exp, law.clamp_max(math.log(LARGEST_SIGN)))

    @torch.no_grad()
    def fit(self, logarithms: Tensor, errors: Tensor) -> None:
        """Set the law by measured errors (B, N) in metres, so that its mean is theirs.

        It is the likeliest one if errors are distributed exponentially, so their largest values do not lead it.
        """
        signs = logarithms.movedim(0, -1)
        middle = signs.mean(0)
        spread = signs.std(0).clamp_min(1e-3)
        weight, bias = _likeliest_law(((signs - middle) / spread).double(), errors)
        self.weight.copy_(weight / spread)
        self.bias.copy_(bias - (weight * middle / spread).sum(-1))


@torch.enable_grad()
def _likeliest_law(signs: Tensor, errors: Tensor) -> tuple[Tensor, Tensor]:
    """The weights (N, S) and the bias (N,) by which normalised signs (B, N, S) explain errors (B, N) best."""
    # weights and bias in one tensor; the bias begins at the mean error
    law = torch.zeros(signs.shape[1], signs.shape[2] + 1, dtype=torch.float64, requires_grad=True)
    law.data[:, -1] = errors.double().mean(0).log()
    descent = torch.optim.LBFGS([law], max_iter=200, line_search_fn="strong_wolfe")

    def loss() -> Tensor:
        descent.zero_grad()
        # errors are exponentially distributed about exp(log)
        log = (signs * law[:, :-1]).sum(-1) + law[:, -1]
        lost = (log + errors * torch.exp(-log)).mean() + 1e-2 * law[:, :-1].square().mean()
        lost.backward()  # type: ignore[no-untyped-call]
        return lost

    descent.step(loss)  # type: ignore[no-untyped-call]
    fitted = law.detach()
    return fitted[:, :-1], fitted[:, -1]


class Member(nn.Module):
    """An MLP from D numbers to W weights for each number of P points."""

    def __init__(self, seen: int, numbers: int, config: FigurePredictorConfig) -> None:
        super().__init__()
        self.inward = nn.Linear(seen, config.hidden)
        self.blocks = nn.Sequential(*(Block(config.hidden, config.dropout) for _ in range(config.blocks)))
        self.outward = zero_linear(config.hidden, config.waves * numbers)

    def forward(self, seen: Tensor, points: VectorPoints | None = None) -> Tensor:
        """(B, D) to (B, W P 3). points: give weights of vectors between points and their parents.

        The difference is made of the layer: between points metres apart it would magnify their last bits.
        """
        layer = [self.outward.weight, self.outward.bias]
        if points is not None:
            shape = (-1, len(points.tree.parents), 3)
            layer = [points.from_parents(torch.unflatten(x, 0, shape), dim=1).flatten(0, 2) for x in layer]
        return functional.linear(self.blocks(self.inward(seen)), *layer)


class FigurePredictor(Net):
    """Seed frames (B, L, C) to the next frames (B, N, C), both in the contract's units.

    cosines: (N, W), what steps are made of. doubt: the error head.
    """

    CONFIG = FigurePredictorConfig
    cosines: Tensor
    doubt: ErrorHead | None

    def __init__(self, config: FigurePredictorConfig) -> None:
        super().__init__(config.channels)
        self.config = config
        self.points = VectorPoints(config.figure)
        numbers = 3 * len(self.points.tree.parents)
        seen = numbers * config.seed_frames
        self.members = nn.ModuleList(Member(seen, numbers, config) for _ in range(config.members))
        self.doubt = ErrorHead(config.frames) if config.doubts else None

        # steps grow with time, so that those of early frames are small
        time = torch.arange(config.frames)[:, None]
        waves = torch.cos(math.pi / config.frames * (time + 0.5) * torch.arange(config.waves))
        constants(self, cosines=waves * (time + 1) * (3 / config.frames / PLACE_SCALE))

    def seen(self, frames: Tensor) -> Tensor:
        """Frames (B, L or more, C) as points (B, L or more, P, 3), seen from the last seed frame."""
        seen: Tensor = self.points(frames.clamp(-LARGEST_INPUT, LARGEST_INPUT), self.config.seed_frames - 1)
        return seen

    def weights(self, seen: Tensor, points: VectorPoints | None = None) -> Tensor:
        """Points (B, L, P, 3) to weights (M, B, W, P 3) of the cosines that steps are made of, by each of M members.

        points: give those of vectors between points and their parents.
        """
        inputs = torch.cat([PLACE_SCALE * seen[:, -1].flatten(1), STEP_SCALE * seen.diff(dim=1).flatten(1)], dim=1)
        weights = torch.stack([member(inputs, points) for member in self.members])
        return torch.unflatten(weights, 2, (self.config.waves, -1))

    def steps(self, weights: Tensor) -> Tensor:
        """Weights (..., W, P 3) to steps (..., N, P, 3) from the last seed frame."""
        return torch.unflatten(self.cosines @ weights, -1, (-1, 3))

    def with_disagreement(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, L, C) to the next (B, N, C), and how far (B, N) their mirror image disagrees about them: the root
        mean square of differences between vectors, in metres."""
        seen = self.seen(frames)
        # rows and their mirror images in one batch, side by side
        both = torch.stack([seen, self.points.mirror(seen)], dim=1).flatten(0, 1)
        steps = torch.unflatten(self.steps(self.weights(both, self.points).mean(0)), 0, (-1, 2))
        plain = steps[:, 0]
        mirrored = self.points.mirror(steps[:, 1])
        return self._frames_after(frames, seen, (plain + mirrored) / 2), size((plain - mirrored) / 2)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C): by the mean for them and for their mirror image, where sides are
        known."""
        if self.config.figure.partners:
            return self.with_disagreement(frames)[0]
        seen = self.seen(frames)
        return self._frames_after(frames, seen, self.steps(self.weights(seen, self.points).mean(0)))

    def _frames_after(self, frames: Tensor, seen: Tensor, steps: Tensor) -> Tensor:
        """The frames (B, N, C) to which steps (B, N, P, 3) of vectors lead from frames (B, L, C) and their points."""
        last = self.points.from_parents(seen[:, -1:])
        return self.points.frames(torch.cat([last, last + steps], dim=1), frames[:, -1:])

    def error_signs(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """The signs (S, B, N) of an error, from frames (B, L, C) and what :meth:`with_disagreement` gives for them."""
        points = self.seen(torch.cat([frames, trajectory], dim=1))
        past = points[:, : self.config.seed_frames]
        return error_signs(past.diff(dim=1), points[:, self.config.seed_frames :] - past[:, -1:], disagreement)

    def expected_error(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """The expected error (B, N) in metres, from frames (B, L, C) and what :meth:`with_disagreement` gives."""
        assert self.doubt is not None
        expected: Tensor = self.doubt(self.error_signs(frames, trajectory, disagreement))
        return expected

    def graphs(self) -> Graphs:
        """The encoder, the step and, where the net knows its errors, those: each with its contract."""
        channels = self.config.channels
        count = self.config.frames
        frames = float_rows("frames", self.config.seed_frames, channels)
        coming = float_rows("trajectory", count, channels)
        step = step_graph(coming)
        if self.doubt is None:
            return {"encoder": (self, GraphSpec((frames,), (coming,))), "step": step}
        apart, error = (float_rows(name, count) for name in ("disagreement", "error"))
        return {
            "encoder": (Part(self, self.with_disagreement), GraphSpec((frames,), (coming, apart))),
            "step": step,
            "error": (Part(self, self.expected_error), GraphSpec((frames, coming, apart), (error,))),
        }
