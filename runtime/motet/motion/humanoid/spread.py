"""Sharing out turns between joints: of backs and necks of different numbers of joints, of forearms and wrists."""

import numpy as np

from motet.motion.products import inverse, product
from motet.motion.rotations import Array, angle_of, rotmat_to_quat, rotmat_to_rotvec, rotvec_to_rotmat


def spread(chain: Array, count: int) -> Array:
    """World rotations (T, count, 3, 3) of another chain with the same ends, from those of a chain (T, N + 1, 3, 3).

    The first rotation is that of the joint that carries the chain and is not among the result; the last of both
    chains is the same. Between joints rotations go the shortest way, by how far up the chain they are.
    """
    last = chain.shape[1] - 1
    places = np.arange(1, count + 1) * last / count
    below = np.ceil(places).astype(int) - 1
    part = places - below
    shared: Array = chain[:, below + 1]
    inner = np.flatnonzero(part < 1)
    if len(inner):
        lower = chain[:, below[inner]]
        turn = rotmat_to_rotvec(product(inverse(lower), shared[:, inner]))
        shared[:, inner] = product(lower, rotvec_to_rotmat(turn * part[inner, None]))
    return shared


def twist(rotations: Array, axis: Array) -> Array:
    """The part (T, 3, 3) of rotations (T, 3, 3) that is a turn about an axis (3): what is left of them is a swing."""
    length = float(np.linalg.norm(axis))
    if length == 0.0:
        return np.broadcast_to(np.eye(3), rotations.shape)
    quats, along = rotmat_to_quat(rotations), axis / length
    angles = 2 * angle_of(quats[..., :3] @ along, quats[..., 3])
    return rotvec_to_rotmat(angles[..., None] * along)
