"""Files that are not as they should be, as other makers write them: each fault is put into a good figure."""

from dataclasses import replace

import numpy as np
import pytest
from test_retarget import angles_between, dancing, skeleton_file

from motet.errors import MotionError
from motet.formats.writable import with_names
from motet.motion.kinematics import global_transforms, skeleton_of
from motet.motion.motion import Motion
from motet.motion.retarget import from_humanoid, to_humanoid
from motet.motion.skeleton import Joint, Skeleton


def apart(one: Motion, other: Motion) -> float:
    """The largest angle in degrees between the rotations in the world of two motions of the humanoid."""
    return float(np.degrees(angles_between(global_transforms(one)[0], global_transforms(other)[0]).max()))


def renamed(motion: Motion, **names: str) -> Motion:
    """The motion with other words in its joints' names."""
    found = list(skeleton_of(motion).names)
    for old, new in names.items():
        found = [name.replace(old, new) for name in found]
    return with_names(motion, found)


def test_where_half_of_the_names_are_known_the_tree_tells_the_rest() -> None:
    motion = from_humanoid(dancing(20), skeleton_file("mixamo"))
    found = to_humanoid(renamed(motion, Hips="Center", Spine="Abdomen"))
    assert found.convention == "by the tree"
    assert apart(found.motion, to_humanoid(motion).motion) < 1e-3


def test_where_neither_tells_the_names_that_are_missing_are_named() -> None:
    arms = Skeleton(tuple(joint for joint in skeleton_of(skeleton_file("mixamo")).joints[:1]))
    joints = [
        Joint(f"{side}{part}", 0, (0.1, 0.2, 0.0))
        for side in ("Left", "Right")
        for part in ("Arm", "Leg", "Foot", "UpLeg")
    ]
    with pytest.raises(MotionError, match="no joint was found for spine, leftLowerArm"):
        to_humanoid(Motion(np.zeros((1, 0)), (), (), 30.0, Skeleton((*arms.joints, *joints))))


def test_a_neck_may_hang_beside_the_end_of_the_back() -> None:
    """The arms on Chest2, the neck on Chest."""
    motion = skeleton_file("mixamo")
    skeleton = skeleton_of(motion)
    chest, end = (skeleton.index(f"mixamorig:{name}") for name in ("Spine1", "Spine2"))
    offset = np.add(skeleton.offsets[end], skeleton.offsets[skeleton.index("mixamorig:Neck")])
    joints = [replace(j, parent=chest, offset=tuple(offset)) if j.name.endswith("Neck") else j for j in skeleton.joints]
    found = to_humanoid(replace(motion, skeleton=Skeleton(tuple(joints))))
    assert found.convention == "Mixamo"
    assert found.joints["neck"] == ("mixamorig:Neck",)


def test_an_arm_may_end_in_the_wrist() -> None:
    """Forearms without a hand, whose tips are more than a hand's length away."""
    plain = Joint("hips", -1, (0.0, 0.9, 0.0))
    joints = [plain, Joint("back", 0, (0.0, 0.2, 0.0)), Joint("chest", 1, (0.0, 0.2, 0.0))]
    for side, x in (("l", 1), ("r", -1)):
        leg = [(f"{side}_a", 0, (0.1 * x, 0.0, 0.0)), (f"{side}_b", -1, (0.0, -0.42, 0.0))]
        leg += [(f"{side}_c", -1, (0.0, -0.42, 0.0)), (f"{side}_d", -1, (0.0, -0.05, 0.15))]
        arm = [(f"{side}_e", 2, (0.05 * x, 0.1, 0.0)), (f"{side}_f", -1, (0.12 * x, 0.0, 0.0))]
        arm += [(f"{side}_g", -1, (0.3 * x, 0.0, 0.0)), (f"{side}_g_end", -1, (0.3 * x, 0.0, 0.0))]
        for name, parent, offset in leg + arm:
            joints.append(Joint(name, len(joints) - 1 if parent < 0 else parent, offset))
    found = to_humanoid(Motion(np.zeros((2, 0)), (), (), 30.0, Skeleton(tuple(joints), 1.0)))
    assert found.joints["leftLowerArm"] == ("l_g",)
    assert "leftHand" not in found.joints
