"""The optimiser Muon (Jordan et al. 2024) in float32, and its combination with AdamW."""

import math
from collections.abc import Iterable
from itertools import chain
from typing import Any

import torch
from torch import Tensor

from motet.bundle.fields import Json

Groups = list[dict[str, Any]]
"""Parameter groups as in torch's optimisers: settings by name, and "params"."""

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""Coefficients of Jordan's polynomial a x + b x^3 + c x^5; five iterations bring values from 0.001 to 1 close to 1."""

MOMENTUM = 0.95


class Muon:
    """Muon for parameter groups marked "muon", with steps as large as AdamW's, and AdamW for the others.

    Muon's steps are orthogonal matrices: every direction of a matrix, also a rare one, is learned at the same rate.
    """

    def __init__(self, groups: Iterable[Json], lr: float) -> None:
        matrices: Groups = []
        others: Groups = []
        for group in groups:
            part = matrices if "muon" in group else others
            part.append(dict(group))
        self.parts: list[torch.optim.Optimizer] = []
        if matrices:
            self.parts.append(Orthogonal(matrices, lr))
        if others:
            self.parts.append(torch.optim.AdamW(others, lr=lr, betas=(0.9, 0.98)))

    @property
    def param_groups(self) -> Groups:
        """The parameter groups of both, as in torch's optimisers."""
        return list(chain.from_iterable(part.param_groups for part in self.parts))

    def step(self) -> None:
        """One step of both."""
        for part in self.parts:
            part.step()

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Forget the gradients of both."""
        for part in self.parts:
            part.zero_grad(set_to_none=set_to_none)

    def state_dict(self) -> Json:
        """The states of both."""
        return {"parts": [part.state_dict() for part in self.parts]}

    def load_state_dict(self, state_dict: Json, /) -> None:
        """Restore a state from :meth:`state_dict`."""
        for part, state in zip(self.parts, state_dict["parts"], strict=True):
            part.load_state_dict(state)


class Orthogonal(torch.optim.Optimizer):
    """Muon for matrices: ``torch.optim.Muon`` with ``adjust_lr_fn="match_rms_adamw"``, but all in float32.

    torch's Muon computes in bfloat16, which takes ten times as long on processors without it, and gives other results
    on those with it.
    """

    def __init__(self, groups: Groups, lr: float) -> None:
        super().__init__(groups, {"lr": lr, "weight_decay": 0.0})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """Move each matrix by the orthogonalised running mean of its gradient, with Nesterov momentum."""
        for group in self.param_groups:
            rate = group["lr"]
            for matrix in group["params"]:
                if matrix.grad is None:
                    continue
                # running mean of the gradient
                mean = self.state[matrix].setdefault("momentum_buffer", torch.zeros_like(matrix.grad))
                mean.lerp_(matrix.grad, 1 - MOMENTUM)
                # weight decay, apart from the gradient
                matrix.mul_(1 - rate * group["weight_decay"])
                # a step of the root mean square that AdamW's steps have
                direction = orthogonal(matrix.grad.lerp(mean, MOMENTUM))
                matrix.add_(direction, alpha=-0.2 * rate * math.sqrt(max(matrix.shape)))


def orthogonal(matrix: Tensor) -> Tensor:
    """A matrix (N, M) with all its singular values brought close to 1, by five Newton-Schulz iterations."""
    a, b, c = NEWTON_SCHULZ
    # the smaller Gram matrix is cheaper
    wide = matrix.shape[0] <= matrix.shape[1]
    x: Tensor = matrix if wide else matrix.T
    # singular values of at most 1
    x = x / x.norm().clamp(min=1e-7)
    for _ in range(5):
        gram = x @ x.T
        x = a * x + (b * gram + c * gram @ gram) @ x
    return x if wide else x.T
