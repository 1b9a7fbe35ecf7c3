"""The directions in which motions of different actions differ, and those of one action do not: linear discriminants
(Fisher 1936, Rao 1948).

Figures of another corpus lie elsewhere in all statistics alike. What varies among views of one motion, as disguised as
they are, and among recordings of one action, therefore counts little. Nothing is trained: two covariances decide.
"""

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from motet_train.data.batches import Views
from motet_train.models.joint_embedding import LIMIT, JointEmbedding
from motet_train.models.net import normalised


@torch.no_grad()
def discriminate(net: JointEmbedding, seen: Views) -> None:
    """Set a space's encoder of motions by views of some motions: vectors have the directions of their discriminants."""
    net.see_by(seen.seen)
    views = normalised(seen.seen, net.seen_mean, net.seen_scale, LIMIT)
    motions = views.mean(dim=2)
    flat = motions.flatten(0, 1)
    mean = flat.mean(dim=0)

    # what does not matter: differences between views of a motion, and twice as much between recordings of an action
    within = _covariance((views - motions[:, :, None]).flatten(0, 2))
    within += 2.0 * _covariance(_around(flat, seen.groups))
    # and the mean variance, as some hundred motions do not tell all covariances
    within += within.diagonal().mean() * torch.eye(len(within))

    # the directions in which motions differ most, relative to that
    whitened = torch.linalg.cholesky(torch.linalg.inv(within))
    weight = net.motion.weight.zero_()
    axes = torch.linalg.svd((flat - mean) @ whitened, full_matrices=False).Vh[: len(weight)]
    weight[: len(axes)] = axes @ whitened.T
    net.motion.bias.copy_(-weight @ mean)


def _covariance(rows: Tensor) -> Tensor:
    """Of rows (N, S) around 0: (S, S)."""
    return rows.T @ rows / max(1, len(rows))


def _around(rows: Tensor, group_table: NDArray[np.int64]) -> Tensor:
    """How far rows (N, S) are from the means of their groups, N numbers, of those that are not alone (N', S)."""
    groups = torch.from_numpy(np.unique(group_table.reshape(-1), return_inverse=True)[1])
    counts = groups.bincount()
    sums = torch.zeros(len(counts), rows.shape[1]).index_add(0, groups, rows)
    return (rows - (sums / counts[:, None])[groups])[counts[groups] > 1]
