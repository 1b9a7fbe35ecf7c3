"""What all nets see of frames: standard deviations from the mean, within a limit, nothing of dead channels."""

import torch
from torch import Tensor

from motet.representation.contract import Z_LIMIT


def normalised(frames: Tensor, mean: Tensor, scale: Tensor, limit: float = Z_LIMIT) -> Tensor:
    """Frames (..., D) as z = (frames - mean) / scale within +-limit, and 0 where the scale (D,) is 0.

    As :meth:`motet.representation.contract.MotionContract.normalised`, and part of the graphs that are exported.
    """
    divisor = torch.where(scale > 0, scale, torch.inf)
    return ((frames - mean) / divisor).clamp(-limit, limit)
