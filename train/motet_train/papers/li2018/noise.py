"""Noise on the frames that a net is taught with, so that it learns to return from its own errors.

The std grows step by step, for all three nets that are compared in Jain et al. 2016, section 4.1: ERD, LSTM-3LR, S-RNN.
"""

import torch
from torch import Tensor

ITERATIONS = 4000
"""What the schedule's iterations are shares of, so that the last fifth of a training has the greatest noise.

The paper does not say how long its training was.
"""

SCHEDULE = ((250, 0.01), (500, 0.05), (1000, 0.1), (1300, 0.2), (2000, 0.3), (2500, 0.5), (3300, 0.7))
"""(iteration from which it holds, std in normalised units): the settings that the authors published with their code."""

NOISED = 0.5
"""Share of the frames that get noise, as in the authors' code; the paper does not say."""


def noise_at(share: float) -> float:
    """The std at this share of the training, 0 to 1: none at first, then what the schedule says."""
    return next((std for iteration, std in reversed(SCHEDULE) if share * ITERATIONS >= iteration), 0.0)


def noisy(frames: Tensor, std: float) -> Tensor:
    """Frames (..., D), half of them, drawn afresh at each call, with Gaussian noise; as they are where ``std`` is 0."""
    if std == 0:
        return frames
    chosen = torch.rand_like(frames[..., :1]) < NOISED
    return frames + std * chosen * torch.randn_like(frames)
