from dataclasses import replace

import numpy as np
import pytest
from figures import walker

import motet
from motet.errors import MotionError
from motet.formats import read_motion, write_motion
from motet.motion import mirroring
from motet.motion.kinematics import positions, with_channels
from motet.motion.mirroring import lateral_axis, mirror
from motet.motion.motion import Motion
from motet.motion.skeleton import Joint, Skeleton, partners_of


def line_of(*names):
    return Skeleton(tuple(Joint(name, i - 1, (0.0, 1.0, 0.0)) for i, name in enumerate(names)))


def mirrored_places(motion, axis=0):
    signs = np.ones(3)
    signs[axis] = -1
    return positions(motion)[:, list(partners_of(motion.skeleton.names))] * signs


def symmetric(order, axis_angles, values, root_angles=(0.0, 0.0, 0.0)):
    """A made-up skeleton, symmetric across x = 0, with six channels at the root and two limbs of two joints."""
    x, y, z = axis_angles
    joints = (
        Joint("root", -1, (0.0, 0.0, 0.0), order, root_angles),
        Joint("larm", 0, (1.0, 2.0, 0.5), order, (x, y, z)),
        Joint("rarm", 0, (-1.0, 2.0, 0.5), order, (x, -y, -z)),
        Joint("lhand", 1, (2.0, 0.3, 0.1), "xzy"),
        Joint("rhand", 2, (-2.0, 0.3, 0.1), "xzy"),
        Joint("lhand_end", 3, (1.0, 0.0, 0.0)),
        Joint("rhand_end", 4, (-1.0, 0.0, 0.0)),
    )
    channels = [f"root.t{a}" for a in "xyz"]
    channels += [f"{joint}.r{a}" for joint in ("root", "larm", "rarm") for a in "xyz"]
    channels += ["lhand.rx", "lhand.ry", "rhand.rx", "rhand.ry"]
    units = ["length"] * 3 + ["deg"] * 13
    return Motion(values, tuple(channels), tuple(units), 30, Skeleton(joints))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"])
def test_positions_are_mirrored_and_twice_is_nothing(order, seed):
    rng = np.random.default_rng(seed)
    motion = symmetric(order, tuple(rng.uniform(-180, 180, 3)), rng.uniform(-180, 180, (5, 16)))
    result = mirror(motion)
    assert result.channels == motion.channels
    np.testing.assert_allclose(positions(result), mirrored_places(motion), atol=1e-9)
    np.testing.assert_array_equal(mirror(result).values, motion.values)


@pytest.mark.parametrize("seed", range(10))
def test_axes_that_are_no_mirror_images_are_converted(seed):
    rng = np.random.default_rng(seed)
    axis = tuple(rng.uniform(-180, 180, 3))
    motion = symmetric("zyx", (10.0, 20.0, 30.0), rng.uniform(-180, 180, (5, 16)), axis)
    joints = list(motion.skeleton.joints)
    joints[2] = Joint("rarm", 0, joints[2].offset, "xyz", axis)
    motion = replace(motion, skeleton=Skeleton(tuple(joints)))
    result = mirror(motion)
    np.testing.assert_allclose(positions(result), mirrored_places(motion), atol=1e-8)
    np.testing.assert_allclose(positions(mirror(result)), positions(motion), atol=1e-8)


def test_a_channel_that_lacks_is_added():
    motion = walker()
    less = motion.select(tuple(name for name in motion.channels if name != "right_arm.rx"))
    result = mirror(less)
    assert result.channels == ("right_arm.rx", *less.channels)
    np.testing.assert_allclose(positions(result), mirrored_places(less), atol=1e-9)


def test_other_lateral_axes():
    motion = walker()
    turned = tuple(Joint(j.name, j.parent, (j.offset[2], j.offset[1], j.offset[0])) for j in motion.skeleton.joints)
    motion = replace(motion, skeleton=Skeleton(turned))
    assert lateral_axis(motion.skeleton) == 2
    np.testing.assert_allclose(positions(mirror(motion)), mirrored_places(motion, axis=2), atol=1e-9)


@pytest.mark.parametrize("name", ["02_06", "09_07", "39_14"])
def test_cmu_twice_is_nothing_and_once_is_near(clips, name):
    motion = read_motion(clips / f"{name}.amc")
    result = mirror(motion)
    np.testing.assert_array_equal(mirror(result).values, motion.values)
    # real bodies are not symmetric: limbs differ by a few per cent
    assert np.abs(positions(result) - mirrored_places(motion)).max() < 0.05 * motion.skeleton.height


def test_mirror_from_bvh(clips, tmp_path):
    motion = read_motion(clips / "39_14.amc")
    write_motion(tmp_path / "a.bvh", motion)
    from_bvh = mirror(read_motion(tmp_path / "a.bvh"))
    from_amc = mirror(motion)
    places = positions(from_bvh)[:, [from_bvh.skeleton.index(name) for name in motion.skeleton.names]]
    np.testing.assert_allclose(places, positions(from_amc), atol=1e-4)


def test_what_cannot_be_mirrored_is_refused():
    motion = walker(3)
    odd = with_channels(motion, ("hips.vx",), np.zeros((3, 1)), ("m/s",))
    with pytest.raises(MotionError, match=r"not hips\.vx"):
        mirror(odd)
    with pytest.raises(MotionError, match="no left-right pairs of joints"):
        mirror(Motion(np.zeros((1, 1)), ("root.rx",), ("deg",), 30, line_of("root", "spine")))
    with pytest.raises(MotionError, match="not mirror images"):
        mirror(Motion(np.zeros((1, 1)), ("root.rx",), ("deg",), 30, line_of("root", "lleg", "rleg")))


def test_the_function_does_not_hide_a_module():
    assert motet.motion.mirror is mirroring.mirror
    assert not callable(motet.motion.mirroring)
