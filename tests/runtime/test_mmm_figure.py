from pathlib import Path

import numpy as np
import pytest

from motet.figures.humanoid.bones import HUMANOID, MMM_SKELETON, is_mmm, sole_points, with_figure
from motet.figures.humanoid.retarget import to_humanoid
from motet.formats import read_motion
from motet.motion.kinematics import global_transforms, positions
from motet.motion.motion import Motion

ROOT = ("root.tx", "root.ty", "root.tz", "root.rx", "root.ry", "root.rz")


def mmm(**angles: float) -> Motion:
    """Two frames of a motion as MMM files have them: standing, then with the angles given, in degrees."""
    names = ("LHx_joint", "RHx_joint", "LKx_joint", "LSx_joint", "LSy_joint", "LEx_joint", "LMrot_joint")
    values = np.zeros((2, len(ROOT) + len(names)))
    values[:, 1] = 0.9
    for name, degrees in angles.items():
        values[1, len(ROOT) + names.index(f"{name}_joint")] = np.radians(degrees)
    return Motion(values, (*ROOT, *names), ("m",) * 3 + ("rad",) * (3 + len(names)), 100.0)


@pytest.mark.parametrize(
    ("angle", "degrees", "bone", "sign"),
    [("LHx", 60, "leftLowerLeg", 1), ("LKx", -60, "leftFoot", -1), ("LSx", 60, "leftLowerArm", 1)],
)
def test_turns_about_the_axis_to_the_right_swing_limbs(angle: str, degrees: float, bone: str, sign: int) -> None:
    place = positions(to_humanoid(mmm(**{angle: degrees})).motion)[:, HUMANOID.index(bone)]
    assert sign * (place[1, 2] - place[0, 2]) > 0.1


def test_arms_hang_at_rest_and_left_is_left() -> None:
    assert is_mmm(mmm())
    figure = positions(with_figure(mmm()))[0]
    place = dict(zip(MMM_SKELETON.names, figure, strict=True))
    assert place["LW"][0] > 0.2 > -0.2 > place["RW"][0]
    assert place["LW"][1] < place["LE"][1] < place["LS"][1]
    humanoid = to_humanoid(mmm())
    assert humanoid.convention == "MMM of KIT"
    hand = positions(humanoid.motion)[0, HUMANOID.index("leftHand")]
    assert 0.1 < hand[0] < 0.25
    assert 0.8 < hand[1] < 1.0


def test_a_recorded_walk_goes_forward_on_the_ground(shared: Path) -> None:
    humanoid = to_humanoid(read_motion(shared / "kit" / "00001_mmm.xml"))
    rotations, places = global_transforms(humanoid.motion)
    travel = places[-1, 0] - places[0, 0]
    facing = rotations[:, 0, :, 2].mean(axis=0)
    assert travel @ facing / np.linalg.norm(travel) > 0.9
    lowest = sole_points(rotations, places)[..., 1].min(axis=1)
    assert np.quantile(lowest, 0.95) < 0.02
    knee = np.swapaxes(rotations[:, HUMANOID.index("leftUpperLeg")], -1, -2)
    bend = (knee @ rotations[:, HUMANOID.index("leftLowerLeg")])[:, 2, 1]
    assert bend.min() > -0.05
