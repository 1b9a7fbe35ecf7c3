"""Choosing among trained nets by what they do: the loss of contrastive divergence does not say how a figure moves."""

from collections.abc import Callable, Iterable
from copy import deepcopy

from torch import nn

MANY = 1000
"""More goals than there are."""


def audition(net: nn.Module, candidates: Iterable[None], missed: Callable[[int], list[str]]) -> tuple[int, list[str]]:
    """Leave in ``net`` the first candidate that misses no goal, else the one that misses the fewest.

    candidates: goes on whenever ``net`` has become another candidate.
    missed: the goals that ``net`` misses; it may stop counting at the number given, which is no improvement.
    Returns how many candidates were tried, and what the chosen one misses.
    """
    tried, weights = 0, net.state_dict()
    fewest: list[str] | None = None
    for _ in candidates:
        tried += 1
        found = missed(MANY if fewest is None else len(fewest))
        if fewest is None or len(found) < len(fewest):
            fewest, weights = found, deepcopy(net.state_dict())
        if not found:
            break
    net.load_state_dict(weights)
    return tried, fewest or []
