"""Poses in few numbers: codes, of which quaternions and the hips' height are a linear map.

Letters in shapes: B poses, J bones, K codes, P = 4 J + 1 numbers of a pose.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from motet.bundle.graph import Floats
from motet.motion.rotations import Array


@dataclass(frozen=True, eq=False)
class PoseCodes:
    """The map: mean (P,), the pose whose codes are 0, and basis (K, P), what each code adds to it; float64."""

    mean: Array
    basis: Array

    def decode(self, codes: Array) -> tuple[Floats, Floats]:
        """Codes (B, K) to unit quaternions (B, J, 4) and the hips' height (B,) in metres, both float32."""
        # one row at a time: how a product rounds depends on how many rows it has
        values = self.mean + np.matmul(codes[:, None], self.basis)[:, 0]
        quats = values[:, :-1].reshape(len(values), -1, 4)
        quats /= np.sqrt(np.maximum((quats * quats).sum(axis=2, keepdims=True), 1e-12))
        return quats.astype(np.float32), values[:, -1].astype(np.float32)

    def encode(self, rotations: Floats, height: Floats) -> Array:
        """The codes (B, K) whose poses are nearest to quaternions (B, J, 4) and heights (B,)."""
        mean = self.mean[:-1].reshape(-1, 4)
        nearer = np.where((rotations * mean).sum(axis=2, keepdims=True) < 0, -rotations, rotations)
        values = np.concatenate([nearer.reshape(len(nearer), -1), height[:, None]], axis=1)
        found: Array = np.matmul((values - self.mean)[:, None], self._inverse)[:, 0]
        return found

    @cached_property
    def _inverse(self) -> Array:
        return np.linalg.pinv(self.basis).astype(np.float64)
