"""A skeleton with Mixamo's names and the humanoid's proportions, for programs that know motions by those names."""

from motet.motion.humanoid import HUMANOID, LEFT_RIGHT, sided
from motet.motion.skeleton import END_SUFFIX, Joint, Skeleton

CENTIMETRE = 0.01

TRUNK = {
    "hips": "Hips",
    "spine": "Spine",
    "chest": "Spine1",
    "upperChest": "Spine2",
    "neck": "Neck",
    "head": "Head",
}

SIDES = {
    "Shoulder": "Shoulder",
    "UpperArm": "Arm",
    "LowerArm": "ForeArm",
    "Hand": "Hand",
    "UpperLeg": "UpLeg",
    "LowerLeg": "Leg",
    "Foot": "Foot",
    "Toes": "ToeBase",
}


def _mixamo() -> Skeleton:
    names = dict(TRUNK)
    for side in LEFT_RIGHT:
        names |= {sided(side, part): side.capitalize() + name for part, name in SIDES.items()}
    joints = []
    for joint in HUMANOID.joints:
        bone = joint.name.removesuffix(END_SUFFIX)
        x, y, z = (value / CENTIMETRE for value in joint.offset)
        joints.append(Joint(f"mixamorig:{names[bone]}{joint.name.removeprefix(bone)}", joint.parent, (x, y, z)))
    return Skeleton(tuple(joints), CENTIMETRE)


MIXAMO = _mixamo()
"""The skeleton, in centimetres, in a T-pose."""
