"""The gaits of a manifest: which tables of speeds are refused."""

import numpy as np
import pytest

from motet.bundle.fields import Fields
from motet.errors import BundleError
from motet.steering.gaits import Gaits
from motet.steering.settings import SteeringSettings

SPEEDS = [[0.1, 1.3, 1.9, 1.2, 1.6], [1.0, 1.8, 2.5, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, 0.0]]
"""m/s: the slowest, the usual, the fastest forward, sideways and backwards of a walk, a sneak and a jump."""


def read(speeds: list[list[float]]) -> Gaits:
    return Gaits.read(Fields({"gaits": ["walk", "sneak", "jump"], "speeds": speeds}, "config"), SteeringSettings())


def test_speeds_that_rise_are_read() -> None:
    np.testing.assert_array_equal(read(SPEEDS).speeds, SPEEDS)


@pytest.mark.parametrize(("column", "speed"), [(0, 50.0), (0, 1.31), (1, 1.95), (2, 1.2)])
def test_speeds_that_do_not_rise_are_refused(column: int, speed: float) -> None:
    speeds = [row.copy() for row in SPEEDS]
    speeds[0][column] = speed
    with pytest.raises(BundleError, match=r"config\.speeds: must rise from the slowest to the usual and the fastest"):
        read(speeds)


@pytest.mark.parametrize(
    "speeds", [SPEEDS[:2], [[*row[:4], -1.0] for row in SPEEDS], [[*row[:4], 101.0] for row in SPEEDS]]
)
def test_speeds_out_of_range_are_refused(speeds: list[list[float]]) -> None:
    with pytest.raises(BundleError, match="a row of 5 speeds, 0 to 100 m/s, for each gait"):
        read(speeds)
