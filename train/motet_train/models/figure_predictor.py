"""A predictor of figures: where the joints were, to how the figure moves on.

It sees the places of the joints in all seed frames, from above the last frame's ground and in its facing, and the last
frames' channels. A residual MLP on that gives all predicted frames at once: for each channel a step from the last
frame, and for the root's path where it is and faces. A linear map of each channel's own past is added, which sets the
first frames. The answer is the mean of that for the seed and of that for its mirror image.

Letters in shapes: B rows, L seed frames, C channels of the contract, D numbers that the MLP sees, J joints, N predicted
frames, H hidden units, S signs of errors.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn
from torch.nn import functional

from motet.bundle.graph import GraphSpec
from motet_train.models.kinematics import VectorFigure, VectorPlaces
from motet_train.models.net import Graphs, Part, float_rows, gelu, normalised, zero_linear
from motet_train.models.predictor import Block, MirroredPredictor, step_graph

ERROR_FLOOR = 1e-3
"""Added to a sign of an error before its logarithm, in units of usual first steps."""

VELOCITIES = 3
"""The first channels: how far the root goes forward and to the left, and how far it turns, a second."""

RECENT = 3
"""Last seed frames whose channels are seen, besides the places of all."""

LARGEST_STEP = 4.0
"""A step between seed frames counts for the linear maps up to so many times a usual one."""

LARGEST_INPUT = 100.0
"""Numbers of frames further from 0, in metres, radians, and these a second, are no motion, and count as this."""


@dataclass(frozen=True)
class FigurePredictorConfig:
    """The figure, and sizes of the net. figure: see :class:`motet_train.models.kinematics.VectorFigure`.

    channels: C, those of the root block first. mirrored, signs: channel c of a mirrored frame is channel
    ``mirrored[c]`` times ``signs[c]``; empty where left and right are not known. doubts: whether the net has an
    :class:`ErrorHead`, which needs the mirror image.
    """

    channels: int
    figure: VectorFigure = field(default_factory=VectorFigure)
    mirrored: tuple[int, ...] = ()
    signs: tuple[float, ...] = ()
    seed_frames: int = 10
    frames: int = 25
    hidden: int = 512
    blocks: int = 3
    dropout: float = 0.3
    unseen: float = 0.1
    doubts: bool = False

    @property
    def seen(self) -> int:
        """D: places of joints, channels of the last frame, and how these changed last."""
        places = 3 * len(self.figure.parents) * self.seed_frames
        return places + self.channels + (RECENT - 1) * (self.channels - VELOCITIES)


def possible(frames: Tensor) -> Tensor:
    """Frames (..., C) with each number within what a motion can have."""
    return frames.clamp(-LARGEST_INPUT, LARGEST_INPUT)


def error_signs(past: Tensor, steps: Tensor, disagreement: Tensor) -> Tensor:
    """Logarithms (B, N, S) of what an error is judged by: how fast and how unevenly the figure moves, how far the net
    takes it and on what way, and how much its answers so far differ from those to the mirrored question.

    All in units of the first predicted frame's usual steps. past: (B, L - 1, C), the steps between seed frames. steps:
    (B, N, C) predicted, from the last frame. disagreement: (B, N), how far the steps are from those predicted for the
    mirrored seed and mirrored back.
    """
    # how the figure moves before, and how it is predicted to
    shared = [size(past[:, -1]), size(past).mean(1), size(past.diff(dim=1)[:, -2:]).mean(1)]
    way = size(steps.diff(dim=1, prepend=torch.zeros_like(steps[:, :1]))).cumsum(1)
    by_frame = [size(steps), disagreement.cumsum(1), way]
    at_all_frames = [sign[:, None].expand(disagreement.shape) for sign in shared]
    return torch.log(torch.stack([*at_all_frames, *by_frame], dim=-1) + ERROR_FLOOR)


def size(values: Tensor) -> Tensor:
    """The root mean square (...) over the channels of (..., C)."""
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


class FigurePredictor(MirroredPredictor):
    """Seed frames (B, L, C) to the next frames (B, N, C), both in the contract's units.

    mean, scale: (D,) of what is seen. reach: (N, C), how large true steps are. alone: (L - 1, C, N), the
    linear maps. doubt: the error head.
    """

    CONFIG = FigurePredictorConfig
    reach: Tensor
    doubt: ErrorHead | None

    def __init__(self, config: FigurePredictorConfig) -> None:
        super().__init__(config.channels, config.seen, config.mirrored, config.signs)
        self.config = config
        self.places = VectorPlaces(config.figure)
        self.register_buffer("reach", torch.ones(config.frames, config.channels))
        # the MLP, and the linear map of each channel alone
        self.unseen = nn.Dropout(config.unseen)
        self.inward = nn.Linear(config.seen, config.hidden)
        self.blocks = nn.Sequential(*(Block(config.hidden, config.dropout) for _ in range(config.blocks)))
        self.norm = nn.LayerNorm(config.hidden)
        self.outward = zero_linear(config.hidden, config.frames * config.channels)
        self.alone = nn.Parameter(torch.zeros(config.seed_frames - 1, config.channels, config.frames))
        self.doubt = ErrorHead(config.frames) if config.doubts else None

    def seen(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) as the numbers (B, D) that are seen of them."""
        frames = possible(frames)
        # where the joints are at the end, and how they came there
        places = self.places.from_last(frames).flatten(2)
        parts = [places[:, -1], places.diff(dim=1).flatten(1)]
        # turns about a bone's own axis move no joint: the channels tell them
        parts += [frames[:, -1], frames[:, -RECENT:, VELOCITIES:].diff(dim=1).flatten(1)]
        return torch.cat(parts, dim=1)

    def changes(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to changes (B, N, C), by themselves, without the mirror image: of the root forward, to the
        left and in its turn since the frame before, in metres and radians, and of all other channels since the last
        frame."""
        seen = normalised(self.seen(frames), self.mean, self.scale)
        hidden = gelu(self.norm(self.blocks(self.inward(self.unseen(seen)))))
        together = functional.linear(hidden, self._of_changes(self.outward.weight), self._of_changes(self.outward.bias))

        # each channel by its own past
        usual = self._past(possible(frames)).clamp(-LARGEST_STEP, LARGEST_STEP)
        alone = self._of_changes(self.alone.permute(2, 1, 0).flatten(0, 1))
        by_itself = torch.einsum("blc,ncl->bnc", usual, torch.unflatten(alone, 0, self.reach.shape))
        changes: Tensor = torch.unflatten(together, 1, self.reach.shape) + by_itself
        return changes

    def _of_changes(self, weight: Tensor) -> Tensor:
        """Weights (N C, ...) of steps from the last frame, in units of ``reach``, as those of changes.

        The difference is made here: between steps of a metre it would magnify their last bits.
        """
        by_step = torch.unflatten(weight, 0, self.reach.shape)
        by_step = by_step * self.reach.reshape(*self.reach.shape, *[1] * (by_step.dim() - 2))
        root = by_step[:, :VELOCITIES]
        root = torch.cat([root[:1], root.diff(dim=0)])
        return torch.cat([root, by_step[:, VELOCITIES:]], dim=1).flatten(0, 1)

    def _past(self, frames: Tensor) -> Tensor:
        """The steps (B, L - 1, C) between frames (B, L, C), in units of the first predicted frame's usual steps."""
        velocities = frames[:, 1:, :VELOCITIES] / self.config.figure.fps
        return torch.cat([velocities, frames[..., VELOCITIES:].diff(dim=1)], dim=-1) / self.reach[0]

    def steps_to(self, truth: Tensor, last: Tensor) -> Tensor:
        """The steps (B, N, C) from the last frames (B, 1, C) to frames (B, N, C): where the root is forward and to the
        left, in metres, and how far it has turned, in radians, in place of its velocities; and changes of the rest."""
        facing, path = self.places.path(truth)
        root = torch.stack([path[..., 2], path[..., 0], facing], dim=-1)
        return torch.cat([root, (truth - last)[..., VELOCITIES:]], dim=-1)

    def frames_after(self, last: Tensor, changes: Tensor) -> Tensor:
        """The frames (B, N, C) to which changes (B, N, C) lead from the last frames (B, 1, C)."""
        # the root moves as it faced in the frame before
        z, x, turn = changes[..., :VELOCITIES].unbind(-1)
        before = turn.cumsum(1) - turn
        sin = before.sin()
        cos = before.cos()
        velocities = torch.stack([x * sin + z * cos, x * cos - z * sin, turn], dim=-1) * self.config.figure.fps
        return torch.cat([velocities, (last + changes)[..., VELOCITIES:]], dim=-1)

    def plain(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C), by themselves: what is trained."""
        return self.frames_after(frames[:, -1:], self.changes(frames))

    def with_disagreement(self, frames: Tensor) -> tuple[Tensor, Tensor]:
        """Frames (B, L, C) to the next (B, N, C), and how far (B, N) their mirror image disagrees about them."""
        changes, mirrored = self.on_both_sides(self.changes, frames)
        apart = changes - mirrored
        apart = torch.cat([apart[..., :VELOCITIES].cumsum(1), apart[..., VELOCITIES:]], dim=-1)
        return self.frames_after(frames[:, -1:], (changes + mirrored) / 2), size(apart / 2 / self.reach)

    def forward(self, frames: Tensor) -> Tensor:
        """Frames (B, L, C) to the next (B, N, C): by the mean of the changes for them and for their mirror image."""
        return self.with_disagreement(frames)[0] if self.config.mirrored else self.plain(frames)

    def error_signs(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """The signs (B, N, S) of an error, from frames (B, L, C) and what :meth:`with_disagreement` gives for them."""
        seed = possible(frames)
        steps = self.steps_to(possible(trajectory), seed[:, -1:]) / self.reach[0]
        return error_signs(self._past(seed), steps, disagreement)

    def expected_error(self, frames: Tensor, trajectory: Tensor, disagreement: Tensor) -> Tensor:
        """What :meth:`error_signs` takes to the expected error (B, N) in metres."""
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
