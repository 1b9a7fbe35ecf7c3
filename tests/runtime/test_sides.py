import pytest

from motet.motion.skeleton import partners_of, sides_of


@pytest.mark.parametrize(
    "pair",
    [
        ("lfemur", "rfemur"),
        ("LeftArm", "RightArm"),
        ("mixamorig:LeftArm", "mixamorig:RightArm"),
        ("arm_left", "arm_right"),
        ("LEFT_ARM", "RIGHT_ARM"),
        ("L_Arm", "R_Arm"),
        ("Arm.L", "Arm.R"),
        ("upper_arm.L.001", "upper_arm.R.001"),
        ("arm_l", "arm_r"),
        ("Bip01 L Thigh", "Bip01 R Thigh"),
        ("LThigh", "RThigh"),
        ("thighL", "thighR"),
        ("lShldr", "rShldr"),
        ("left_leg_left_toe", "right_leg_left_toe"),
    ],
)
def test_partners_by_name(pair):
    assert partners_of(("root", *pair, "lowerback", "head")) == (0, 2, 1, 3, 4)
    assert sides_of(pair) == ("left", "right")


def test_no_partner_where_no_such_name_is_there():
    assert partners_of(("root", "lowerback", "rib", "LeftArm", "lib")) == (0, 1, 4, 3, 2)


def test_sides_follow_from_mirrored_names():
    cmu = ("root", "lhipjoint", "rhipjoint", "lowerback", "rfoot", "lfoot", "lthumb")
    assert sides_of(cmu) == ("middle", "left", "right", "middle", "right", "left", "middle")
    assert sides_of(("m:Hips", "m:LeftLeg", "m:RightLeg")) == ("middle", "left", "right")
    assert sides_of(("LSx_joint", "RSx_joint", "hand.R", "hand.L")) == ("left", "right", "right", "left")
