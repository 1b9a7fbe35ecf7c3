"""The names that a convention gives the joints of a figure."""

import json
from importlib.resources import files
from typing import Any

from motet.figures.humanoid.bones import LEFT_RIGHT, part_of
from motet.figures.humanoid.joint_map import map_by_names
from motet.motion.kinematics import skeleton_of
from motet.motion.motion import Motion
from motet.motion.skeleton import END_SUFFIX


def names_of(motion: Motion, title: str) -> list[str]:
    """For each joint of a figure with known names the first name that a table has for it; others keep theirs."""
    tables: list[Any] = [
        json.loads(file.read_text("utf-8")) for file in (files("motet.figures.humanoid") / "conventions").iterdir()
    ]
    (table,) = (table for table in tables if table["title"] == title)
    skeleton = skeleton_of(motion)
    found = map_by_names(skeleton)
    assert found is not None
    names = list(skeleton.names)
    for bone, joint in found.joints.items():
        side = next((side for side in LEFT_RIGHT if bone.startswith(side)), "")
        word = table["sides"][0][LEFT_RIGHT.index(side)] if side else ""
        names[joint] = table["joints"][part_of(bone)][0].replace("{s}", word)
    for chain, joints in (("spine", found.spine), ("neck", found.neck)):
        for joint, name in zip(joints, table["joints"][chain], strict=False):
            names[joint] = name
    for joint, name in enumerate(skeleton.names):
        if name.endswith(END_SUFFIX):
            names[joint] = names[skeleton.joints[joint].parent] + END_SUFFIX
    return names
