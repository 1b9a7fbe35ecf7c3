"""When something comes to be so, and stays so."""

import numpy as np
from numpy.typing import NDArray

from motet.motion.rotations import Array


def arrival(inside: NDArray[np.bool_], fps: float) -> Array:
    """Seconds (B,) until ``inside`` (T, B) holds until the end; infinite where it does not."""
    frames = len(inside) - np.cumprod(inside[::-1], axis=0).sum(axis=0)
    return np.where(frames < len(inside), (frames + 1) / fps, np.inf)
