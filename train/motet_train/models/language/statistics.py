"""What a motion looks like as a whole: statistics of its frames, of any number.

Letters in shapes: B rows, T frames, C numbers of a frame, J joints.
"""

import torch
from torch import Tensor

from motet_train.data.batch import before

SMALLEST = 1e-3
"""Of deviations and speeds: the root of less would make much of rounding."""

PARTS = 3
"""A motion is also seen in so many parts, one after the other: sitting down is not standing up."""


def of_frames(x: Tensor, lengths: Tensor) -> Tensor:
    """Frames (B, T, C) of lengths (B,) to mean, deviation, least and greatest, and the means of parts: (B, 7 C)."""
    active, count = before(lengths, x.shape[1])[..., None], lengths[:, None]
    mean = torch.where(active, x, 0.0).sum(dim=1) / count
    square = torch.where(active, (x - mean[:, None]).square(), 0.0).sum(dim=1) / count
    least, most = torch.where(active, x, torch.inf).amin(dim=1), torch.where(active, x, -torch.inf).amax(dim=1)
    part = PARTS * torch.arange(x.shape[1], device=x.device) // count
    parts = [_mean_where(x, mean, part == number) for number in range(PARTS)]
    return torch.cat([mean, (square + SMALLEST**2).sqrt(), least, most, *parts], dim=1)


def of_speeds(places: Tensor, lengths: Tensor) -> Tensor:
    """Places (B, T, 3 J) of joints to roots of their mean and greatest speeds (B, 2 J), per frame."""
    steps = torch.diff(places, dim=1, prepend=places[:, :1]).reshape(*places.shape[:2], -1, 3)
    speed = torch.where(
        before(lengths, places.shape[1])[..., None], (steps.square().sum(dim=-1) + SMALLEST**2).sqrt(), 0.0
    )
    return torch.cat([speed.sum(dim=1) / lengths[:, None], speed.amax(dim=1)], dim=1).sqrt()


def _mean_where(x: Tensor, otherwise: Tensor, chosen: Tensor) -> Tensor:
    """The mean (B, C) of the chosen (B, T) of x (B, T, C); where there are none, the other mean (B, C)."""
    count = chosen.sum(dim=1)[:, None]
    total = torch.where(chosen[..., None], x, 0.0).sum(dim=1)
    return torch.where(count > 0, total / count.clamp(min=1), otherwise)
