"""The result of generate's loops: a sequence of frames and its likelihood."""

from typing import Any, NamedTuple

from numpy.typing import NDArray


class Sample(NamedTuple):
    """A finished sequence: its frames (T, D), which loops give normalised, and the sum of its steps' log-likelihoods.

    None where a loop has no likelihoods.
    """

    frames: NDArray[Any]
    log_likelihood: float | None
