"""Floors: predictions that nobody had to train, which every predictor has to beat.

The last pose held; its last step repeated (constant velocity); and repeated ever smaller (damped velocity). All three
are one: after k frames the last step has been gone ``d + d^2 + ... + d^k`` times, with a decay d of 0, of 1, and, for
each k, of what is best on training data. Letters in shapes: W windows, N predicted frames.
"""

from collections.abc import Sequence

import numpy as np

from motet.motion.rotations import Array, inverse, product, rotmat_to_rotvec, rotvec_to_rotmat

ZERO, CONSTANT, DAMPED = "zero velocity", "constant velocity", "damped velocity"
OF_JOINTS = " of joints"
"""What follows the name of a floor whose velocities are those of joints' positions, not of rotations and the root."""

FLOORS = (ZERO, CONSTANT, DAMPED, CONSTANT + OF_JOINTS, DAMPED + OF_JOINTS)

DECAYS = np.linspace(0.0, 1.0, 21)
"""Those that are tried."""


def key(floor: str) -> str:
    """The name of a floor as JSON has it."""
    return floor.replace(" ", "_")


def reach(decays: Array | float, frames: int) -> Array:
    """How many times the last step has been gone after each frame (N,); decays: one, or one for each frame (N,)."""
    powers = np.broadcast_to(decays, frames)[:, None] ** np.arange(1.0, frames + 1)
    gone: Array = np.cumsum(powers, axis=1).diagonal()
    return gone


def gone_on(last_two: Array, steps: Array) -> Array:
    """The last two vectors (W, 2, ...) to those (W, N, ...) that go on by ``steps`` (N,) times the last step."""
    step = last_two[:, 1] - last_two[:, 0]
    shape = (-1, *[1] * (step.ndim - 1))
    found: Array = last_two[:, 1, None] + step[:, None] * steps.reshape(shape)
    return found


def turned_on(last_two: Array, steps: Array) -> Array:
    """Rotations (W, 2, J, 3, 3) to those (W, N, J, 3, 3) that turn on by ``steps`` (N,) times the last turn, about its
    axis."""
    step = rotmat_to_rotvec(product(last_two[:, 1], inverse(last_two[:, 0])))
    turns = rotvec_to_rotmat(step[:, None] * steps[:, None, None])
    return product(turns, np.broadcast_to(last_two[:, 1, None], turns.shape))


def best(errors: Sequence[Array]) -> Array:
    """The decay (N,) with the smallest error at each frame; errors (N,) are those of each of :data:`DECAYS`."""
    found: Array = DECAYS[np.argmin(errors, axis=0)]
    return found
