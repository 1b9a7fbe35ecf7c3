"""The optimiser Muon (Jordan et al. 2024) in float32, and what trains a net by it and AdamW."""

import math
from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any

import torch
from torch import Tensor

NEWTON_SCHULZ = (3.4445, -4.7750, 2.0315)
"""Jordan's polynomial a x + b x^3 + c x^5: five times over it brings singular values of 0.001 to 1 near 1."""

MOMENTUM = 0.95


class Muon:
    """Groups marked "muon" go by Muon, with steps as large as AdamW's; all others by AdamW.

    Muon's steps are orthogonal matrices: each direction of a matrix is learned at the same rate, also the rare ones.
    """

    def __init__(self, groups: Iterable[Mapping[str, Any]], lr: float) -> None:
        given = [dict(group) for group in groups]
        matrices = [group for group in given if "muon" in group]
        others = [group for group in given if "muon" not in group]
        self.parts: list[torch.optim.Optimizer] = []
        if matrices:
            self.parts.append(Orthogonal(matrices, lr))
        if others:
            self.parts.append(torch.optim.AdamW(others, lr=lr, betas=(0.9, 0.98)))

    @property
    def param_groups(self) -> list[dict[str, Any]]:
        """Those of both, as torch's optimisers have them."""
        return list(chain.from_iterable(part.param_groups for part in self.parts))

    def step(self) -> None:
        """One step of both."""
        for part in self.parts:
            part.step()

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Forget the gradients of both."""
        for part in self.parts:
            part.zero_grad(set_to_none=set_to_none)

    def state_dict(self) -> dict[str, Any]:
        """The states of both."""
        return {"parts": [part.state_dict() for part in self.parts]}

    def load_state_dict(self, state_dict: Mapping[str, Any], /) -> None:
        """Take up what :meth:`state_dict` gave."""
        for part, state in zip(self.parts, state_dict["parts"], strict=True):
            part.load_state_dict(state)


class Orthogonal(torch.optim.Optimizer):
    """Muon of matrices: ``torch.optim.Muon`` with ``adjust_lr_fn="match_rms_adamw"``, in float32 throughout.

    torch's own computes in bfloat16, which takes ten times as long on processors without it, and trains otherwise on
    one that has it.
    """

    def __init__(self, groups: list[dict[str, Any]], lr: float) -> None:
        super().__init__(groups, {"lr": lr, "weight_decay": 0.0})

    @torch.no_grad()
    def step(self, closure: None = None) -> None:  # type: ignore[override]
        """Move each matrix by the orthogonal matrix nearest to its gradient's running mean, one step ahead of it."""
        for group in self.param_groups:
            rate = group["lr"]
            for one in group["params"]:
                if one.grad is None:
                    continue
                mean = self.state[one].setdefault("momentum_buffer", torch.zeros_like(one.grad))
                mean.lerp_(one.grad, 1 - MOMENTUM)
                one.mul_(1 - rate * group["weight_decay"])
                turned = orthogonal(one.grad.lerp(mean, MOMENTUM))
                one.add_(turned, alpha=-0.2 * rate * math.sqrt(max(one.shape)))


def orthogonal(matrix: Tensor) -> Tensor:
    """A matrix (N, M) with all its singular values brought near 1, by five steps of Newton and Schulz."""
    a, b, c = NEWTON_SCHULZ
    wide = matrix.shape[0] <= matrix.shape[1]
    found: Tensor = matrix if wide else matrix.T
    found = found / found.norm().clamp(min=1e-7)
    for _ in range(5):
        gram = found @ found.T
        found = a * found + (b * gram + c * gram @ gram) @ found
    return found if wide else found.T
