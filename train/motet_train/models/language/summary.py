"""What a context tells of a whole motion: a loss that exists in training only, for both directions.

A decoder that sees every frame before the next one learns to follow the frames and to ignore the sentence: its
contexts then hold no action. This head asks the context itself for the mean and the deviation of each channel and for
the length of the motion, so that the encoder of a sentence has to tell walking from running, and left from right, and
the encoder of a motion has to keep what is only seen over the whole of it, such as a slow turn.

Letters in shapes: B rows, T frames, D channels, C units of the context.
"""

import torch
from torch import Tensor, nn

from motet_train.data.batch import before

LARGEST = 5.0
"""Normalised values are cut off here: a few wild frames would else outweigh the motion."""


class SummaryHead(nn.Module):
    """From contexts (B, C) to mean and deviation of D channels and the logarithm of the length, (B, 2 D + 1)."""

    def __init__(self, context: int, channels: int) -> None:
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(context, context), nn.Tanh(), nn.Linear(context, 2 * channels + 1))

    def loss(self, context: Tensor, normal: Tensor, lengths: Tensor) -> Tensor:
        """Mean squared error for contexts (B, C) of normalised frames (B, T, D) of the given lengths (B,)."""
        found: Tensor = self.layers(context)
        return (found - summary(normal, lengths)).square().mean()


def summary(normal: Tensor, lengths: Tensor) -> Tensor:
    """Mean, deviation and log-length (B, 2 D + 1) of normalised frames (B, T, D) of the given lengths (B,)."""
    real = before(lengths, normal.shape[1])[..., None]
    frames, count = torch.where(real, normal.clamp(-LARGEST, LARGEST), 0.0), lengths[:, None]
    mean = frames.sum(dim=1) / count
    square = torch.where(real, (frames - mean[:, None]).square(), 0.0).sum(dim=1) / count
    return torch.cat([mean, square.sqrt(), count.log()], dim=1)
