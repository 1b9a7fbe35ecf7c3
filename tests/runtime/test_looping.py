from dataclasses import replace

import numpy as np
import pytest
from figures import walker
from test_retarget import SKELETONS

from motet.errors import MotionError
from motet.figures.humanoid.retarget import on_humanoid
from motet.formats import read_motion
from motet.motion import heading, looped, positions
from motet.motion.motion import Motion
from motet.motion.rotations import axis_to_rotmat
from motet.motion.skeleton import Joint, Skeleton

WALK, RUN, BEND = "39_14", "09_07", "02_06"


def turned_back(points, angles):
    """Points (T, J, 3) as they are seen from the first joint, without its heading (T,); heights stay."""
    seen = points - points[:, :1] * [1, 0, 1]
    return np.einsum("tij,tkj->tki", axis_to_rotmat("y", -angles), seen)


def repeated(loop):
    """Positions of the loop played twice, the second time from where the first one leads: what a game engine does.

    The pose after the last frame is the first one, a frame's way and turn farther on.
    """
    points, angles = positions(loop), heading(loop)
    way, turn = points[-1, 0] - points[-2, 0], angles[-1] - angles[-2]
    place = points[-1, 0] + axis_to_rotmat("y", np.array(turn)) @ way
    after = points - points[0, 0]
    moved = np.einsum("ij,tkj->tki", axis_to_rotmat("y", angles[-1] + turn - angles[0]), after) + place
    moved[..., 1] = points[..., 1]
    return np.concatenate([points, moved])


def steps(points):
    """How far each joint goes from each frame to the next (T - 1, J)."""
    return np.linalg.norm(np.diff(points, axis=0), axis=-1)


def periodic(period, frames, fps=30.0, turn=0.0):
    """A figure that swings its limbs with a period of so many frames, walks on and turns, degrees a frame."""
    base = walker(frames, fps)
    phase = 2 * np.pi * np.arange(frames) / period
    values = np.array(base.values)
    for column, name in enumerate(base.channels):
        joint, _, kind = name.rpartition(".")
        if kind[0] == "r":
            values[:, column] = (15 + column) * np.sin(phase + column)
        if joint == "hips":
            values[:, column] *= 0.1
    time = np.arange(frames)
    values[:, base.channels.index("hips.rx")] = 0
    values[:, base.channels.index("hips.ry")] = turn * time
    angle = np.radians(turn * time)
    values[:, base.channels.index("hips.tx")] = 0.04 * np.cumsum(np.sin(angle))
    values[:, base.channels.index("hips.tz")] = 0.04 * np.cumsum(np.cos(angle))
    values[:, base.channels.index("hips.ty")] = 0.9 + 0.02 * np.sin(2 * phase)
    return replace(base, values=values)


@pytest.mark.parametrize(("period", "frames", "fps"), [(32, 100, 30), (32, 40, 30), (35, 36, 30), (120, 300, 120)])
@pytest.mark.parametrize("turn", [0.0, 1.5])
def test_a_periodic_motion_gives_its_period(period, frames, fps, turn):
    motion = periodic(period, frames, fps, turn)
    loop = looped(motion)
    assert len(loop) % period == 0
    assert len(loop) > 0.4 * len(motion) or period == len(loop)
    # nothing differs, so nothing is changed
    shown = next(start for start in range(len(motion)) if np.allclose(motion.values[start], loop.values[0], atol=1e-6))
    np.testing.assert_allclose(positions(loop), positions(motion)[shown : shown + len(loop)], atol=1e-6)


def test_long_motions_are_compared_coarsely_first():
    motion = periodic(97, 4000, 120)
    loop = looped(motion)
    assert len(loop) % 97 == 0
    assert len(loop) > 2000
    # every second frame is compared, and an odd number of frames is found
    assert len(looped(periodic(1001, 1900, 120))) == 1001


def test_what_is_left_of_the_difference_is_spread():
    """Limbs that rise by and by, a body that sinks: after one period they are where they were."""
    motion = periodic(40, 55)
    drift = np.linspace(0, 1, len(motion))
    values = np.array(motion.values)
    values[:, motion.channels.index("hips.ty")] -= 0.01 * drift
    values[:, motion.channels.index("left_arm.rz")] += 2 * drift
    motion = replace(motion, values=values)
    loop = looped(motion)
    assert len(loop) == 40
    points = repeated(loop)
    # the step over the seam is the one between the same frames of the motion without drift
    even = periodic(40, 55)
    start = next(s for s in range(15) if np.abs(motion.values[s] - loop.values[0]).max() < 2)
    plain = steps(positions(even)[start : start + 41])[-1]
    np.testing.assert_allclose(steps(points)[39], plain, atol=2e-3)
    assert np.abs(positions(loop) - positions(motion)[start : start + 40]).max() < 0.03


