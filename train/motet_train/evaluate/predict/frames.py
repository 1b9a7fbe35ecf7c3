"""Errors by predicted frame: at which frames they are reported, and under which names."""

from collections.abc import Mapping

import numpy as np

from motet.motion.rotations import Array

REPORTED = (1, 3, 7, 9, 13, 24)
"""Output frames of which errors are reported, from 0: those of the protocol of Martinez et al. 2017."""


def by_frame(errors: Array) -> dict[str, float]:
    """Errors (N,) at the reported frames, "frame_1" and so on."""
    return {f"frame_{frame}": float(errors[frame]) for frame in REPORTED}


def cells(figures: Mapping[str, float], digits: int) -> list[str]:
    """Figures by frame as text; nothing for a NaN."""
    return [f"{value:.{digits}f}" if np.isfinite(value) else "" for value in figures.values()]
