"""Muon for the matrices of a net, AdamW for all else, as one optimiser."""

from collections.abc import Iterable, Mapping
from itertools import chain
from typing import Any, Protocol

import torch


class Optimiser(Protocol):
    """What a step of gradient descent needs of torch's optimisers."""

    param_groups: list[dict[str, Any]]

    def step(self) -> object:
        """Change the weights by their gradients."""

    def zero_grad(self, set_to_none: bool = True) -> None:
        """Forget the gradients."""

    def state_dict(self) -> Any:
        """What it knows of the steps so far."""

    def load_state_dict(self, state_dict: Any, /) -> Any:
        """Take up what :meth:`state_dict` gave."""


class Muon:
    """Groups marked "muon" go by Muon (Jordan et al. 2024), with steps as large as AdamW's; all others by AdamW.

    Muon's steps are orthogonal matrices: each direction of a matrix is learned at the same rate, also the rare ones.
    """

    def __init__(self, groups: Iterable[Mapping[str, Any]], lr: float) -> None:
        given = [dict(group) for group in groups]
        matrices = [group for group in given if "muon" in group]
        others = [group for group in given if "muon" not in group]
        self.parts: list[torch.optim.Optimizer] = []
        if matrices:
            self.parts.append(torch.optim.Muon(matrices, lr=lr, adjust_lr_fn="match_rms_adamw"))
        if others:
            self.parts.append(torch.optim.AdamW(others, lr=lr, betas=(0.9, 0.98)))
        self.param_groups = list(chain.from_iterable(part.param_groups for part in self.parts))

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
        self.param_groups = list(chain.from_iterable(part.param_groups for part in self.parts))