@pytest.mark.parametrize("name", [WALK, RUN])
@pytest.mark.parametrize("fps", [30, 120])
@pytest.mark.parametrize("figure", [lambda motion: motion, on_humanoid])
def test_recorded_strides_have_no_leap_at_the_seam(clips, name, fps, figure):
    motion = figure(read_motion(clips / f"{name}.amc")).resample(fps)
    loop = looped(motion)
    assert 0.7 <= loop.duration < 1.2  # a stride
    gone, seam = steps(repeated(loop)), len(loop) - 1
    largest = steps(positions(motion)).max()
    assert gone[seam].max() <= largest
    # nor does any joint go slower or faster than in the frames around it
    assert np.abs(gone[seam] - (gone[seam - 1] + gone[seam + 1]) / 2).max() < 0.2 * largest
    assert loop.channels == motion.channels
    assert loop.units == motion.units


@pytest.mark.parametrize("name", [WALK, RUN])
def test_the_pose_after_the_last_is_the_first(clips, name):
    """Of the cut without its last frame put back, which the loop leaves out, every joint would be where it began."""
    motion = on_humanoid(read_motion(clips / f"{name}.amc")).resample(60)
    loop = looped(motion)
    points = turned_back(positions(loop), heading(loop))
    goes_on = points[-1] + (points[-1] - points[-2])
    leap = np.linalg.norm(goes_on - points[0], axis=-1).max()
    assert leap < 0.5 * steps(points).max()
    first = motion.values[:, 0]
    np.testing.assert_allclose(loop.values[:, 0], first[np.abs(first - loop.values[0, 0]).argmin() :][: len(loop)])


def test_who_stands_still_stands_still_as_long_as_can_be():
    motion = read_motion(SKELETONS / "mixamo.bvh")
    still = replace(motion, values=np.repeat(motion.values[:1], 60, axis=0), fps=30)
    loop = looped(still)
    assert len(loop) >= 58
    np.testing.assert_allclose(positions(loop), positions(still)[: len(loop)], atol=1e-9)


def test_hips_that_hang_on_a_root_at_rest_and_joints_of_one_angle():
    joints = (
        Joint("root", -1, (0.0, 0.0, 0.0)),
        Joint("hips", 0, (0.0, 0.0, 1.0)),
        Joint("leg", 1, (0.0, 0.0, -1.0)),
        Joint("leg_end", 2, (0.0, 1.0, 0.0)),
    )
    time = np.arange(60)
    swing = np.sin(2 * np.pi * time / 30)
    # the root stands z up: -90 degrees about x
    channels = {
        "root.rx": 0 * time - 90.0,
        "root.ry": 0.0 * time,
        "root.rz": 0.0 * time,
        "hips.tx": 0.01 * time,
        "hips.ty": 0.0 * time,
        "hips.tz": 1 + 0.02 * swing + 1e-4 * time,
        "leg.rx": 20 * swing + 0.02 * time,
    }
    values = np.stack(list(channels.values()), axis=1)
    units = ["deg" if name[-2] == "r" else "length" for name in channels]
    loop = looped(Motion(values, tuple(channels), tuple(units), 30, Skeleton(joints, 1.0)))
    assert len(loop) == 30
    moved = positions(loop)
    np.testing.assert_allclose(np.diff(moved[:, 1, 0]), 0.01)  # the way stays
    start = round(moved[0, 1, 0] / 0.01)
    part = values[start : start + 30]
    back = part - part[0] - (values[start + 30] - part[0]) * np.arange(30)[:, None] / 30
    leg = loop.values[:, -1]
    np.testing.assert_allclose(leg - leg[0], back[:, -1], atol=1e-9)
    np.testing.assert_allclose(moved[:, 1, 1] - moved[0, 1, 1], back[:, 5], atol=1e-9)


@pytest.mark.parametrize(
    ("frames", "shortest", "said"),
    [
        (0, 0.7, "too short for a loop of 0.7 s"),
        (21, 0.7, "too short"),
        (60, 2.0, "too short"),
        (60, 0, "longer than 0"),
    ],
)
def test_what_is_too_short(frames, shortest, said):
    with pytest.raises(MotionError, match=said):
        looped(periodic(20, frames), shortest)


def test_shortest_is_how_long_a_loop_takes_at_least():
    assert len(looped(periodic(10, 35), 0.2)) % 10 == 0
    assert len(looped(periodic(10, 35), 0.9)) == 30
    assert len(looped(periodic(21, 22), 0.7)) == 21


def test_where_nothing_repeats(clips):
    with pytest.raises(MotionError, match=r"no loop found: .* differs by .*, more than 4%; cut the motion"):
        looped(read_motion(clips / f"{BEND}.amc"))
    with pytest.raises(MotionError, match="no skeleton"):
        looped(replace(periodic(20, 60), skeleton=None))
