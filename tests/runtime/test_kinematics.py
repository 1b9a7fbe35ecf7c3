import math

import numpy as np
import pytest
from figures import walker

from motet.errors import MotionError
from motet.formats import read_motion
from motet.motion.kinematics import euler_of, local_rotations, positions, with_channels
from motet.motion.motion import Motion

pytestmark = pytest.mark.numeric


def turn(axis, degrees):
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return {
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
        "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis]


def times(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) for j in range(3)] for i in range(3)]


def transposed(a):
    return [[a[j][i] for j in range(3)] for i in range(3)]


def naive_positions(motion, frame):
    """Joint by joint and number by number, as the definition reads."""
    value = dict(zip(motion.channels, motion.values[frame], strict=True))
    rotations, places = [], []
    for joint in motion.skeleton.joints:
        x, y, z = joint.axis
        c = times(times(turn("z", z), turn("y", y)), turn("x", x))
        m = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        for axis in joint.order:
            m = times(m, turn(axis, value.get(f"{joint.name}.r{axis}", 0.0)))
        local = times(times(c, m), transposed(c))
        offset = [value.get(f"{joint.name}.t{axis}", joint.offset[n]) for n, axis in enumerate("xyz")]
        if joint.parent == -1:
            rotations.append(local)
            places.append(offset)
        else:
            up, base = rotations[joint.parent], places[joint.parent]
            rotations.append(times(up, local))
            places.append([base[i] + sum(up[i][k] * offset[k] for k in range(3)) for i in range(3)])
    return places


@pytest.mark.parametrize("name", ["made up", "39_14.amc", "02_06.amc"])
def test_positions_are_what_the_definition_says(name, clips):
    motion = walker() if name == "made up" else read_motion(clips / name)
    fast = positions(motion)
    for frame in (0, len(motion) // 2, len(motion) - 1):
        np.testing.assert_allclose(fast[frame], naive_positions(motion, frame), atol=1e-10)


def test_units_do_not_matter():
    motion = walker(metres_per_unit=0.3)
    units = tuple({"deg": "rad", "length": "m"}[unit] for unit in motion.units)
    np.testing.assert_allclose(positions(motion.select(motion.channels, units)), positions(motion), atol=1e-12)


def test_a_position_takes_the_place_of_the_offset():
    motion = walker()
    moved = with_channels(motion, ("left_leg.ty",), np.full((len(motion), 1), -2.0), ("length",))
    leg = motion.skeleton.index("left_leg")
    distance = np.linalg.norm(positions(moved)[:, leg] - positions(moved)[:, 0], axis=-1)
    np.testing.assert_allclose(distance, math.hypot(0.1, 2.0))


def test_euler_of_undoes_local_rotations():
    motion = walker()
    rotations = local_rotations(motion)
    for i, joint in enumerate(motion.skeleton.joints):
        angles = euler_of(rotations[:, i], joint)
        names = tuple(f"{joint.name}.r{axis}" for axis in "xyz")
        one = Motion(angles, names, ("rad",) * 3, 30, motion.skeleton)
        np.testing.assert_allclose(local_rotations(one)[:, i], rotations[:, i], atol=1e-9)


def test_with_channels_replaces_or_adds_in_front():
    motion = walker(frames=2)
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    result = with_channels(motion, ("hips.ty", "head.tx"), values, ("length", "length"))
    assert result.channels == ("head.tx", *motion.channels)
    np.testing.assert_array_equal(result.select(("hips.ty", "head.tx")).values, values)
    np.testing.assert_array_equal(result.select(("hips.tx",)).values, motion.select(("hips.tx",)).values)


def test_no_skeleton_no_positions():
    with pytest.raises(MotionError, match="no skeleton"):
        positions(Motion(np.zeros((1, 1)), ("a.rx",), ("deg",), 30))
