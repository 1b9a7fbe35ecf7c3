"""The book of root moves: how a figure moves over the ground in the time of one code, as one of a few hundred moves.

A move is (forward, left) in metres and a turn in radians, seen from where the figure was. What a move leaves out is not
lost: the next one is chosen from where the moves so far have really led (error feedback), so errors do not add up.
"""

import numpy as np

from motet.decode.planar import REACH, seen_from
from motet.motion.rotations import Array


def fit_book(poses: list[Array], hop: int, size: int, seed: int) -> Array:
    """A book (size, 3) of the moves over ``hop`` frames of poses (T, 3): x, z, facing. Standing still is entry 0."""
    from sklearn.cluster import MiniBatchKMeans  # for this alone, so that other trainings do not load it

    moves = np.concatenate([seen_from(way[:-hop], way[hop:]) for way in poses if len(way) > hop])
    scaled = moves * (1, 1, REACH)
    found = MiniBatchKMeans(size - 1, random_state=seed, n_init=3, batch_size=4096).fit(scaled).cluster_centers_
    return np.concatenate([np.zeros((1, 3)), found / (1, 1, REACH)])
