"""Takes that show the same several times are cut where it begins again, and no others."""

import numpy as np
from language_data import SKELETON, TURNING

from motet.motion.motion import Motion
from motet.motion.rotations import Array
from motet.representation.contract import named
from motet_train.data.acts import acts

FPS = 30


def bends(times: Array, axis: str) -> Array:
    """Degrees (T, joints and axes) of a figure that tilts as a whole, to the front or aside, and back in five s."""
    found = np.zeros((len(times), 3 * len(TURNING)))
    found[:, "xyz".index(axis)] = 60 * np.sin(np.pi * times / 5) ** 2
    return found


def features(turns: Array, way: Array | float = 0.0) -> Motion:
    """A figure in ``root_sixd`` that turns its joints and goes a way (T,) in metres to the front."""
    root = np.zeros((len(turns), 3))
    root[:, 1], root[:, 2] = 0.93, way
    names = [f"hips.t{axis}" for axis in "xyz"] + [f"{joint}.r{axis}" for joint in TURNING for axis in "xyz"]
    units = ["length"] * 3 + ["deg"] * turns.shape[1]
    motion = Motion(np.column_stack([root, turns]), tuple(names), tuple(units), float(FPS), SKELETON)
    return named("root_sixd").features(motion)


def test_a_repeated_act_is_cut_at_whole_periods_and_the_rest_is_left_out() -> None:
    found = acts(features(bends(np.arange(22 * FPS) / FPS, "x")))
    assert [start for start, _ in found] == [0, *[stop for _, stop in found[:-1]]]
    np.testing.assert_allclose([stop for _, stop in found], [150, 300, 450, 600], atol=4)


def test_a_take_that_goes_on_to_something_else_stays_whole() -> None:
    time = np.arange(10 * FPS) / FPS
    turns = np.concatenate([bends(time, "x"), bends(time, "z")])
    assert acts(features(turns)) == [(0, 20 * FPS)]
    # a figure that never comes back to where its act began shows one
    assert acts(features(bends(np.arange(20 * FPS) / FPS / 8, "x"))) == [(0, 20 * FPS)]


def test_what_is_done_on_the_way_counts_and_where_it_is_done_does_not() -> None:
    time = np.arange(20 * FPS) / FPS
    turns = bends(time, "x")
    steady = acts(features(turns, 0.8 * time))
    np.testing.assert_allclose([stop for _, stop in steady][:3], [150, 300, 450], atol=4)
    # to stand at first and to go on the same way afterwards are two things
    assert acts(features(turns, 1.2 * np.maximum(time - 10, 0))) == [(0, 20 * FPS)]


def test_a_short_take_is_one_act() -> None:
    short = features(bends(np.arange(12 * FPS) / FPS, "x"))
    assert acts(short) == [(0, len(short))]
