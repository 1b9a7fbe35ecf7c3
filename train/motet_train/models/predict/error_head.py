"""How far off a prediction is likely to be: a log-linear law of a few signs, fitted to people never trained on.

A net's errors where it was trained say little of its errors elsewhere, so the law has few numbers, and is fitted to
the errors that a trained net makes on motions that were held out. The signs are how fast and how unevenly the figure
moves, how far the net takes it, and how much the net's answer differs from that to the mirrored question.

Letters in shapes: B rows, L seed frames, D channels, M of them that are predicted, N predicted frames, S signs.
"""

import torch
from torch import Tensor, nn

LEAST = 1e-3
"""What is added to a sign before its logarithm, in units of the channels' scales."""

RIDGE = 1e-2
"""The weight of the squared weights in the fit."""

SIGNS = 6


def signs(seed: Tensor, steps: Tensor, disagreement: Tensor) -> Tensor:
    """What an error is judged by (B, N, S), all in units of the channels' scales.

    seed: (B, L, M) frames. steps: (B, N, M) predicted, from the last frame. disagreement: (B, N), how far the steps are
    from those predicted for the mirrored seed and mirrored back.
    """
    velocity = seed.diff(dim=1)
    shared = [size(velocity[:, -1]), size(velocity).mean(1), size(velocity.diff(dim=1)[:, -2:]).mean(1)]
    own = [size(steps), disagreement, size(steps.diff(dim=1, prepend=torch.zeros_like(steps[:, :1])))]
    alike = [sign[:, None].expand(disagreement.shape) for sign in shared]
    return torch.log(torch.stack([*alike, *own], dim=-1) + LEAST)


def size(values: Tensor) -> Tensor:
    """The root mean square (...) over the channels of (..., M)."""
    return (values.square().mean(-1) + 1e-12).sqrt()


class ErrorHead(nn.Module):
    """Signs to the expected error in metres, the mean over the joints: for each predicted frame a law of its own."""

    weight: Tensor
    bias: Tensor

    def __init__(self, frames: int) -> None:
        super().__init__()
        self.register_buffer("weight", torch.zeros(frames, SIGNS))
        self.register_buffer("bias", torch.zeros(frames))

    def forward(self, logarithms: Tensor) -> Tensor:
        """(B, N, S) to metres (B, N)."""
        return torch.exp((logarithms * self.weight).sum(-1) + self.bias)

    @torch.no_grad()
    def fit(self, logarithms: Tensor, errors: Tensor) -> None:
        """Set the law by measured errors (B, N) in metres, so that its mean is theirs.

        It is the likeliest one if errors are distributed exponentially, whose logarithm depends on the signs: what
        makes the mean of a positive number right without being led by its largest values.
        """
        middle, spread = logarithms.mean(0), logarithms.std(0).clamp_min(1e-3)
        signs = ((logarithms - middle) / spread).double()
        law = torch.zeros(*self.weight.shape[:1], SIGNS + 1, dtype=torch.float64, requires_grad=True)
        law.data[:, -1] = errors.double().mean(0).log()
        descent = torch.optim.LBFGS([law], max_iter=200, line_search_fn="strong_wolfe")

        def loss() -> Tensor:
            descent.zero_grad()
            log = (signs * law[:, :-1]).sum(-1) + law[:, -1]
            lost = (log + errors * torch.exp(-log)).mean() + RIDGE * law[:, :-1].square().mean()
            lost.backward()  # type: ignore[no-untyped-call]
            return lost

        with torch.enable_grad():
            descent.step(loss)  # type: ignore[no-untyped-call]
        found = law.detach()
        self.weight.copy_(found[:, :-1] / spread)
        self.bias.copy_(found[:, -1] - (found[:, :-1] * middle / spread).sum(-1))
