"""Critically damped springs against small steps of their equation."""

import numpy as np

from motet.motion.springs import damped, damped_path, damping_of


def test_a_spring_moves_as_its_equation_says() -> None:
    off, speed, damping = np.array([1.0, -2.0]), np.array([3.0, 0.5]), damping_of(0.2)
    steps = 100_000
    place, pace, path, dt = off.copy(), speed.copy(), np.zeros(2), 0.3 / steps
    for _ in range(steps):
        path = path + dt * place
        pace = pace + dt * (-(damping**2) * place - 2 * damping * pace)
        place = place + dt * pace
    found = damped(off, speed, damping, 0.3)
    np.testing.assert_allclose(found[0], place, atol=1e-4)
    np.testing.assert_allclose(found[1], pace, atol=1e-3)
    np.testing.assert_allclose(damped_path(off, speed, damping, 0.3), path, atol=1e-4)
    assert damped(off.astype(np.float32), speed.astype(np.float32), damping, 0.3)[0].dtype == np.float32
